"""The units that everything is made of: perceive demonstrations; learn; throw once; try goals."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters import make_adapter
from prior_reinforce.arrays import Points
from prior_reinforce.environment import Task
from prior_reinforce.files import in_place
from prior_reinforce.formats import in_tolerances
from prior_reinforce.generators import Generator, load_generator, make_generator
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.perception import make_perception
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.registry import parse_choice
from prior_reinforce.simulation.protocol import (
    GoalTrials,
    estimate_by_eye,
    perceive_demonstrations,
    run_goals,
    unseen_goals,
)
from prior_reinforce.simulation.tasks import make_task
from reproduction.demonstrations import prior_set
from reproduction.results import as_text, rows_of
from reproduction.units import Unit, digest_of, result_of

GOAL_SEED = 100
"""Seed of the reported goals; what was decided looking at them: reproduction/docs/decisions.md."""
_SEEN = ("outcomes_seen", "outcome_noise", "outcome_correction")
"""What perception says of demonstrations."""


@dataclass(frozen=True)
class PerceivedDemonstrations(Unit):
    """Execute a prior set once and see where it went (paper, Stage 1); whoever learns shares it."""

    task: str
    """Where it is executed."""
    demonstrations: str
    """Prior set, A or B."""
    perception: str
    """Perception, by its choice."""
    seed: int
    """Seed of the training that it is for."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint to ask where `perception` is vlm."""

    def __str__(self) -> str:
        return f"perceive {self.task} {self.demonstrations} by {self.perception}, {self.seed}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Execute and look."""
        task = make_task(self.task)
        failures: list[str] = []

        def count_and_estimate(failure: Any, *seen: Any) -> Any:
            failures.append(str(failure))
            return estimate_by_eye(failure, *seen)

        seed = GOAL_SEED + self.seed
        with make_perception(
            self.perception, scene=task.scene, config=self.model, seed=seed
        ) as perception:
            perceived = perceive_demonstrations(
                task,
                prior_set(task, self.demonstrations),
                perception,
                seed=seed,
                on_failed_reading=count_and_estimate,
            )
        seen = {name: getattr(perceived, name).tolist() for name in _SEEN}
        return {**seen, "failed_readings": len(failures)}

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a demonstration."""
        seen = result["outcomes_seen"]
        told = {"learned_on": self.task, "set": self.demonstrations, "seed": self.seed}
        return rows_of(
            {**told, "perception": self.perception},
            demonstration=range(len(seen)),
            seen=map(as_text, seen),
            failed_readings=[result["failed_readings"], *[0] * (len(seen) - 1)],
        )


@dataclass(frozen=True, eq=False)
class LearnedGenerator:
    """What a training gives."""

    generator: Generator
    """pi."""
    prior: Demonstrations
    """What it was learned from, with the outcomes that were seen."""


@dataclass(frozen=True)
class Training(Unit):
    """Learn one generator from one prior set."""

    task: str
    """Name of the task that the demonstrations are of."""
    demonstrations: str
    """Prior set, A or B."""
    generator: str
    """Generator, by its choice: `nearest,timing=align`."""
    seed: int
    """Seed of the training."""
    subset: tuple[int, ...] | None = None
    """Which of the demonstrations to learn from; None for all."""
    perception: str | None = None
    """How the outcomes of the demonstrations are seen, by its choice; None for the exact ones."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint to ask where `perception` is vlm."""
    device: str = "cpu"
    """Where a network is trained and run: `cpu`, or `cuda`, whose last digits are other ones."""

    def __str__(self) -> str:
        how = "" if self.perception is None else f" by {self.perception}"
        return f"learn {self.generator} on {self.task} {self.demonstrations}{how}, {self.seed}"

    @property
    def perceived(self) -> PerceivedDemonstrations | None:
        """The demonstrations as perceived, the same for every generator; None: exact outcomes."""
        if self.perception is None:
            return None
        return PerceivedDemonstrations(
            self.task, self.demonstrations, self.perception, self.seed, self.model
        )

    @property
    def needs(self) -> tuple[Unit, ...]:
        """The demonstrations as perceived."""
        return () if self.perceived is None else (self.perceived,)

    @property
    def columns(self) -> dict[str, Any]:
        """What rows of the table of raw results say of it."""
        return {
            "learned_on": self.task,
            "set": self.demonstrations,
            "seed": self.seed,
            "count": None if self.subset is None else len(self.subset),
            "generator": self.generator,
            "labels": self.perception or "exact",
            **({} if self.device == "cpu" else {"device": self.device}),
        }

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Learn; the model itself is the result.

        A model that lies there already was left by a run that ended before it could say what code
        had made it.
        """
        shutil.rmtree(self._home(folder), ignore_errors=True)
        self.learned(folder)
        return {}

    def recorded(self) -> Demonstrations:
        """The whole prior set with its exact outcomes."""
        return prior_set(make_task(self.task), self.demonstrations)

    def learned(self, folder: Path) -> LearnedGenerator:
        """What was learned: from the folder's models, or now, and put there."""
        home = self._home(folder)
        if not home.is_dir():
            prior = self._prior(folder)
            # Two minutes of a GPU are begun anew; hours of a core go on where they were.
            states = folder / "training" if self.device == "cpu" else None
            generator = make_generator(self.generator, device=self.device, states=states)
            generator.fit(prior, seed=self.seed)
            with in_place(home) as unfinished:
                unfinished.mkdir()
                generator.save(unfinished / "generator")
                prior.save(unfinished / "demonstrations.npz")
        generator = load_generator(home / "generator", device=self.device)
        return LearnedGenerator(generator, Demonstrations.load(home / "demonstrations.npz"))

    def _home(self, folder: Path) -> Path:
        return folder / "models" / digest_of(self)

    def _prior(self, folder: Path) -> Demonstrations:
        """The demonstrations that are learned from."""
        demonstrations = self.recorded()
        if self.perceived is not None:
            kept = result_of(folder, self.perceived)
            seen: dict[str, Any] = {name: np.array(kept[name]) for name in _SEEN}
            demonstrations = replace(demonstrations, **seen)
        return demonstrations if self.subset is None else demonstrations.only(self.subset)


