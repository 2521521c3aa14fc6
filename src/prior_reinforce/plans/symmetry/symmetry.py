"""Symmetries: how a whole motion may be moved, and the prior of what that does to its outcome.

    w = z_aim - z_base                 move of a plan, in a chart of outcomes
    z = z_base + G w + ...             its outcome; G (k, k) is the identity in exact components

`Symmetry` is stated by a task or a workspace, and kept with demonstrations as data. Trials may
refute it: G is known only by a prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.arrays import Frames, Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.symmetry.charts import AnyChart, Cartesian, LogDistance, Polar
from prior_reinforce.plans.symmetry.moves import (
    Amplitude,
    AnyMove,
    Delay,
    Learned,
    Moved,
    Shift,
    Tempo,
)
from prior_reinforce.units import factor

Matrix = Float[np.ndarray, "k k"]
_UNITLESS = (Tempo, Amplitude, Delay, Learned)
"""Moves without places and angles: columns may be in any unit."""
EXTRAPOLATED = 0.5
"""How far learned components are extrapolated, as a part of the demonstrated range (ours: see
`Demonstrations.far_outside`)."""


class _Data(msgspec.Struct, forbid_unknown_fields=True):
    """A symmetry as plain data."""

    name: str
    chart: AnyChart
    moves: tuple[AnyMove, ...]
    exact: tuple[bool, ...]
    gain_mean: tuple[tuple[float, ...], ...]
    gain_sd: tuple[tuple[float, ...], ...]
    offset_sd: tuple[float, ...]
    bend_sd: tuple[float, ...]
    between_sd: tuple[float, ...]
    farthest: tuple[float, ...]
    rival: _Data | None = None


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Moves of plans, and the prior of the moved plans' outcomes.

    Standard deviations are in units of the chart. Sources of the priors: module `moves` for p, else
    ours, from reasoning before any figure (5 % of a distance, 0.03 rad from day to day).
    """

    name: str
    """In plain words, for messages: `turn and tempo`."""
    chart: AnyChart
    """Coordinates z of outcomes."""
    moves: tuple[AnyMove, ...]
    """Move along each component of z, applied in this order."""
    exact: Bool[np.ndarray, " k"]
    """Components along which the physics is invariant; others are scalings of unknown law."""
    gain_mean: Matrix
    """Prior mean of G."""
    gain_sd: Matrix
    """Prior standard deviation of G; relative to the nominal exponent of a move that has one."""
    offset_sd: Point
    """Of an offset common to all plans: another day, another demonstration."""
    bend_sd: Point
    """Of the deviation from the linear law, for each unit of w, since it is no power law."""
    between_sd: Point
    """Of the deviation between mixed demonstrations."""
    farthest: Point
    """Largest |w| at which the prior is trusted."""
    rival: Symmetry | None = None
    """Another hypothesis, which a session adopts if outcomes do not follow this one."""

    def __post_init__(self) -> None:
        """Copy and check; ConfigurationError for sizes that do not fit k, the number of moves."""
        k = len(self.moves)
        object.__setattr__(self, "moves", tuple(self.moves))
        for name, shape in _SHAPES.items():
            values = np.array(getattr(self, name), dtype=bool if name == "exact" else np.float64)
            if values.shape != (k,) * shape or not np.all(np.isfinite(values)):
                raise ConfigurationError(
                    f"{name} of the symmetry {self.name!r} must be {' x '.join([str(k)] * shape)} "
                    f"finite numbers, one for each of its moves, got {values.tolist()}"
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def k(self) -> int:
        """Number of components of the outcome."""
        return len(self.moves)

    @property
    def learned(self) -> Bool[np.ndarray, " k"]:
        """Components that are learned from several demonstrations, and that no move changes."""
        return np.array([isinstance(move, Learned) for move in self.moves])

    @property
    def clocked(self) -> bool:
        """Whether a clock releases the object, by the tempo's `keep_horizon`."""
        return any(isinstance(move, Tempo) and move.keep_horizon for move in self.moves)

    def check_units(self, outcomes: Sequence[str], plans: Sequence[str]) -> None:
        """Check that turned and shifted columns are in m and rad, as places and angles of moves.

        Args:
            outcomes: Units of an outcome's components.
            plans: Units of a plan's columns.

        Raises:
            ConfigurationError: One is in another unit of length or angle: a turn would give a wrong
                motion.
        """
        moved = [c for m in self.moves if not isinstance(m, _UNITLESS) for c in m.columns_of()]
        for unit in (plans[column] for column in moved):
            if any(factor(unit, base) not in (None, 1.0) for base in ("m", "rad")):
                raise ConfigurationError(
                    f"plans are in {unit}, and a motion is turned or shifted in m and rad: convert "
                    "those columns (--action-units m rad ...; recordings are converted)"
                )
        lengths = [unit for unit in outcomes[:2] if factor(unit, "m") not in (None, 1.0)]
        if lengths and not isinstance(self.chart, LogDistance):  # which has no place
            raise ConfigurationError(
                f"outcomes are in {lengths[0]}, and a motion is turned or shifted in the metres of "
                "the table; write units m, and the tolerance in m ([outcome], --outcome-units): "
                "tables in other units are converted, and trials may be told in any"
            )

    def farthest_from(self, z: Points) -> Point:
        """Return how far beyond the demonstrated range aims are supported, in each component.

        Plans are moved by up to `farthest`; learned components are extrapolated by half the range.

        Args:
            z: Demonstrated outcomes in the chart, shape (N, k).
        """
        return np.where(self.learned, EXTRAPOLATED * np.ptp(z, axis=0), self.farthest)

    @property
    def increments(self) -> tuple[int, ...]:
        """Columns of a plan that are 0 at rest: increments and rates of its moves."""
        return tuple(sorted({column for move in self.moves for column in move.increments_of()}))

    @property
    def endless(self) -> Symmetry:
        """The same symmetry for joints without limits."""
        return replace(self, moves=tuple(move.endless for move in self.moves))

    def speed(self, w: Point) -> float:
        """Return the factor by which a plan moved by w (k,) is played faster."""
        logs = [w[j] / m.exponent for j, m in enumerate(self.moves) if isinstance(m, Tempo)]
        return float(np.exp(np.sum(logs)))

    def move(self, plan: Frames, w: Point) -> Moved:
        """Return a plan (H, D) moved by w (k,); at w = 0 the same bit for bit.

        Raises:
            OutOfReachError: The arm cannot make the moved motion.
        """
        for each, amount in zip(self.moves, w, strict=True):
            plan = each(plan, float(amount))
        return plan

    def toward(self, moved: Moved, near: Frames) -> Moved:
        """Return a moved plan by the whole turns of turned joints that begin nearest to `near`.

        So the same motion is mixed and compared as such; for joints whose ranges are known.
        """
        out = np.array(moved)
        columns = [column for move in self.moves for column in move.ranged_of()]
        turns = (near[0, columns] - moved[0, columns]) / (2 * np.pi)
        out[:, columns] += 2 * np.pi * np.round(turns)
        return out

    def around(self, outcomes: Points) -> Symmetry:
        """Return the symmetry with its chart around these outcomes; see `Chart.around`."""
        return replace(self, chart=self.chart.around(outcomes))

    def data(self) -> dict[str, Any]:
        """Return it as plain data, of JSON types."""
        numbers = {name: getattr(self, name).tolist() for name in _SHAPES}
        data = {"name": self.name, "chart": self.chart, "moves": self.moves, **numbers}
        if self.rival is not None:
            data["rival"] = self.rival.data()
        made: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(data, enc_hook=float))
        return made

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Symmetry:
        """Rebuild a symmetry from its `data`; runs no code from it.

        Raises:
            ConfigurationError: Something is missing, unknown, or of another type.
        """
        try:
            read = msgspec.convert(data, _Data)
        except msgspec.ValidationError as error:
            raise ConfigurationError(f"this is no symmetry: {error}") from error
        return cls._of(read)

    @classmethod
    def _of(cls, read: _Data) -> Symmetry:
        known = {name: getattr(read, name) for name in read.__struct_fields__}
        return cls(**known | {"rival": read.rival and cls._of(read.rival)})

    def __eq__(self, other: object) -> bool:
        """Whether both are the same data."""
        return isinstance(other, Symmetry) and self.data() == other.data()

    def __hash__(self) -> int:
        return hash((self.name, self.moves, self.chart))

    def __repr__(self) -> str:
        """Name and chart."""
        return f"Symmetry({self.name}, {self.chart})"


