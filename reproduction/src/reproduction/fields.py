"""Displacement fields of a generator, measured once in physics: thousands of trials in seconds.

    r = c + d(c) + noise

The plan that a fitted generator makes for a condition c comes down at c + d(c). Where d has been
measured on a grid, execution without noise, and splined, adapters can be tried on as many goals as
a comparison needs. Execution noise is normal, as wide as repeated executions in physics are.

Ours, because adapters differ by a tenth of a trial: that asks for more goals than physics allows.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points, as_plans
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError
from prior_reinforce.files import in_place
from prior_reinforce.generators import Generator, make_generator
from prior_reinforce.generators.base import OnProgress
from prior_reinforce.perception import make_perception
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.protocol import perceive_demonstrations
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import GOAL_SEED, displaced
from reproduction.units import Unit, digest_of

SPACING = 0.04
"""Spacing of the grid, in [m] (ours): a spline through it is off by 0.2 cm between its points, half
of the execution noise."""
_MARGIN = 0.05
"""How far beyond the region of goals is measured, in [m] (ours); beyond that, d is what it is at
the edge."""
_REPEATED = (4, 5)
"""Conditions whose plans are executed again, and how often, for the noise: right to 15 %."""
_DRAWS = 50
"""Draws of demonstrations, at most, until no two of them look the same."""


@dataclass(frozen=True, eq=False)
class Field:
    """d, and what an adapter is started with."""

    name: str
    """For tables."""
    low: Float[np.ndarray, "2"]
    """Corner of the grid, in [m]."""
    spacing: Float[np.ndarray, "2"]
    """Between its points, in [m]."""
    displacement: Float[np.ndarray, "nx ny 2"]
    """d at its points, in [m]."""
    noise_sd: Float[np.ndarray, "2"]
    """Standard deviation of execution, in [m]."""
    region: Float[np.ndarray, "2 2"]
    """Region of goals, in [m]; see `Task.region`."""
    tolerance: float
    """epsilon of the task, in [m]."""
    outcomes_seen: Points
    """Outcomes of the demonstrations as they were seen, in [m]."""
    outcome_noise: Points
    """How uncertain they are, in [m]."""
    outcome_correction: Points
    """What they are expected to be, minus those seen, in [m]."""

    @property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations; the plan for a condition is that condition, for two frames."""
        return Demonstrations(
            np.repeat(self.outcomes_seen[:, None], 2, axis=1),
            self.outcomes_seen,
            _FORMAT,
            outcome_noise=self.outcome_noise,
            outcome_correction=self.outcome_correction,
        )

    @cached_property
    def _splines(self) -> list[RectBivariateSpline]:
        """Bicubic, one a component."""
        places = zip(self.low, self.spacing, self.displacement.shape, strict=False)
        x, y = (a + s * np.arange(n) for a, s, n in places)
        return [RectBivariateSpline(x, y, self.displacement[..., j]) for j in range(2)]

    def at(self, conditions: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Return d, in [m], by a bicubic spline; beyond the grid that of its edge."""
        high = self.low + self.spacing * (np.array(self.displacement.shape[:2]) - 1)
        x, y = np.clip(conditions, self.low, high).T
        return np.stack([spline.ev(x, y) for spline in self._splines], axis=-1)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an .npz, under that very name."""
        with open(path, "wb") as file:
            np.savez(file, **asdict(self))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote.

        Raises:
            FileFormatError: An earlier version wrote it, which kept less of the labels.
        """
        with np.load(path) as data:
            arrays = dict(data)
        if "outcome_correction" not in arrays:
            raise FileFormatError(
                f"{path} is of an earlier version, which did not keep how far outcomes are off; "
                "delete it, or choose a fresh --out"
            )
        return cls(
            **{**arrays, "name": str(arrays["name"]), "tolerance": float(arrays["tolerance"])}
        )


def measure(
    task: Task, generator: Generator, demonstrations: Demonstrations, name: str, *, seed: int
) -> Field:
    """Measure what a generator's plans do on a task with two components in [m].

    Raises:
        ConfigurationError: A plan was lost: such a field has holes.
    """
    assert isinstance(task.tolerance, float), "both components are lengths"
    low, high = task.region[0] - _MARGIN, task.region[1] + _MARGIN
    counts = np.ceil((high - low) / SPACING).astype(int) + 1
    axes = [np.linspace(*ends) for ends in zip(low, high, counts, strict=True)]
    conditions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    displacement, lost = displaced(task, generator, conditions)
    if lost:
        raise ConfigurationError(
            f"{lost} of {counts.prod()} plans for {name} were lost; measure a smaller region"
        )
    rng = np.random.default_rng([seed, 6])
    n, times = _REPEATED
    again = np.repeat(generator.generate(task.sample_goals(n, rng)), times, axis=0)
    repeated = np.array([rollout.outcome for rollout in task.rollout(again, rng)])
    apart = repeated.reshape(n, times, 2).var(axis=1, ddof=1).mean(axis=0)
    return Field(
        name, low, (high - low) / (counts - 1), displacement, np.sqrt(apart), task.region,
        task.tolerance, demonstrations.outcomes_seen, demonstrations.outcome_noise,
        demonstrations.outcome_correction,
    )  # fmt: skip


@dataclass(frozen=True)
class MeasuredField(Unit):
    """Learn from a task's demonstrations, and measure where plans for a grid come down."""

    task: str
    """Where plans are executed."""
    learned_on: str
    """The task that was demonstrated."""
    demonstrations: str
    """Prior set, A or B; another letter: a draw from both."""
    labels: int
    """Seed of how their outcomes are seen."""
    count: int = 0
    """How many of a draw; 0 for as many as A has."""
    perception: str = "eye"
    """Through which they are seen."""
    generator: str = "interpolation,timing=align"
    """What is learned."""
    seed: int = GOAL_SEED
    """Seed of the draws; decisions are made on other seeds than the reported one."""

    def __str__(self) -> str:
        return f"measure {self.task} {self.demonstrations}{self.count or ''} by {self.perception}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Measure, and keep the field in the folder's `fields`."""
        prior = self._seen(make_task(self.learned_on))
        generator = make_generator(self.generator).fit(prior, seed=self.labels)
        seed = GOAL_SEED + self.labels
        measured = measure(make_task(self.task), generator, prior, str(self), seed=seed)
        with in_place(self._path(folder)) as unfinished:
            measured.save(unfinished)
        return {"noise_sd": measured.noise_sd.tolist()}

    def field(self, folder: Path) -> Field:
        """What was measured: from the folder, or now, and put there."""
        if not self._path(folder).is_file():
            self.run(folder)
        return Field.load(self._path(folder))

    def _path(self, folder: Path) -> Path:
        return folder / "fields" / f"{digest_of(self)}.npz"

    def _seen(self, task: Task) -> Demonstrations:
        """The demonstrations with their outcomes as they were seen.

        In a draw of which two look the same, another is taken, and the eye's words begin elsewhere.

        Raises:
            InvalidDemonstrationsError: Every draw has outcomes that cannot be learned from.
        """
        problem = "every draw has two demonstrations that look the same"
        for attempt in range(_DRAWS):
            seed = GOAL_SEED + self.labels + 1000 * attempt
            prior = self._recorded(task, attempt)
            try:
                with make_perception(self.perception, seed=seed) as perception:
                    seen = perceive_demonstrations(task, prior, perception, seed=seed)
            except InvalidDemonstrationsError as error:
                if self.demonstrations in task.demonstration_sets:
                    raise
                problem = str(error)
            else:
                if len(np.unique(seen.outcomes_seen, axis=0)) == seen.n:
                    return seen
        raise InvalidDemonstrationsError(problem)

    def _recorded(self, task: Task, attempt: int) -> Demonstrations:
        """The demonstrations as they were recorded."""
        if self.demonstrations in task.demonstration_sets:
            return task.demonstrations(self.demonstrations).without_symmetry()
        both = [task.demonstrations(name).without_symmetry() for name in task.demonstration_sets]
        of_all = ("plans", "outcomes_seen", "outcome_noise", "outcome_correction")
        arrays: Any = {name: np.concatenate([getattr(d, name) for d in both]) for name in of_all}
        pool = replace(both[0], **arrays)
        drawn = [self.seed, ord(self.demonstrations), *[attempt] * (attempt > 0)]
        order = np.random.default_rng(drawn).permutation(pool.n)
        return pool.only(tuple(sorted(order[: self.count or both[0].n])))


@dataclass(frozen=True)
class Change:
    """What is different from the field as it was measured."""

    shift: tuple[float, float] = (0.0, 0.0)
    """Shift of all outcomes, in [m]."""
    stretch: float = 1.0
    """Factor on outcomes, from the middle of the region."""
    noise: float = 1.0
    """Factor on the noise of execution."""
    lost: float = 0.0
    """Share of trials whose object never comes down where outcomes are."""


class FieldTask(Task):
    """Env without physics: a plan is a condition, and comes down at c + d(c) + noise."""

    def __init__(self, field: Field, change: Change | None = None) -> None:
        """Take a field, and what has changed since it was measured."""
        self.name, self.format = field.name, _FORMAT
        self.region, self.tolerance = field.region, field.tolerance
        self.field, self.change = field, change or Change()

    def rollout(self, plans: ArrayLike, rng: np.random.Generator | None) -> list[Rollout]:
        """Look up where they come down; see `Task.rollout`."""
        conditions = as_plans(plans, 2)[:, 0]
        change, middle = self.change, self.region.mean(axis=0)
        outcomes = conditions + self.field.at(conditions)
        outcomes = middle + change.stretch * (outcomes - middle) + np.array(change.shift)
        lost = np.zeros(len(outcomes), dtype=bool)
        if rng is not None:
            sd = change.noise * self.field.noise_sd
            outcomes = outcomes + sd * rng.normal(size=outcomes.shape)
            lost = rng.uniform(size=len(outcomes)) < change.lost
        nowhere = np.zeros(2)  # as for the tasks of physics
        return [
            Rollout(nowhere if gone else place, not gone)
            for place, gone in zip(outcomes, lost, strict=True)
        ]

    def demonstrations(self, name: str) -> Demonstrations:
        """What the field was learned from; it has one set."""
        return self.field.demonstrations


class Conditions(Generator):
    """pi of a field: the plan for a condition is that condition."""

    name = "conditions"

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        """There is nothing to learn."""

    def _generate(self, conditions: Points) -> Plans:
        return np.repeat(conditions[:, None], 2, axis=1)


_FORMAT = PlanFormat(("condition x", "condition y"), ("m", "m"), 1.0)
