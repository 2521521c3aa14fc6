"""Stage 2 on the simulated tasks: demo, adapt, rollout."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from prior_reinforce.adapters import DEFAULT_ADAPTER, make_adapter
from prior_reinforce.arrays import Frames, Point, Points
from prior_reinforce.commands.learning import Fitting, GeneratorChoice
from prior_reinforce.commands.live import (
    LiveView,
    asking,
    fit_progress,
    say,
    say_outcome,
    trials_by_goal,
)
from prior_reinforce.commands.workspace import AdapterChoice
from prior_reinforce.environment import Task
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidGoalError
from prior_reinforce.files import claim_folder
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.lab.experiments.adaptation import goal_record, recording
from prior_reinforce.lab.experiments.learned import load_learned, save_learned
from prior_reinforce.lab.experiments.protocol import (
    GoalTrials,
    is_hit,
    perceive_demonstrations,
    reach_goals,
    unseen_goals,
)
from prior_reinforce.lab.tasks import TASKS, make_task
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig, without_secrets
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import as_tolerance
from prior_reinforce.report import AdaptationRecord, record_film, write_report
from prior_reinforce.session.session import Session
from prior_reinforce.wording import say_tolerance

SEEN = "seen"
"""Folder beside the report for what a camera or a model saw and said."""

TaskChoice = Annotated[str, tyro.conf.arg(help=f"Task to simulate: {TASKS.help}.")]
PerceptionChoice = Annotated[
    str, tyro.conf.arg(help=f"How a trial's error is seen: {PERCEPTIONS.help}.")
]


@dataclass(frozen=True)
class OnTask:
    """A simulated task, and demonstrations for it."""

    task: TaskChoice = "basketball-v1"
    demonstrations: str = "A"
    """Prior set of the task (A or B; in the zoo KIND-COUNT-SEED, as clean-6-0), or the path of a
    demonstrations file of the same plan format."""

    def open(self) -> tuple[Task, Demonstrations]:
        """Make the task and load the demonstrations.

        Raises:
            ConfigurationError: An unknown task or prior set, or another plan format.
            FileFormatError: No such file.
        """
        task, given = make_task(self.task), self.demonstrations
        if not (given.endswith(".npz") or Path(given).is_file()):
            return task, task.demonstrations(given)
        loaded = Demonstrations.load(given)
        if loaded.format.names != task.format.names:
            raise ConfigurationError(
                f"{given} moves {loaded.format.names}, but {task.name} needs "
                f"{task.format.names}; choose the task that it was recorded on"
            )
        return task, loaded


def learn(
    demonstrations: Demonstrations, folder: Path, generator: Generator, seed: int, console: Console
) -> Generator:
    """Fit a generator under a progress line, say what it could not learn, and save it."""
    with fit_progress(console) as progress:
        generator = generator.fit(demonstrations, seed=seed, progress=progress)
    say(console, f"learned: {'; '.join(generator.remarks) or 'in closed form'}")
    save_learned(folder, generator, demonstrations, seed)
    return generator


@dataclass(frozen=True)
class Train(Fitting, OnTask):
    """Learn outcome -> plan from a simulated task's demonstrations (Stage 1), for `--model`.

    For example:
        prior-reinforce train --task curling --generator diffusion --out runs/curling
    """

    out: Path = Path("runs/model")
    """Folder for the model."""

    def run(self) -> None:
        """Fit and save."""
        console = Console()
        # Made first: a wrong setting is reported before anything is read.
        generator = make_generator(self.choice, device=self.device)
        _, demonstrations = self.open()
        claim_folder(self.out)
        learn(demonstrations, self.out, generator, self.seed, console)
        say(console, f"model of {demonstrations.n} demonstrations saved in {self.out}")


@dataclass(frozen=True)
class _Reaching:
    """How goals are reached."""

    generator: GeneratorChoice = "diffusion"
    perception: PerceptionChoice = "eye"
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model for --perception vlm (docs/perception.md)."""
    film: bool = True
    """Draw the last trial of each goal as a film."""
    seed: int = 0
    """Seed of training, goals, disturbances and perception."""


