"""Motions: what a plan is, and the demonstrations that are learned from.

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
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.arrays import (
    BEYOND_DOUBT,
    FARTHEST,
    LARGEST_TURN,
    SAME_OUTCOME,
    Frames,
    Plans,
    Point,
    Points,
    as_goal,
    as_outcomes,
    as_plans,
    is_positive,
)
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError, InvalidPlanError
from prior_reinforce.files import open_npz
from prior_reinforce.plans.signals import Signals, analyse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FILE_FORMAT = "prior-reinforce demonstrations"
_FILE_VERSION = 1
_ARRAYS = ("plans", "outcomes_seen", "outcome_noise", "outcome_correction")
"""Of demonstrations, N rows each."""


@dataclass(frozen=True)
class PlanFormat:
    """What the numbers of a frame mean (paper, Table I: "Frame Action Format")."""

    names: tuple[str, ...]
    """Name of each of the D action dimensions, for instance `joint1`."""
    units: tuple[str, ...]
    """Unit of each dimension: `rad`, `m`, `1` for pure numbers, or any other word."""
    dt: float
    """Time between two frames, in [s]."""
    per_plan: tuple[str, ...] = ()
    """Names of the dimensions that are one number a plan, the same at every frame: when a motion
    starts, for instance."""

    def __post_init__(self) -> None:
        """Check the format.

        Raises:
            InvalidPlanError: No names, repeated names, or another number of units than of names.
        """
        for name in ("names", "units", "per_plan"):
            if isinstance(given := getattr(self, name), str):
                raise InvalidPlanError(f"{name} must be a list such as [{given!r}], got a text")
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.names:
            raise InvalidPlanError("a plan format needs at least one action name, got none")
        if len(set(self.names)) != len(self.names):
            raise InvalidPlanError(f"action names must differ from each other, got {self.names}")
        if len(self.units) != len(self.names):
            raise InvalidPlanError(
                f"{len(self.names)} action names need as many units, got {len(self.units)}: "
                f"{self.units}"
            )
        if not is_positive(self.dt):
            raise InvalidPlanError(f"dt must be a positive number of seconds, got {self.dt!r}")
        if unknown := set(self.per_plan) - set(self.names):
            raise InvalidPlanError(f"per_plan names {sorted(unknown)}, but actions {self.names}")

    @property
    def action_dim(self) -> int:
        """D, the number of action dimensions."""
        return len(self.names)


def _say_size(shape: tuple[int, ...], form: PlanFormat) -> str:
    names = ", ".join(form.names if len(form.names) <= 8 else (*form.names[:7], "..."))
    frames, columns = shape
    return f"{frames} frames x {columns}, {(frames - 1) * form.dt:.3g} s: {names}"


@dataclass(frozen=True, eq=False)
class Plan:
    """One open-loop action plan A with its meaning."""

    actions: Frames
    """float64, read-only."""
    format: PlanFormat

    def __post_init__(self) -> None:
        """Copy and check the frames.

        Raises:
            InvalidPlanError: Wrong shape, or values that are not finite.
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
            for name, of, column in zip(
                self.format.names, self.format.units, self.actions.T, strict=True
            ):
                if of == unit:
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
    outcome_names: tuple[str, ...] = ()
    """Names of the k components; `x`, `y`, `z` where none are given."""
    outcome_units: tuple[str, ...] = ()
    """Unit of each component; metres where none are given."""
    outcome_noise: Points = field(default_factory=lambda: np.empty((0, 0)))
    """How uncertain each outcome is, as a standard deviation, shape (N, k); zero where none is
    given: measured. What is learned is exact at the demonstrations only where they are."""
    outcome_correction: Points = field(default_factory=lambda: np.empty((0, 0)))
    """What each outcome is expected to be, minus the one seen, shape (N, k), in the outcomes'
    units; zero where none is given. "10 cm" by eye is anything from 7.5 to 15, 11.25 on average.
    Generators learn what was seen, as in the paper; `BayesianAdapter` corrects it."""

    def __repr__(self) -> str:
        """Number, size, and what the outcomes are."""
        size = _say_size(self.plans.shape[1:], self.format)
        pairs = zip(self.outcome_names, self.outcome_units, strict=True)
        outcomes = ", ".join(f"{name} [{unit}]" for name, unit in pairs)
        return f"Demonstrations({self.n} plans, {size}; outcomes {outcomes})"

    def __post_init__(self) -> None:
        """Copy and check everything; warn of units that look wrong, and of repeated outcomes.

        Raises:
            InvalidDemonstrationsError: Fewer than two, outcomes in a subspace (on one line when
                k = 2), shapes that do not fit, values that are not finite.
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
        names = tuple(self.outcome_names) or tuple("xyz"[:k] if k <= 3 else map(str, range(k)))
        stated = bool(self.outcome_units)
        units = tuple(self.outcome_units) or ("m",) * k
        if len(names) != k or len(units) != k:
            raise InvalidDemonstrationsError(
                f"outcomes have {k} components; got names {names} and units {units}"
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
        object.__setattr__(self, "outcome_names", names)
        object.__setattr__(self, "outcome_units", units)
        for oddity in self._oddities(unit_stated=stated):
            warnings.warn(oddity, stacklevel=3)

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
        return analyse(self.plans, self.format.units, self.format.dt)

    @property
    def sha256(self) -> str:
        """Fingerprint of plans, outcomes, their noise and correction, and what they mean."""
        about = [asdict(self.format), self.outcome_names, self.outcome_units]
        digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
        noise = (self.outcome_noise,) if np.any(self.outcome_noise) else ()
        for array in (self.plans, self.outcomes_seen, *noise):
            digest.update(str(array.shape).encode())
            digest.update(array.tobytes())
        if np.any(self.outcome_correction):
            digest.update(b"outcome_correction" + self.outcome_correction.tobytes())
        return digest.hexdigest()

    def with_plans(self, plans: Plans, format: PlanFormat | None = None) -> Self:
        """Return the same outcomes with other plans; odd units were warned about already."""
        with _warned_before():
            return replace(self, plans=plans, format=format or self.format)

    def only(self, chosen: Sequence[int]) -> Self:
        """Return some of the demonstrations, by their numbers from 0."""
        arrays: dict[str, Any] = {name: getattr(self, name)[list(chosen)] for name in _ARRAYS}
        with _warned_before():
            return replace(self, **arrays)

    def repeated_outcomes(self) -> list[tuple[int, int]]:
        """Return pairs whose outcomes were measured and are the same; by eye they often look it."""
        measured = np.all(self.outcome_noise == 0.0, axis=1)
        scaled = self.outcomes_seen / np.ptp(self.outcomes_seen, axis=0)
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
        goal = as_goal(goal, self.outcome_names)
        beyond = self.far_outside(goal)
        if np.any(beyond):
            low, high = self.outcomes_seen.min(axis=0), self.outcomes_seen.max(axis=0)
            asked = ", ".join(f"{value:.4g}" for value in goal)
            where = ", ".join(
                f"{beyond[j]:.4g} {self.outcome_units[j]} outside the demonstrated {name} "
                f"({low[j]:.4g} to {high[j]:.4g})"
                for j, name in enumerate(self.outcome_names)
                if beyond[j] > 0
            )
            warnings.warn(
                f"goal [{asked}] lies {where}; check its unit, or demonstrate nearer to it",
                stacklevel=2,
            )
        return goal

    def far_outside(self, goal: Point) -> Point:
        """How far a goal lies outside the outcomes, in their units; zeros where it is near enough.

        Ours: half the demonstrated extent beyond it is extrapolation that no figure of the paper
        supports (its displacement field degrades towards the boundary already).
        """
        low, high = self.outcomes_seen.min(axis=0), self.outcomes_seen.max(axis=0)
        spread = np.maximum(high - low, 1e-12)
        beyond = np.maximum(np.maximum(low - goal, goal - high), 0.0)
        return beyond if np.any(beyond > 0.5 * spread) else np.zeros_like(beyond)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an `.npz`: two arrays and a JSON text; nothing in it can run code."""
        metadata = {
            "file_format": _FILE_FORMAT,
            "version": _FILE_VERSION,
            "format": asdict(self.format),
            "outcome_names": self.outcome_names,
            "outcome_units": self.outcome_units,
        }
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        with open(path, "wb") as file:
            np.savez_compressed(file, **arrays, metadata=np.array(json.dumps(metadata)))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; odd units were warned about then.

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
                outcome_names=tuple(metadata["outcome_names"]),
                outcome_units=tuple(metadata["outcome_units"]),
            )

    def _oddities(self, *, unit_stated: bool) -> Iterator[str]:
        """What looks like a slip: other units, and an outcome that comes twice."""
        metres = np.array([unit == "m" for unit in self.outcome_units])
        farthest = np.abs(self.outcomes_seen[:, metres]).max(initial=0.0)
        if farthest > FARTHEST * (BEYOND_DOUBT if unit_stated else 1.0):
            yield (
                f"an outcome of {farthest:g} m looks like centimetres; outcomes are in metres: "
                "divide by 100"
            )
        radians = np.array([unit == "rad" for unit in self.format.units])
        largest = np.abs(self.plans[:, :, radians]).max(initial=0.0)
        if largest > LARGEST_TURN:
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
    """Demonstrations made of others say nothing of their units again."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
