"""Stage 2 on the simulated tasks: demo, adapt, rollout."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.console import Console

from prior_reinforce.commands.learning import learn, load_learned
from prior_reinforce.commands.live import LiveView
from prior_reinforce.commands.operator import KeptSight, Operator
from prior_reinforce.commands.task_options import Simulated
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidGoalError,
    RenderingUnavailableError,
)
from prior_reinforce.experiments.goals import unseen_goals
from prior_reinforce.experiments.methods import make_adapter
from prior_reinforce.experiments.protocol import GoalTrials, is_hit, run_goals
from prior_reinforce.experiments.sight import MODEL, open_sight
from prior_reinforce.generators import DiffusionConfig, Generator
from prior_reinforce.motions import Demonstrations
from prior_reinforce.perception import (
    Perception,
    VisionLanguageModel,
    VisionLanguageModelConfig,
)
from prior_reinforce.report import AdaptationRecord, Film, record_film, write_report
from prior_reinforce.tasks import Task


@dataclass(frozen=True)
class Adapt(Simulated):
    """Reach a new goal on a simulated task, trial by trial (Stage 2), and write the report."""

    goal: tuple[str, ...] = ("random",)
    """The goal in metres, for instance `0.92 0.10` (forward, left), or `random`."""
    perception: str = "eye"
    """How a trial's error is seen: exact, eye, amplified, vlm (a vision-language model, --vlm.*),
    stand-in (the same way without a model: objects found by colour), or one's own as
    module:Class."""
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model for --perception vlm (docs/perception.md)."""
    adapter: str = "gp"
    """How the condition is corrected: gp (m = 2), gp-all (m = infinity), proportional, frozen, or
    one's own as module:Class."""
    rounds: int = 10
    """Trials at most."""
    model: Path | None = None
    """Folder of a model made by `learn`; None learns one now."""
    out: Path = Path("runs/adapt")
    """Folder for the report."""
    film: bool = True
    """Draw the last trial as a film."""

    def run(self) -> int:
        """Adapt; exit status 1 if the goal was not reached."""
        console = Console()
        task, demonstrations = self.open()
        if self.rounds < 1:
            raise ConfigurationError(f"--rounds must be at least 1, got {self.rounds}")
        goals = self._goals(task, demonstrations)
        make_adapter(self.adapter)
        # Opened first, so that a wrong setting is told before anything is learned.
        with open_sight(self.perception, task.name, self.vlm) as sight:
            if self.model is None:
                generator = learn(
                    demonstrations,
                    self.out / "model",
                    config=DiffusionConfig(),
                    seed=self.seed,
                    console=console,
                )
            else:
                generator = load_learned(self.model, demonstrations)
            results = adapt(self, task, demonstrations, generator, sight, goals, console)
        return 0 if all(result.solved_at for result in results) else 1

    def _goals(self, task: Task, demonstrations: Demonstrations) -> np.ndarray:
        if self.goal == ("random",):
            return task.sample_goals(1, np.random.default_rng([self.seed, 2]))
        try:
            goal = [float(word) for word in self.goal]
        except ValueError as error:
            raise InvalidGoalError(
                f"--goal {' '.join(self.goal)} is neither numbers in metres nor `random`"
            ) from error
        return demonstrations.check_goal(goal)[None]


