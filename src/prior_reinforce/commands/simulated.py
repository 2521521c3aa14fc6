"""Stage 2 on the simulated tasks: demo, adapt."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

import prior_reinforce
from prior_reinforce.adapters import DEFAULT_ADAPTER, make_adapter
from prior_reinforce.arrays import Points
from prior_reinforce.commands.learning import GeneratorChoice
from prior_reinforce.commands.live import (
    LiveView,
    asking,
    fit_progress,
    say,
    trials_by_goal,
)
from prior_reinforce.commands.vision import Vlm, model_of
from prior_reinforce.commands.workspace import AdapterChoice
from prior_reinforce.environment import Task
from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.files import claim_folder
from prior_reinforce.generators import make_generator
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.vlm_client import without_secrets
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.report import AdaptationRecord, write_report
from prior_reinforce.report.summary import headline
from prior_reinforce.session.session import Session
from prior_reinforce.simulation.adaptation import goal_record, recording
from prior_reinforce.simulation.learned import load_learned, save_learned
from prior_reinforce.simulation.protocol import (
    perceive_demonstrations,
    reach_goals,
    unseen_goals,
)
from prior_reinforce.simulation.tasks import TASKS, make_task
from prior_reinforce.wording import say_count, say_tolerance

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

        ConfigurationError for an unknown task or prior set, or another plan format; FileFormatError
        if there is no such file.
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


@dataclass(frozen=True)
class _Reaching:
    """How goals are reached."""

    generator: GeneratorChoice = "diffusion"
    perception: PerceptionChoice = "eye"
    vlm: Vlm = None
    film: bool = True
    """`--no-film` draws no film of the last trial of each goal."""
    seed: int = 0
    """Seed of training, goals, disturbances and perception."""


@dataclass(frozen=True)
class Reached:
    """Goals that were worked through, and what their report says."""

    out: Path
    records: list[AdaptationRecord]
    title: str
    facts: dict[str, str]
    region: Points

    def __str__(self) -> str:
        """The count, for a person."""
        said = headline(self.records)
        return ", ".join(filter(None, [said.text, said.count]))

    def write(self, note: str = "") -> int:
        """Write the report; exit status 1 if a goal was not reached."""
        console = Console()
        page = write_report(
            self.out,
            self.records,
            title=self.title,
            facts=self.facts,
            region=self.region,
            note=note,
        )
        say(console, f"report: {page}")
        if (self.out / SEEN).is_dir():
            say(console, f"what was seen, with boxes and all answers: {self.out / SEEN}")
        return 0 if all(record.trials_to_hit for record in self.records) else 1


@dataclass(frozen=True)
class Adapt(_Reaching, OnTask):
    """Reach new goals on a simulated task, trial by trial (Stage 2), and write the report.

    For example:
        prior-reinforce adapt --task curling --goal 0.92 0.05
    """

    goal: tuple[str, ...] = ("random",)
    """The goal in metres, for instance `0.92 0.10` (forward, left), or `random`. Several are worked
    through one after another, as in one afternoon: `0.92 0.10 1.05 -0.10`, `random random`."""
    model: Path | None = None
    """Folder of a model learned before; None learns one now."""
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
        reached = self.reach(task, demonstrations, self._goals(task, demonstrations))
        return reached.write()

    def reach(
        self, task: Task, demonstrations: Demonstrations, goals: Points, *, perceive: bool = False
    ) -> Reached:
        """Learn, and work through goals in one session, in [m].

        With `perceive` the demonstrations are executed first, for their outcomes to be seen.
        """
        console = Console()
        # Made first, so that a wrong setting is reported before anything is learned.
        adapter, generator = make_adapter(self.adapter), make_generator(self.generator)
        model = model_of(self.vlm)
        with make_perception(
            self.perception, scene=task.scene, config=model, seed=self.seed
        ) as perception:
            claim_folder(self.out)
            if perceive:
                demonstrations = self._perceive(task, demonstrations, perception, console)
            if self.model is None:
                with fit_progress(console) as progress:
                    generator = generator.fit(demonstrations, seed=self.seed, progress=progress)
                say(console, f"learned: {'; '.join(generator.remarks) or 'in closed form'}")
                save_learned(self.out / "model", generator, demonstrations, self.seed)
            else:
                generator = load_learned(self.model, demonstrations)
            session = Session(generator, adapter, demonstrations)
            records = self._adapt(task, session, perception, goals, console)
        seen_by = self.perception
        if seen_by.split(",")[0] == "vlm":
            seen_by += f", {model.model} at {without_secrets(model.base_url)}"
        outcomes = f"seen by {self.perception}" if perceive else "exact"
        tolerance = say_tolerance(demonstrations.outcome_format.within(task.tolerance))
        facts = {
            "Task": f"{task.name}, tolerance {tolerance}",
            "Demonstrations": f"{demonstrations.n}, {self.demonstrations}, outcomes {outcomes}",
            "Generator": self.generator if self.model is None else f"the model in {self.model}",
            "Adapter": self.adapter,
            "Perception": seen_by,
            "Seed": str(self.seed),
            "Trials by goal": trials_by_goal(records),
            "Earlier goals' trials used": "yes" if session.goals[-1].carry_over else "no",
            "Version": prior_reinforce.__version__,
        }
        title = f"{task.name}: {say_count(len(goals), 'new goal')}"
        return Reached(self.out, records, title, facts, task.region)

    def _perceive(
        self, task: Task, recorded: Demonstrations, perception: Perception, console: Console
    ) -> Demonstrations:
        """Execute the demonstrations once, see where they go, and keep that for `adapt`."""
        shown = say_count(recorded.n, "demonstration")
        say(console, f"executing {shown} once, seen by {self.perception}")
        eyes = recording(perception, self.out / SEEN, "demonstration")
        ask = asking(console, recorded, eyes)
        seen = perceive_demonstrations(task, recorded, eyes, seed=self.seed, on_failed_reading=ask)
        path = self.out / "demonstrations.npz"
        seen.save(path)
        say(console, f"their outcomes, as seen: {path}")
        return seen

    def _adapt(
        self, task: Task, session: Session, perception: Perception, goals: Points, console: Console
    ) -> list[AdaptationRecord]:
        """Work through goals in one session, with a live view."""
        view = LiveView(console, session.demonstrations)
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
            film_in, demonstrations = self.out if self.film else None, session.demonstrations
            record = goal_record(task, demonstrations, result, i, film_in=film_in, seed=seed)
            if self.film and record.film is None:
                say(console, record.film_caption)
            records.append(record)
        view.summary(records)
        return records

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
    """The main job: shown once, seen by eye, then five unseen goals; the paper's six beside it.

    For example:
        prior-reinforce demo --out runs/demo
    """

    out: Path = Path("runs/demo")
    """Folder for the report; what six demonstrations did is in its folder `six`."""
    goals: int = 5
    """Number of unseen goals."""
    six: bool = True
    """`--no-six` does without the paper's way beside it: the same goals from six demonstrations,
    without symmetry, by a Gaussian process."""

    def run(self) -> int:
        """See one demonstration, adapt; the same with six; report."""
        if self.goals < 1:
            raise ConfigurationError(f"--goals must be at least 1, got {self.goals}")
        console, own = Console(), {**vars(self)}
        own.pop("goals"), own.pop("six")
        moved = "" if "symmetry=" in self.generator else ",symmetry=use"
        once = Adapt(**{**own, "generator": self.generator + moved})
        task, recorded = once.open()
        goals = unseen_goals(task, recorded, self.goals, np.random.default_rng([self.seed, 3]))
        say(console, ("one demonstration", "bold"))
        reached, note = once.reach(task, recorded.only([0]), goals, perceive=True), ""
        if self.six:
            say(console, ("\nsix demonstrations, as in the paper", "bold"))
            paper = Adapt(**{**own, "adapter": "gp", "out": self.out / "six", "film": False})
            beside = paper.reach(task, recorded.without_symmetry(), goals, perceive=True)
            beside.write()
            note = f"As in the paper, with the same goals: {beside} (six/report.html)."
            say(console, f"\nshown once: {reached}\nas in the paper: {beside}")
        return reached.write(note)
