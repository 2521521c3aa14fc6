"""Motions: action plans, and the demonstrations that are learned from.

Shapes, units and values are checked once, here; the rest of the package relies on it.

Notation (docs/notation.md):
    A        `plan`            unit of its `PlanFormat`, mostly [rad]
    H        `horizon`         frames
    D        `action_dim`      numbers a frame
    r tilde  `outcomes_seen`   mostly [m], table frame
    D_prior  `Demonstrations`  N plans with the N outcomes that were perceived
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.arrays import (
    SAME_OUTCOME,
    Frames,
    Plans,
    Point,
    Points,
    as_goal,
    as_outcomes,
    as_plans,
    check_spread,
)
from prior_reinforce.errors import (
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidPlanError,
    warn_caller,
)
from prior_reinforce.files import open_npz
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.signals import Signals, analyse
from prior_reinforce.plans.symmetry import EXTRAPOLATED, Symmetry
from prior_reinforce.units import UNITS, looks_like
from prior_reinforce.wording import say_beyond, say_place

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FILE_FORMAT = "prior-reinforce demonstrations"
_FILE_VERSION = 1
_WARNED: ContextVar[bool] = ContextVar("_WARNED", default=False)
"""Whether demonstrations are derived from others, which were warned of; of this thread alone."""
_ARRAYS = ("plans", "outcomes_seen", "outcome_noise", "outcome_correction")
"""Fields that are arrays of N rows."""
_TYPICAL_SPREAD = 0.15
"""Standard deviation of goals about a single demonstration, in units of its chart (ours): 15 % of a
distance, 9 degrees, 15 cm; six demonstrations of our tasks spread as much."""
_UNSTATED = OutcomeFormat()


def _say_size(shape: tuple[int, ...], form: PlanFormat) -> str:
    names = ", ".join(form.names if len(form.names) <= 8 else (*form.names[:7], "..."))
    frames, columns = shape
    return f"{frames} frames x {columns}, {(frames - 1) * form.dt:.3g} s: {names}"


@dataclass(frozen=True, eq=False)
class Plan:
    """One open-loop action plan A with its format."""

    actions: Frames
    """float64, read-only."""
    format: PlanFormat

    def __post_init__(self) -> None:
        """Copy and check the frames.

        InvalidPlanError for a wrong shape, or values that are not finite.
        """
        actions = as_plans(self.actions, self.format.action_dim, name="plan", single=True)
        object.__setattr__(self, "actions", actions)

    @property
    def horizon(self) -> int:
        """H, the number of frames."""
        return self.actions.shape[0]

    @property
    def times(self) -> Float[np.ndarray, " H"]:
        """Time of each frame from the first, in [s]."""
        return np.arange(self.horizon) * self.format.dt

    def plot(self) -> Figure:
        """Draw every action dimension over time, one axes a unit.

        Returns:
            A matplotlib figure, which a notebook shows; `figure.savefig(path)` writes it.
        """
        from matplotlib.figure import Figure

        units = dict.fromkeys(self.format.units)
        figure = Figure(figsize=(7, 2.2 * len(units) + 0.6), layout="constrained")
        for axes, unit in zip(figure.subplots(len(units), squeeze=False)[:, 0], units, strict=True):
            for name, own_unit, column in zip(
                self.format.names, self.format.units, self.actions.T, strict=True
            ):
                if own_unit == unit:
                    axes.plot(self.times, column, label=name.replace("$", r"\$"))
            axes.set_ylabel(f"[{unit}]")
            axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
        axes.set_xlabel("time [s]")
        return figure

    def __repr__(self) -> str:
        """Size, length in time, and names."""
        return f"Plan({_say_size(self.actions.shape, self.format)})"


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """D_prior with its perceived outcomes: N plans of one horizon, N outcomes (paper, Stage 1)."""

    plans: Plans
    """A_i, N of them, float64, read-only."""
    outcomes_seen: Points
    """r tilde_i, mostly [m] in the table frame, float64, read-only."""
    format: PlanFormat
    outcome_format: OutcomeFormat = _UNSTATED
    """Names and units of the k numbers of an outcome; x, y and z in metres by default."""
    outcome_noise: Points = field(default_factory=lambda: np.empty((0, 0)))
    """Standard deviation of each outcome, shape (N, k); zero by default: measured. Learned plans
    are exact only at demonstrations with measured outcomes."""
    outcome_correction: Points = field(default_factory=lambda: np.empty((0, 0)))
    """Expected outcome minus the one seen, shape (N, k), in the outcomes' units; zero by default.
    "10 cm" by eye is anything from 7.5 to 15, 11.25 on average. Generators learn what was seen, as
    in the paper; `BayesianAdapter` corrects it."""
    symmetry: Symmetry | None = None
    """How a demonstrated motion may be moved, if at all; one demonstration is then enough."""

    def __repr__(self) -> str:
        """Number, size, and outcome format."""
        size = _say_size(self.plans.shape[1:], self.format)
        return f"Demonstrations({self.n} plans, {size}; outcomes {self.outcome_format})"

    def __post_init__(self) -> None:
        """Copy and check everything; warn of units that look wrong, and of repeated outcomes.

        Raises:
            InvalidDemonstrationsError: No plan, outcomes in a subspace (on one line when k = 2)
                without a symmetry, wrong shapes, or values that are not finite.
            ConfigurationError: What the symmetry turns or shifts is not in m and rad.
        """
        if isinstance(self.plans, (list, tuple)):
            horizons = sorted({np.asarray(plan).shape[0] for plan in self.plans if np.ndim(plan)})
            if len(horizons) > 1:
                raise InvalidDemonstrationsError(
                    f"demonstrations have mixed horizons {horizons}; resample or pad them to one "
                    "number of frames first"
                )
        try:
            plans = as_plans(self.plans, self.format.action_dim, name="plans")
        except InvalidPlanError as error:
            raise InvalidDemonstrationsError(str(error)) from error
        for name in self.format.per_plan:
            if np.any(np.ptp(plans[:, :, self.format.names.index(name)], axis=1)):
                raise InvalidDemonstrationsError(
                    f"{name} is one number a plan, but changes within a demonstration"
                )
        outcomes = as_outcomes(self.outcomes_seen, plans.shape[0])
        k = outcomes.shape[1]
        stated = self.outcome_format.outcome_dim > 0
        form = self.outcome_format if stated else OutcomeFormat.metres(k)
        if form.outcome_dim != k:
            raise InvalidDemonstrationsError(
                f"outcomes have {k} components, but their format names {form}"
            )
        for name, signed in (("outcome_noise", False), ("outcome_correction", True)):
            values = np.array(getattr(self, name), dtype=np.float64)
            values = values if values.any() else np.zeros_like(outcomes)
            far = np.argwhere(np.isposinf(values))
            if far.size and not signed:
                raise InvalidDemonstrationsError(
                    f"demonstration {far[0, 0]} has a direction but no distance, and a "
                    "demonstration needs a place: measure or estimate it, or leave it out"
                )
            possible = np.isfinite(values) & (signed | (values >= 0))
            if values.shape != outcomes.shape or not np.all(possible):
                raise InvalidDemonstrationsError(
                    f"{name} must be one finite number{'' if signed else ' of at least 0'} for "
                    f"each of the outcomes {outcomes.shape}, got shape {values.shape}"
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        object.__setattr__(self, "plans", plans)
        object.__setattr__(self, "outcomes_seen", outcomes)
        object.__setattr__(self, "outcome_format", form)
        if self.symmetry is not None:
            object.__setattr__(self, "symmetry", self._checked(self.symmetry))
        elif len(outcomes) > 1:
            check_spread(outcomes)
        for warning in () if _WARNED.get() else self._warnings(unit_stated=stated):
            warn_caller(warning)

    @property
    def n(self) -> int:
        """N, the number of demonstrations."""
        return self.plans.shape[0]

    @property
    def horizon(self) -> int:
        """H, the number of frames of every plan."""
        return self.plans.shape[1]

    @property
    def action_dim(self) -> int:
        """D, the number of action dimensions."""
        return self.plans.shape[2]

    @property
    def outcome_dim(self) -> int:
        """k, the number of components of an outcome."""
        return self.outcomes_seen.shape[1]

    @cached_property
    def signals(self) -> Signals:
        """Noise, kind and rest of each dimension, analysed once."""
        form = self.format
        return analyse(self.plans, form.units, form.dt, form.increments)

    @cached_property
    def spread(self) -> Point:
        """Standard deviation of each component of the outcomes, in its unit; never zero.

        If all outcomes agree in a component, or there is only one, it is the typical spread of
        goals about them (`_TYPICAL_SPREAD`).

        Raises:
            InvalidDemonstrationsError: They agree, and without a symmetry no spread is known.
        """
        deviation = self.outcomes_seen.std(axis=0)
        alike = deviation <= SAME_OUTCOME * np.maximum(np.abs(self.outcomes_seen).max(axis=0), 1.0)
        if not alike.any():
            return np.asarray(deviation)
        if self.symmetry is None:
            raise InvalidDemonstrationsError(
                "one demonstration without a symmetry says nothing of other goals; state the "
                "symmetry, or demonstrate more"
            )
        chart = self.symmetry.chart
        jacobian = chart.jacobian(chart.to(self.outcomes_seen)).mean(axis=0)
        return np.where(alike, _TYPICAL_SPREAD * np.linalg.norm(jacobian, axis=1), deviation)

    def without_symmetry(self) -> Self:
        """Return the same demonstrations without a symmetry, as in the paper.

        Raises:
            InvalidDemonstrationsError: There are several, and their outcomes lie in a subspace.
        """
        return self._derived(symmetry=None)

    def with_symmetry(self, symmetry: Symmetry) -> Self:
        """Return the same demonstrations with this symmetry."""
        return self._derived(symmetry=symmetry)

    @property
    def sha256(self) -> str:
        """Fingerprint of plans, outcomes, their noise and correction, and formats."""
        form, own = self.outcome_format, asdict(self.format)
        plan = {key: value for key, value in own.items() if value or key == "per_plan"}
        about: list[Any] = [plan, form.names, form.units]
        if self.symmetry is not None:
            about.append(self.symmetry.data())
        digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
        noise = (self.outcome_noise,) if np.any(self.outcome_noise) else ()
        for array in (self.plans, self.outcomes_seen, *noise):
            digest.update(str(array.shape).encode())
            digest.update(array.tobytes())
        if np.any(self.outcome_correction):
            digest.update(b"outcome_correction" + self.outcome_correction.tobytes())
        return digest.hexdigest()

    def with_plans(self, plans: Plans, format: PlanFormat | None = None) -> Self:
        """Return the same outcomes with other plans; unusual units were warned about already."""
        return self._derived(plans=plans, format=format or self.format)

    def only(self, chosen: Sequence[int]) -> Self:
        """Return some of the demonstrations, by their numbers from 0."""
        return self._derived(**{name: getattr(self, name)[list(chosen)] for name in _ARRAYS})

    def repeated_outcomes(self) -> list[tuple[int, int]]:
        """Return pairs whose measured outcomes agree; outcomes read by eye often agree."""
        measured = np.all(self.outcome_noise == 0.0, axis=1)
        scaled = self.outcomes_seen / np.maximum(np.ptp(self.outcomes_seen, axis=0), 1e-12)
        same = np.all(np.abs(scaled[:, None] - scaled[None]) <= SAME_OUTCOME, axis=2)
        pairs = np.argwhere(np.triu(same & measured & measured[:, None], k=1))
        return [(int(i), int(j)) for i, j in pairs]

    def check_goal(self, goal: ArrayLike) -> Point:
        """Return the goal as a fresh float array, warning when it lies far outside the outcomes.

        Args:
            goal: g tilde, in the outcomes' units.

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
        """
        place = as_goal(goal, self.outcome_format.names)
        if far := self.say_far_outside(place):
            warn_caller(far)
        return place

    def say_far_outside(self, goal: Point) -> str:
        """Say how far a goal lies outside the outcomes; empty where it is near enough."""
        form, beyond = self.outcome_format, self.far_outside(goal)
        if not np.any(beyond):
            return ""
        near = say_place(self.nearest_inside(goal), form)
        where = f"outside what was demonstrated; the nearest inside is {near}"
        if self.symmetry is not None:
            where = f"from where motions can be moved ({self.symmetry.name})"
        far = f"goal {say_place(goal, form)} lies {say_beyond(beyond, form)} {where}"
        return f"{far}; check its unit, or demonstrate nearer to it"

    def nearest_inside(self, goal: Point) -> Point:
        """Return the nearest place to a goal within the demonstrated range of each component."""
        return np.clip(goal, self.outcomes_seen.min(axis=0), self.outcomes_seen.max(axis=0))

    def far_outside(self, goal: Point) -> Point:
        """Return how far a goal lies outside the outcomes, in their units; zeros if near enough.

        With a symmetry, near enough is within `Symmetry.farthest_from`.

        Ours: beyond half the demonstrated range, no figure of the paper supports extrapolation (its
        displacement field degrades towards the boundary already).
        """
        if self.symmetry is not None:
            chart = self.symmetry.chart
            z, aim = chart.to(self.outcomes_seen), chart.to(goal)
            farthest = self.symmetry.farthest_from(z)
            beyond = aim - np.clip(aim, z.min(axis=0), z.max(axis=0))
            too_far = beyond - np.clip(beyond, -farthest, farthest)
            return np.asarray(np.abs(goal - chart.back(aim - too_far))) * np.any(too_far)
        extent = np.maximum(np.ptp(self.outcomes_seen, axis=0), 1e-12)
        beyond = np.abs(goal - self.nearest_inside(goal))
        return beyond if np.any(beyond > EXTRAPOLATED * extent) else np.zeros_like(beyond)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an `.npz`: arrays and a JSON text; nothing in it can run code."""
        metadata: dict[str, Any] = {
            "file_format": _FILE_FORMAT,
            "version": _FILE_VERSION,
            "format": asdict(self.format),
            "outcome_names": self.outcome_format.names,
            "outcome_units": self.outcome_format.units,
        }
        if self.symmetry is not None:
            metadata["symmetry"] = self.symmetry.data()
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        with open(path, "wb") as file:
            np.savez_compressed(file, **arrays, metadata=np.array(json.dumps(metadata)))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; unusual units were warned about then.

        Raises:
            FileFormatError: The file is missing, truncated, or not such an `.npz`.
            InvalidDemonstrationsError: It holds demonstrations that cannot be learned from.
        """
        path = Path(path)
        if not path.is_file():
            raise FileFormatError(f"no demonstrations at {path}; give the path of an .npz file")
        remedy = "it must be a demonstrations file; write one with Demonstrations.save"
        with open_npz(path, remedy) as archive, _warned_before():
            metadata = json.loads(str(archive["metadata"]))
            if metadata["file_format"] != _FILE_FORMAT or metadata["version"] != _FILE_VERSION:
                raise ValueError(f"written as {metadata['file_format']} {metadata['version']}")
            return cls(
                **{name: archive[name] for name in _ARRAYS if name in archive},
                format=PlanFormat(**metadata["format"]),
                outcome_format=OutcomeFormat(
                    tuple(metadata["outcome_names"]), tuple(metadata["outcome_units"])
                ),
                symmetry=(data := metadata.get("symmetry")) and Symmetry.from_data(data),
            )

    def _derived(self, **changes: Any) -> Self:
        """Replace some fields, without repeating the warnings."""
        with _warned_before():
            return replace(self, **changes)

    def _checked(self, symmetry: Symmetry) -> Symmetry:
        """Check a symmetry against these demonstrations, and centre its chart on their outcomes."""
        if symmetry.k != self.outcome_dim:
            raise InvalidDemonstrationsError(
                f"the symmetry {symmetry.name!r} moves {symmetry.k} components, but outcomes have "
                f"{self.outcome_dim}: {self.outcome_format}"
            )
        if any(
            column >= self.action_dim for move in symmetry.moves for column in move.columns_of()
        ):
            raise InvalidDemonstrationsError(
                f"the symmetry {symmetry.name!r} moves columns that plans do not have; they have "
                f"{self.action_dim}: {', '.join(self.format.names)}"
            )
        symmetry.check_units(self.outcome_format.units, self.format.units)
        return symmetry.around(self.outcomes_seen)

    def _warnings(self, *, unit_stated: bool) -> Iterator[str]:
        """Yield probable mistakes: other units, and a repeated outcome."""
        metres = np.array([unit == "m" for unit in self.outcome_format.units])
        farthest = np.abs(self.outcomes_seen[:, metres]).max(initial=0.0)
        if looks := looks_like("m", farthest, stated=unit_stated):
            yield (
                f"an outcome of {farthest:g} m looks like {UNITS[looks].plural}; outcomes are in "
                f"metres: divide by {1 / UNITS[looks].factor:g}"
            )
        radians = np.array([unit == "rad" for unit in self.format.units])
        largest = np.abs(self.plans[:, :, radians]).max(initial=0.0)
        if looks_like("rad", largest):
            yield (
                f"an angle of {largest:g} rad looks like degrees; plans are in radians: convert "
                "with numpy.deg2rad"
            )
        for i, j in self.repeated_outcomes()[:1]:
            yield (
                f"demonstrations {i} and {j} have the same outcome "
                f"{self.outcomes_seen[i].tolist()}: the mean of both motions is learned; if that "
                "is a mistake, correct it, or drop one"
            )


@contextmanager
def _warned_before() -> Iterator[None]:
    """Make demonstrations from others without repeating their warnings."""
    token = _WARNED.set(True)
    try:
        yield
    finally:
        _WARNED.reset(token)