@dataclass(frozen=True)
class Demo:
    """The main job: learn from six demonstrations, then reach five unseen goals by eye."""

    out: Path = Path("runs/demo")
    """Folder for the model and the report."""
    seed: int = 0
    """Seed of training, goals, disturbances and perception."""
    goals: int = 5
    """Number of unseen goals."""
    perception: str = "eye"
    """How a trial's error is seen; see `adapt`."""
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model for --perception vlm (docs/perception.md)."""
    film: bool = True
    """Draw the hits as films."""

    def run(self) -> int:
        """Learn, adapt, report."""
        console = Console()
        if self.goals < 1:
            raise ConfigurationError(f"--goals must be at least 1, got {self.goals}")
        settings = Adapt(
            seed=self.seed,
            perception=self.perception,
            vlm=self.vlm,
            out=self.out,
            film=self.film,
        )
        task, demonstrations = settings.open()
        goals = unseen_goals(
            task, demonstrations, self.goals, np.random.default_rng([self.seed, 3])
        )
        with open_sight(self.perception, task.name, self.vlm) as sight:
            generator = learn(
                demonstrations,
                self.out / "model",
                config=DiffusionConfig(),
                seed=self.seed,
                console=console,
            )
            results = adapt(settings, task, demonstrations, generator, sight, goals, console)
        return 0 if all(result.solved_at for result in results) else 1


@dataclass(frozen=True)
class Rollout(Simulated):
    """Execute one plan on a simulated task: a demonstration's, or one generated for a condition."""

    demonstration: int | None = None
    """Number of the demonstration to execute, from 0."""
    condition: tuple[float, ...] | None = None
    """Condition to generate the plan for, in metres; needs --model."""
    model: Path | None = None
    """Folder of a model made by `learn`."""
    repeats: int = 1
    """How often to execute the plan."""
    film: Path | None = None
    """Write the first execution as a film to this .mp4 file."""

    def run(self) -> None:
        """Execute and print where it went."""
        console = Console()
        task, demonstrations = self.open()
        plan, aim = self._plan(demonstrations)
        if self.repeats < 1:
            raise ConfigurationError(f"--repeats must be at least 1, got {self.repeats}")
        if self.film is not None and self.film.suffix != ".mp4":
            raise ConfigurationError(f"--film must name an .mp4 file, got {self.film}")
        plans = np.repeat(plan[None], self.repeats, axis=0)
        rollouts = task.rollout(plans, np.random.default_rng(self.seed))
        outcomes = np.array([rollout.outcome for rollout in rollouts])
        for number, rollout in enumerate(rollouts, start=1):
            place = ", ".join(
                f"{name} {value:.3f} m"
                for name, value in zip(task.outcome_names, rollout.outcome, strict=True)
            )
            hit = "  within the tolerance" if is_hit(rollout, aim, task.tolerance) else ""
            lost = "" if rollout.valid else "  (lost: it has no place on the table)"
            console.print(f"rollout {number}: {place}{lost}{hit}")
        if self.repeats > 1:
            spread = outcomes.std(axis=0, ddof=1) * 100
            console.print("spread (sd): " + ", ".join(f"{value:.2f} cm" for value in spread))
        if self.film is not None:
            frames = task.film(plan, aim, np.random.default_rng(self.seed))
            film = record_film(frames, self.film.parent, self.film.stem)
            console.print(f"film: {film.video}, its key moments: {film.strip}")

    def _plan(self, demonstrations: Demonstrations) -> tuple[np.ndarray, np.ndarray]:
        if (self.demonstration is None) == (self.condition is None):
            raise ConfigurationError("give either --demonstration or --condition")
        if self.demonstration is not None:
            if not 0 <= self.demonstration < demonstrations.n:
                raise ConfigurationError(
                    f"--demonstration must be 0 to {demonstrations.n - 1}, got {self.demonstration}"
                )
            return (
                demonstrations.plans[self.demonstration],
                demonstrations.outcomes_seen[self.demonstration],
            )
        if self.model is None:
            raise ConfigurationError("--condition needs --model, a folder made by learn")
        condition = demonstrations.check_goal(self.condition or ())
        generator = load_learned(self.model, demonstrations)
        return generator.generate(condition[None])[0], condition


def adapt(
    settings: Adapt,
    task: Task,
    demonstrations: Demonstrations,
    generator: Generator,
    sight: Perception,
    goals: np.ndarray,
    console: Console,
) -> list[GoalTrials]:
    """Work through the goals one after another, with a live view, and write the report."""
    view = LiveView(console, demonstrations.n)
    results: list[GoalTrials] = []
    films: list[tuple[Film | None, str]] = []
    for i, goal in enumerate(goals):
        view.goal(i + 1, len(goals), goal)
        seed = settings.seed + i
        kept = sight
        if isinstance(sight, VisionLanguageModel):
            kept = KeptSight(sight, settings.out / "seen", i + 1)
        (result,) = run_goals(
            task,
            generator,
            lambda: make_adapter(settings.adapter),
            kept,
            demonstrations,
            goal[None],
            rounds=settings.rounds,
            seed=seed,
            on_round=lambda _, so_far: view.trial(so_far[0]),
            on_failed_reading=Operator(console, kept).look,
        )
        view.end(result)
        results.append(result)
        films.append(_film(settings, task, result, seed, i + 1, console))
    view.summary(results)
    page = write_report(
        settings.out,
        [
            AdaptationRecord(
                title=f"Goal {i}",
                demonstrations=demonstrations,
                goal=result.goal,
                tolerance=task.tolerance,
                trials=result.trials,
                outcomes=tuple(rollout.outcome for rollout in result.rollouts),
                film=film,
                film_caption=caption,
            )
            for i, (result, (film, caption)) in enumerate(zip(results, films, strict=True), start=1)
        ],
        title=f"{task.name}: {len(goals)} new goal" + ("s" if len(goals) > 1 else ""),
        facts={
            "Task": f"{task.name}, tolerance {task.tolerance * 100:g} cm",
            "Demonstrations": f"set {settings.demonstrations}, {demonstrations.n}",
            "Generator": generator.name,
            "Adapter": settings.adapter,
            "Perception": _seen_by(settings),
            "Seed": str(settings.seed),
            "Version": version("prior-reinforce"),
        },
        region=task.region,
    )
    console.print(f"report: {page}")
    if isinstance(sight, VisionLanguageModel):
        console.print(
            f"what the model saw, with boxes, and all that it said: {settings.out / 'seen'}"
        )
    return results


def _seen_by(settings: Adapt) -> str:
    if settings.perception == MODEL:
        return f"{MODEL}, {settings.vlm.model} at {settings.vlm.base_url}"
    return settings.perception


def _film(
    settings: Adapt, task: Task, result: GoalTrials, seed: int, number: int, console: Console
) -> tuple[Film | None, str]:
    """Film the last trial as it was executed, with a caption that says why where none is drawn."""
    last = result.trials[-1]
    if not settings.film:
        return None, "no film was asked for"
    try:
        frames = task.film(last.plan, result.goal, np.random.default_rng([seed, 0, last.number]))
        film = record_film(frames, settings.out, f"goal{number}")
    except RenderingUnavailableError as error:
        console.print(f"no film: {error}")
        return None, f"no film: {error}"
    return film, f"trial {last.number}, " + ("which reached the goal" if last.hit else "a miss")
