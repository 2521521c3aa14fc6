"""What may be done to a whole motion, and what that does to its outcome.

    w = z_aim - z_base                 by how much a plan is moved, in a chart of outcomes
    z = z_base + G w + ...             where it comes down; G (k, k) is the identity where exact

`Symmetry` is stated by a task or a workspace, and kept with demonstrations as data. Evidence may
take it back: every belief about G is a prior.
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
_PLAYED = (Tempo, Amplitude, Delay, Learned)
"""Moves that know no place and no angle: columns may be in any unit."""
EXTRAPOLATED = 0.5
"""How far beyond the demonstrated range what was learned is believed, as a part of it (ours: see
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
    """How plans are moved, and what is believed of where they then come down, beforehand.

    Standard deviations are in units of the chart. Sources of the priors: module `moves` for p, else
    ours, from reasoning before any figure (5 % of a distance, 0.03 rad from day to day).
    """

    name: str
    """In plain words, for messages: `turn and tempo`."""
    chart: AnyChart
    """Coordinates z of outcomes."""
    moves: tuple[AnyMove, ...]
    """How a plan is moved along each component of z; in this order."""
    exact: Bool[np.ndarray, " k"]
    """Components along which the physics stays the same; others are scalings of unknown law."""
    gain_mean: Matrix
    """Of G."""
    gain_sd: Matrix
    """Of G; relative to a nominal exponent where a move has one."""
    offset_sd: Point
    """What is off by the same everywhere: another day, another demonstration."""
    bend_sd: Point
    """What the law is off by for each unit of w, since it is no power law."""
    between_sd: Point
    """What is off between demonstrations that are mixed."""
    farthest: Point
    """Largest |w| that is believed."""
    rival: Symmetry | None = None
    """Another one, which a session takes up where outcomes do not follow this one."""

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
        """Components that several demonstrations tell, and that no move changes."""
        return np.array([isinstance(move, Learned) for move in self.moves])

    @property
    def clocked(self) -> bool:
        """Whether a clock releases, as its tempo says."""
        return any(isinstance(move, Tempo) and move.keep_horizon for move in self.moves)

    def check_units(self, outcomes: Sequence[str], plans: Sequence[str]) -> None:
        """Check that what is turned or shifted is in m and rad, as places and angles of moves are.

        Args:
            outcomes: Units of an outcome's components.
            plans: Units of a plan's columns.

        Raises:
            ConfigurationError: One is another length or angle: a turn would give another motion
                than is meant.
        """
        moved = [c for m in self.moves if not isinstance(m, _PLAYED) for c in m.columns_of()]
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
        """How far aims beyond the demonstrated range are believed, in each component.

        By `farthest` plans are moved; what is learned is extrapolated by half the range.

        Args:
            z: Demonstrated outcomes in the chart, shape (N, k).
        """
        return np.where(self.learned, EXTRAPOLATED * np.ptp(z, axis=0), self.farthest)

    @property
    def increments(self) -> tuple[int, ...]:
        """Columns of a plan that are 0 at rest, increments and rates, as its moves say."""
        return tuple(sorted({column for move in self.moves for column in move.increments_of()}))

    @property
    def endless(self) -> Symmetry:
        """The same for joints of any range."""
        return replace(self, moves=tuple(move.endless for move in self.moves))

    def speed(self, w: Point) -> float:
        """Return how much faster a plan that is moved by w (k,) is played."""
        at = [w[j] / m.exponent for j, m in enumerate(self.moves) if isinstance(m, Tempo)]
        return float(np.exp(np.sum(at)))

    def move(self, plan: Frames, w: Point) -> Moved:
        """Return a plan (H, D) moved by w (k,); at w = 0 bit for bit the same.

        Raises:
            OutOfReachError: The arm cannot make the moved motion.
        """
        for each, amount in zip(self.moves, w, strict=True):
            plan = each(plan, float(amount))
        return plan

    def toward(self, moved: Moved, near: Frames) -> Moved:
        """Return a moved plan by those whole turns of turned joints that begin nearest to another.

        So motions of one pose are mixed and compared as such; where joints' ranges are known.
        """
        out = np.array(moved)
        columns = [column for move in self.moves for column in move.ranged_of()]
        apart = (near[0, columns] - moved[0, columns]) / (2 * np.pi)
        out[:, columns] += 2 * np.pi * np.round(apart)
        return out

    def around(self, outcomes: Points) -> Symmetry:
        """Return it with a chart that does not jump amid these outcomes; see `Chart.around`."""
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
        """Make it from what `data` gave; runs no code from it.

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
    """Bearing by a turn about a vertical axis, distance by a scaling: tempo, if not said.

    Args:
        turn: Which is exact: `TurnJoint`, `TurnPoses`, `TurnIncrements` or `TurnPath`.
        centre: (x, y) of the axis in the outcomes' frame, [m].
        scale: `Tempo`, `Amplitude` or `Learned`.
        others: What moves each further component of the outcome, by a law as unknown as tempo's.
    """
    scale, n = scale or Tempo(), len(others)
    moved = [type(each).__name__.lower() for each in (scale, *others) if type(each) is not Learned]
    name = " and ".join(["turn", *moved])
    chart = Polar((float(centre[0]), float(centre[1])))
    exact, sd = (False, True, *[False] * n), (_SCALING_SD, 0.1, *[_SCALING_SD] * n)
    return _made(name, chart, (scale, turn, *others), exact, sd, _DISTANCE, _BEARING, *[_OTHER] * n)


def shift(columns: tuple[int, int] = (0, 1), lead: int = 0) -> Symmetry:
    """Motions that may happen anywhere on the table: x and y of poses, or of increments.

    Args:
        columns: Of x and y.
        lead: Frames until the shifted start is reached, where columns are increments.
    """
    moves = tuple(Shift(column, lead) for column in columns)
    return _made("shift", Cartesian(), moves, (True, True), (0.15, 0.15), _PLACE, _PLACE)


def scale_alone(scale: AnyMove | None = None) -> Symmetry:
    """One positive outcome, reached by a scaling alone: tempo, if not said."""
    scale = scale or Tempo()
    name = type(scale).__name__.lower()
    return _made(name, LogDistance(), (scale,), (False,), (_SCALING_SD,), _DISTANCE)


def _made(
    name: str,
    chart: AnyChart,
    moves: tuple[AnyMove, ...],
    exact: tuple[bool, ...],
    gain_sd: tuple[float, ...],
    *believed: Mapping[str, float],
) -> Symmetry:
    arrays: dict[str, Any] = {k: np.array([each[k] for each in believed]) for k in _DISTANCE}
    mean, sd = np.eye(len(moves)), np.diag(gain_sd)
    return Symmetry(name, chart, moves, np.array(exact), mean, sd, **arrays)