@dataclass(frozen=True)
class OfTraining(Unit):
    """What is done with one learned generator."""

    training: Training
    """What was learned."""
    what: ClassVar[str]
    """What is done, for a progress line."""

    def __str__(self) -> str:
        return f"{self.what} of {str(self.training).removeprefix('learn ')}"

    @property
    def columns(self) -> dict[str, Any]:
        """What all its rows say: tried where it was learned."""
        return {**self.training.columns, "task": self.training.task}


@dataclass(frozen=True)
class Trials(OfTraining):
    """Try goals with one learned generator and one adapter."""

    task: str
    """Where it is tried; another hardware variant than the training's, perhaps."""
    adapter: str
    """Adapter, by its choice."""
    perception: str
    """Perception, by its choice."""
    goals: int
    """Number of goals."""
    unseen: bool = False
    """Goals far from the demonstrations, as the paper places them by hand; else uniform."""
    rounds: int = 10
    """Trials a goal at most."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint to ask where `perception` is vlm."""

    def __str__(self) -> str:
        return (
            f"{self.task}: {self.training.generator} + {self.adapter}, {self.perception}, "
            f"set {self.training.demonstrations}, {self.training.seed}"
        )

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Run the protocol, and keep plain numbers, a row a goal."""
        results = self.trials(folder)
        return {
            "goals": [result.goal.tolist() for result in results],
            "solved_at": [result.solved_at or 0 for result in results],
            "first_error": [float(np.linalg.norm(result.errors[0])) for result in results],
            "lost": [sum(not rollout.valid for rollout in result.rollouts) for result in results],
            "failed_readings": [result.failed_readings for result in results],
            "p_hit": [[trial.expected.p_hit for trial in result.trials] for result in results],
        }

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal; results of before P(hit) was kept leave its cell empty."""
        goals = result["goals"]
        said = result.get("p_hit", [[None]] * len(goals))
        tried = ("task", "adapter", "perception", "unseen", "rounds")
        return rows_of(
            {**self.columns, **{name: getattr(self, name) for name in tried}},
            goal=range(len(goals)),
            place=map(as_text, goals),
            solved_at=result["solved_at"],
            first_error=[round(error, 5) for error in result["first_error"]],
            lost=result["lost"],
            failed_readings=result["failed_readings"],
            p_hit=[None if of[0] is None else as_text(of, 3) for of in said],
        )

    def learned(self, folder: Path) -> LearnedGenerator:
        """What is tried: from the folder's models, or learned now."""
        return self.training.learned(folder)

    def seen(self, goals: Points) -> Points | None:
        """Where goals are perceived; None: exactly where they are."""
        return None

    def drawn(self, task: Task) -> Points:
        """Goals, the same for every method."""
        rng = np.random.default_rng(GOAL_SEED)
        if not self.unseen:
            return task.sample_goals(self.goals, rng)
        # Far from where demonstrations truly went, so that goals are the same for every perception.
        return unseen_goals(task, self.training.recorded(), self.goals, rng)

    def trials(self, folder: Path) -> list[GoalTrials]:
        """Run the protocol."""
        task, learned = make_task(self.task), self.learned(folder)
        goals = self.drawn(task)
        seed = GOAL_SEED + self.training.seed
        with make_perception(
            self.perception, scene=task.scene, config=self.model, seed=seed
        ) as perception:
            return run_goals(
                task,
                learned.generator,
                lambda: make_adapter(self.adapter),
                perception,
                learned.prior,
                goals,
                rounds=self.rounds,
                seed=seed,
                goals_seen=self.seen(goals),
            )