_SHAPES = {
    "exact": 1,
    "gain_mean": 2,
    "gain_sd": 2,
    "offset_sd": 1,
    "bend_sd": 1,
    "between_sd": 1,
    "farthest": 1,
}
"""Axes of each array, all of length k."""
_SCALING_SD = 0.5
_DISTANCE = {"offset_sd": 0.05, "bend_sd": 0.1, "between_sd": 0.1, "farthest": 0.9}
_BEARING = {"offset_sd": 0.03, "bend_sd": 0.03, "between_sd": 0.05, "farthest": np.pi}
_OTHER = {"offset_sd": 0.05, "bend_sd": 0.1, "between_sd": 0.1, "farthest": 0.5}
_PLACE = {"offset_sd": 0.05, "bend_sd": 0.1, "between_sd": 0.1, "farthest": 2.0}


def turn_and_scale(
    turn: AnyMove,
    centre: tuple[float, float] = (0.0, 0.0),
    scale: AnyMove | None = None,
    others: tuple[AnyMove, ...] = (),
) -> Symmetry:
    """Return the symmetry of a turn about a vertical axis and a scaling of distance.

    Args:
        turn: The exact move: `TurnJoint`, `TurnPoses`, `TurnIncrements` or `TurnPath`.
        centre: (x, y) of the axis in the outcomes' frame, [m].
        scale: `Tempo` (the default), `Amplitude` or `Learned`.
        others: Move of each further component of the outcome, by a law as unknown as tempo's.
    """
    scale, n = scale or Tempo(), len(others)
    moved = [type(each).__name__.lower() for each in (scale, *others) if type(each) is not Learned]
    name = " and ".join(["turn", *moved])
    chart = Polar((float(centre[0]), float(centre[1])))
    exact, sd = (False, True, *[False] * n), (_SCALING_SD, 0.1, *[_SCALING_SD] * n)
    return _made(name, chart, (scale, turn, *others), exact, sd, _DISTANCE, _BEARING, *[_OTHER] * n)