@dataclass(frozen=True)
class Adapt(_Reaching, OnTask):
    """Reach new goals on a simulated task, trial by trial (Stage 2), and write the report.

    For example:
        prior-reinforce adapt --task curling --goal 1.9 0.1
    """

    goal: tuple[str, ...] = ("random",)
    """The goal in metres, for instance `0.92 0.10` (forward, left), or `random`. Several are worked
    through one after another, as in one afternoon: `0.92 0.10 1.05 -0.10`, `random random`."""
    model: Path | None = None
    """Folder of a model learned before; None learns one now. It knows its generator itself, unless
    that is a class of your own."""
    adapter: AdapterChoice = DEFAULT_ADAPTER
    rounds: int = 10
    """Largest number of trials per goal."""
    out: Path = Path("runs/adapt")
    """Folder for the model and the report."""

    def run(self) -> int:
        """Adapt; exit status 1 if the goal was not reached."""
        task, demonstrations = self.open()
        if self.rounds < 1:
            raise ConfigurationError(f"--rounds must be at least 1, got {self.rounds}")
        return self.reach(task, demonstrations, self._goals(task, demonstrations))

    def reach(
        self, task: Task, demonstrations: Demonstrations, goals: Points, *, perceive: bool = False
    ) -> int:
        """Learn, work through goals in one session, and write the report.

        Args:
            task: Where they are tried.
            demonstrations: D_prior.
            goals: Each is worked through in turn, [m].
            perceive: Whether the demonstrations are executed first, for their outcomes to be seen.

        Returns:
            Exit status: 1 if a goal was not reached.
        """
        console = Console()
        # Made first, so that a wrong setting is reported before anything is learned.
        adapter, unfitted = make_adapter(self.adapter), make_generator(self.generator)
        with make_perception(
            self.perception, scene=task.scene, config=self.vlm, seed=self.seed
        ) as perception:
            claim_folder(self.out)
            if perceive:
                demonstrations = self._perceive(task, demonstrations, perception, console)
            if self.model is None:
                folder = self.out / "model"
                generator = learn(demonstrations, folder, unfitted, self.seed, console)
            else:
                generator = load_learned(self.model, demonstrations, generator=self.generator)
            session = Session(generator, adapter, demonstrations)
            results, records = self._adapt(task, session, perception, goals, console)
        seen_by = self.perception
        if seen_by.split(",")[0] == "vlm":
            seen_by += f", {self.vlm.model} at {without_secrets(self.vlm.base_url)}"
        outcomes = f"seen by {self.perception}" if perceive else "exact"
        names, units = demonstrations.outcome_names, demonstrations.outcome_units
        tolerance = say_tolerance(as_tolerance(task.tolerance, names, units), names, units)
        facts = {
            "Task": f"{task.name}, tolerance {tolerance}",
            "Demonstrations": f"{demonstrations.n}, {self.demonstrations}, outcomes {outcomes}",
            "Generator": self.generator if self.model is None else f"the model in {self.model}",
            "Adapter": self.adapter,
            "Perception": seen_by,
            "Seed": str(self.seed),
            "Trials by goal": trials_by_goal(results),
            "Earlier goals' trials used": "yes" if session.goals[-1].carry_over else "no",
            "Version": version("prior-reinforce"),
        }
        title = f"{task.name}: {len(goals)} new goal" + "s" * (len(goals) > 1)
        page = write_report(self.out, records, title=title, facts=facts, region=task.region)
        say(console, f"report: {page}")
        if hasattr(perception, "last_reading") and (self.out / SEEN).is_dir():
            say(console, f"what was seen, with boxes and all answers: {self.out / SEEN}")
        return 0 if all(result.solved_at for result in results) else 1

    def _perceive(
        self, task: Task, recorded: Demonstrations, perception: Perception, console: Console
    ) -> Demonstrations:
        """Execute the demonstrations once, see where they go, and keep that for `adapt`."""
        say(console, f"executing {recorded.n} demonstrations once, seen by {self.perception}")
        eyes = recording(perception, self.out / SEEN, "demonstration")
        ask = asking(console, recorded, eyes)
        seen = perceive_demonstrations(task, recorded, eyes, seed=self.seed, on_failed_reading=ask)
        path = self.out / "demonstrations.npz"
        seen.save(path)
        say(console, f"their outcomes, as seen: {path}")
        return seen

    def _adapt(
        self, task: Task, session: Session, perception: Perception, goals: Points, console: Console
    ) -> tuple[list[GoalTrials], list[AdaptationRecord]]:
        """Work through goals in one session, with a live view."""
        view = LiveView(console, session.demonstrations)
        results: list[GoalTrials] = []
        records: list[AdaptationRecord] = []
        for i, goal in enumerate(goals, start=1):
            view.goal(i, len(goals), goal)
            seed = self.seed + i - 1
            eyes = recording(perception, self.out / SEEN, f"goal{i}-trial")
            session.set_goal(goal, task.tolerance)
            (result,) = reach_goals(
                task,
                [session],
                eyes,
                rounds=self.rounds,
                seed=seed,
                on_round=lambda _, so_far: view.trial(so_far[0]),
                on_failed_reading=asking(console, session.demonstrations, eyes),
            )
            view.end(result)
            results.append(result)
            film_in, demonstrations = self.out if self.film else None, session.demonstrations
            record = goal_record(task, demonstrations, result, i, film_in=film_in, seed=seed)
            if self.film and record.film is None:
                say(console, record.film_caption)
            records.append(record)
        view.summary(results)
        return results, records

    def _goals(self, task: Task, demonstrations: Demonstrations) -> Points:
        if set(self.goal) == {"random"}:
            return task.sample_goals(len(self.goal), np.random.default_rng([self.seed, 2]))
        try:
            numbers = [float(word) for word in self.goal]
        except ValueError as error:
            raise InvalidGoalError(
                f"--goal {' '.join(self.goal)} is neither numbers in metres nor `random`"
            ) from error
        k = max(len(numbers) // demonstrations.outcome_dim, 1)  # a goal that is cut off is named
        return np.array([demonstrations.check_goal(goal) for goal in np.array_split(numbers, k)])


@dataclass(frozen=True)
class Demo(_Reaching):
    """The main job: six demonstrations seen by eye and learned from, then five unseen goals.

    For example:
        prior-reinforce demo --out runs/demo
    """

    out: Path = Path("runs/demo")
    """Folder for the model and the report."""
    goals: int = 5
    """Number of unseen goals."""

    def run(self) -> int:
        """See the demonstrations, learn, adapt, report."""
        if self.goals < 1:
            raise ConfigurationError(f"--goals must be at least 1, got {self.goals}")
        adapt = Adapt(**{name: value for name, value in vars(self).items() if name != "goals"})
        task, recorded = adapt.open()
        goals = unseen_goals(task, recorded, self.goals, np.random.default_rng([self.seed, 3]))
        return adapt.reach(task, recorded, goals, perceive=True)


@dataclass(frozen=True)
class Rollout(OnTask):
    """Execute one plan on a simulated task: a demonstration's, or one generated for a condition.

    For example:
        prior-reinforce rollout --task curling --demonstration 0 --repeats 5
    """

    demonstration: int | None = None
    """Number of the demonstration to execute, from 0."""
    condition: tuple[float, ...] | None = None
    """Condition to generate the plan for, in metres; needs --model."""
    model: Path | None = None
    """Folder of a model made by `train`."""
    repeats: int = 1
    """How often to execute the plan."""
    film: Path | None = None
    """Write the first execution as a film to this .mp4 file."""
    seed: int = 0
    """Seed of the disturbances."""

    def run(self) -> None:
        """Execute and print where it went."""
        console = Console()
        task, demonstrations = self.open()
        plan, aim = self._plan(demonstrations)
        if self.repeats < 1:
            raise ConfigurationError(f"--repeats must be at least 1, got {self.repeats}")
        if self.film is not None and self.film.suffix != ".mp4":
            raise ConfigurationError(f"--film must name an .mp4 file, got {self.film}")
        if self.film is not None and self.film.exists():
            raise FileFormatError(f"{self.film} is there already; choose another name")
        plans = np.repeat(plan[None], self.repeats, axis=0)
        rollouts = task.rollout(plans, np.random.default_rng(self.seed))
        units = demonstrations.outcome_units
        for number, rollout in enumerate(rollouts, start=1):
            hit = "  within the tolerance" if is_hit(rollout, aim, task.tolerance) else ""
            lost = "" if rollout.valid else "  (lost: it has no place on the table)"
            place = say_outcome(rollout.outcome, task.outcome_names, units)
            say(console, f"rollout {number}: {place}{lost}{hit}")
        if self.repeats > 1:
            outcomes = np.array([rollout.outcome for rollout in rollouts])
            spread = [
                f"{100 * value:.2f} cm" if unit == "m" else f"{value:.4f} {unit}"
                for value, unit in zip(outcomes.std(axis=0, ddof=1), units, strict=True)
            ]
            say(console, "spread (sd): " + ", ".join(spread))
        if self.film is not None:
            frames = task.film(plan, aim, np.random.default_rng(self.seed))
            film = record_film(frames, self.film.parent, self.film.stem)
            say(console, f"film: {film.video}, its key moments: {film.strip}")

    def _plan(self, demonstrations: Demonstrations) -> tuple[Frames, Point]:
        """The plan to execute, and the outcome that it is for."""
        if (self.demonstration is None) == (self.condition is None):
            raise ConfigurationError("give either --demonstration or --condition")
        if self.demonstration is not None:
            number = self.demonstration
            if not 0 <= number < demonstrations.n:
                raise ConfigurationError(
                    f"--demonstration must be 0 to {demonstrations.n - 1}, got {number}"
                )
            return demonstrations.plans[number], demonstrations.outcomes_seen[number]
        if self.model is None:
            raise ConfigurationError("--condition needs --model, a folder made by train")
        condition = demonstrations.check_goal(self.condition or ())
        generator = load_learned(self.model, demonstrations)
        return generator.generate(condition[None])[0], condition