def displaced(
    task: Task, generator: Generator, conditions: Float[np.ndarray, "*n k"]
) -> tuple[Float[np.ndarray, "*n k"], int]:
    """How far from its condition each undisturbed throw comes down, [m], and how many are lost."""
    plans = generator.generate(conditions.reshape(-1, conditions.shape[-1]))
    rollouts = task.rollout(plans, None)
    landed = np.array([rollout.outcome for rollout in rollouts]).reshape(conditions.shape)
    return landed - conditions, sum(not rollout.valid for rollout in rollouts)


@dataclass(frozen=True)
class ZeroShot(OfTraining):
    """Generate for a dense grid of goals and for the demonstrations' own outcomes; throw once."""

    spacing: float = 0.02
    """Spacing of the grid inside the outcomes' hull, in [m]."""
    what = "zero shot"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Throw, with execution's disturbances switched off: the generator's error alone."""
        task = make_task(self.training.task)
        learned = self.training.learned(folder)
        generator, prior = learned.generator, learned.prior
        own = generator.generate(prior.outcomes_seen)
        if is_aligned(self.training.generator):
            prior = align(prior).demonstrations
        own_rms = np.sqrt(np.mean((own - prior.plans) ** 2, axis=(1, 2)))
        shown, landed = (
            np.array([rollout.outcome for rollout in task.rollout(plans, None)])
            for plans in (prior.plans, own)
        )
        misses, lost = displaced(task, generator, _within(prior.outcomes_seen, self.spacing))
        errors = np.linalg.norm(misses, axis=1)
        reached = [in_tolerances(miss, task.tolerance) <= 1.0 for miss in misses]
        return {
            "own_rms_rad": own_rms.tolist(),
            "own_landing_from_demonstrated_m": np.linalg.norm(landed - shown, axis=1).tolist(),
            "grid_points": len(misses),
            "grid_median_m": float(np.median(errors)),
            "grid_p90_m": float(np.percentile(errors, 90)),
            "grid_within_tolerance": float(np.mean(reached)),
            "grid_lost": lost / len(misses),
        }

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a quantity, of a demonstration or of the grid."""
        return [
            {**self.columns, "quantity": name, "demonstration": i, "value": value}
            for name, values in result.items()
            for i, value in enumerate(values if isinstance(values, list) else [values])
        ]


def is_aligned(choice: str) -> bool:
    """Whether a choice of a generator is fitted to aligned demonstrations."""
    return parse_choice(choice)[1].get("timing") == "align"


def _within(outcomes: Points, spacing: float) -> Float[np.ndarray, "m k"]:
    """Points of a square grid inside the outcomes' hull."""
    from scipy.spatial import Delaunay

    ends = zip(outcomes.min(axis=0), outcomes.max(axis=0), strict=True)
    axes = [np.arange(low, high + spacing, spacing) for low, high in ends]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    return points[Delaunay(outcomes).find_simplex(points) >= 0]