def shift(columns: tuple[int, int] = (0, 1), lead: int = 0) -> Symmetry:
    """Return the symmetry of motions that may happen anywhere on the table: of poses or increments.

    Args:
        columns: Columns of x and y.
        lead: For increments: frames until the shifted start is reached.
    """
    moves = tuple(Shift(column, lead) for column in columns)
    return _made("shift", Cartesian(), moves, (True, True), (0.15, 0.15), _PLACE, _PLACE)


def scale_alone(scale: AnyMove | None = None) -> Symmetry:
    """Return the symmetry of one positive outcome that a scaling reaches: tempo by default."""
    scale = scale or Tempo()
    name = type(scale).__name__.lower()
    return _made(name, LogDistance(), (scale,), (False,), (_SCALING_SD,), _DISTANCE)


def _made(
    name: str,
    chart: AnyChart,
    moves: tuple[AnyMove, ...],
    exact: tuple[bool, ...],
    gain_sd: tuple[float, ...],
    *priors: Mapping[str, float],
) -> Symmetry:
    arrays: dict[str, Any] = {k: np.array([each[k] for each in priors]) for k in _DISTANCE}
    mean, sd = np.eye(len(moves)), np.diag(gain_sd)
    return Symmetry(name, chart, moves, np.array(exact), mean, sd, **arrays)
