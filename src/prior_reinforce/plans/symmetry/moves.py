"""Moves: transforms of whole plans that move the outcome by w.

Each move changes the outcome along one component of a chart. It is data (a kind and parameters),
maps a plan and an amount in the chart's units to a new plan, and at an amount of 0 returns the plan
bit for bit. Plans that start and end at rest still do, except turned or shifted increments: their
first frames lead the hand to its moved start at a constant speed.

    plan    (H, D)  in the units of its format; a frame is one row
    amount  w_j     in the chart's units, [rad] for turns, [m] for shifts, [1] for ln distance
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Frames
from prior_reinforce.plans.interpolation import interp_columns, minimum_jerk
from prior_reinforce.plans.kinematics import Chain, turned_path
from prior_reinforce.plans.plan_format import stepped, summed
from prior_reinforce.plans.speeds import mean_frame

Columns = tuple[int, ...]
Ends = tuple[float, float]
"""Lowest and highest position of a joint, [rad]."""
Moved = Float[np.ndarray, "H_moved D"]
"""A moved plan, which may be longer than the original."""
NOMINAL_EXPONENT = 1.3
"""p of distance ~ speed^p before any trial (ours): 2 for a range (v^2 / g) and for a slide
(v^2 / 2 mu g), 1 where half of the way is carried, less behind soft servos and in air."""
_COLUMN_FIELDS = (
    "column",
    "columns",
    "joint",
    "place",
    "vector",
    "quaternion",
    "yaw",
    "steps",
    "increments",
)
_RANGES = ("range", "ranges")
_MOVING = 0.05
"""A plan ends in mid-swing if its last step is more than this part of its largest step (ours)."""


class Move(msgspec.Struct, frozen=True):
    """The interface."""

    def __call__(self, plan: Frames, amount: float) -> Moved:
        """Return the plan, moved by an amount."""
        return plan.copy() if amount == 0.0 else self._moved(np.asarray(plan), float(amount))

    def columns_of(self) -> Columns:
        """Return the columns of a plan that the move names."""
        return _columns(*(getattr(self, name, None) for name in _COLUMN_FIELDS))

    def increments_of(self) -> Columns:
        """Return the columns that the move treats as differences from frame to frame."""
        return _columns(getattr(self, "increments", None))

    def ranged_of(self) -> Columns:
        """Return the columns of the turned joints whose ranges are known."""
        known = any(getattr(self, name, None) for name in _RANGES)
        return self.columns_of() if known else ()

    @property
    def endless(self) -> Self:
        """The same move for joints without limits."""
        limits = {*_RANGES} & {*self.__struct_fields__}
        return msgspec.structs.replace(self, **dict.fromkeys(limits, msgspec.UNSET))

    def _moved(self, plan: Frames, amount: float) -> Moved:
        raise NotImplementedError


class Tempo(Move, frozen=True, tag="tempo"):
    """Play the plan faster or slower; ln speed = amount / exponent.

    A scaling of time whose effect on the outcome is unknown, so no symmetry: how far a faster
    motion throws has to be learned. Time is scaled around one frame, so that to first order nothing
    happens earlier or later. Slower plans are longer: nothing is cut off.
    """

    exponent: float = NOMINAL_EXPONENT
    """Nominal p of outcome ~ speed^p; negative if faster is less."""
    about: float | None = None
    """Frame that keeps its time, such as a release by a clock. None: the middle of the motion."""
    keep_horizon: bool = False
    """Keep the number of frames, since a clock counts from the first one."""
    steps: Columns = ()
    """Columns of grippers and triggers, interpolated linearly instead of by a spline."""
    increments: Columns = ()
    """Columns that are differences from frame to frame, or rates; their sum is played."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        speed = math.exp(amount / self.exponent)
        if not self.increments:
            return self._played(plan, speed, self.about)
        about = None if self.about is None else self.about + 1  # poses are reached after frames
        poses = self._played(summed(plan, self.increments), speed, about)
        return stepped(poses, self.increments)

    def _played(self, path: Frames, speed: float, about: float | None) -> Moved:
        from scipy.interpolate import CubicSpline

        last, centre = len(path) - 1, middle(path) if about is None else about
        first, end = 0, last
        if speed < 1.0 and not self.keep_horizon:
            first = math.floor(centre - centre / speed)
            end = math.ceil(centre + (last - centre) / speed)
        times = centre + (np.arange(first, end + 1) - centre) * speed
        inside, frames = np.clip(times, 0, last), np.arange(last + 1)
        out = np.asarray(CubicSpline(frames, path, axis=0)(inside))
        slopes = np.diff(path, axis=0)
        moving = _MOVING * np.abs(slopes).max(axis=0)
        before, after = np.minimum(times, 0), np.maximum(times - last, 0)
        for slope, beyond in ((slopes[0], before), (slopes[-1], after)):
            out += beyond[:, None] * np.where(np.abs(slope) > moving, slope, 0.0)
        linear = list(self.steps)
        out[:, linear] = interp_columns(inside, frames, path[:, linear])
        return out


class Amplitude(Move, frozen=True, tag="amplitude"):
    """Enlarge the motion about its first frame; ln factor = amount / exponent.

    A scaling with an unknown law, as `Tempo` is.
    """

    exponent: float = NOMINAL_EXPONENT
    """Nominal p of outcome ~ amplitude^p."""
    steps: Columns = ()
    """Columns that stay as they are."""
    increments: Columns = ()
    """Columns that are differences from frame to frame, or rates."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        origin = plan[0].copy()
        origin[list(self.increments)] = 0.0
        out = origin + (plan - origin) * math.exp(amount / self.exponent)
        out[:, list(self.steps)] = plan[:, list(self.steps)]
        return out


class Delay(Move, frozen=True, tag="delay"):
    """Delay columns and hold their ends; if all, a symmetry of an outcome that is a time."""

    frames: float
    """Frames of delay for each unit of the amount."""
    columns: Columns = ()
    """Delayed columns; empty: all."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        out, index = plan.copy(), np.arange(len(plan))
        delayed = [*(self.columns or range(plan.shape[1]))]
        out[:, delayed] = interp_columns(index - amount * self.frames, index, plan[:, delayed])
        return out


class Learned(Move, frozen=True, tag="learned"):
    """No transform: this component is learned from several demonstrations."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        return plan.copy()


class Shift(Move, frozen=True, tag="shift"):
    """Shift one column: poses move along the table."""

    column: int
    lead: int = 0
    """For a column of increments: frames within which the hand is led to its new start."""

    def increments_of(self) -> Columns:
        """See `Move.increments_of`."""
        return (self.column,) if self.lead else ()

    def _moved(self, plan: Frames, amount: float) -> Moved:
        out = plan.copy()
        if self.lead:
            out[: self.lead, self.column] += amount / self.lead
        else:
            out[:, self.column] += amount
        return out


class TurnJoint(Move, frozen=True, tag="turn-joint"):
    """Add an angle to one joint at every frame: to the first, which turns an upright arm."""

    joint: int = 0
    """Column."""
    gain: float = 1.0
    """Joint angle for each unit of the amount: -1 if the joint counts clockwise."""
    ramp: int = 0
    """If the start pose is fixed: frames within which the joint turns, by minimum jerk."""
    range: Ends | msgspec.UnsetType = msgspec.UNSET
    """Limits of the joint; a plan that would leave them turns the other way round if that fits."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        out = plan.copy()
        share = minimum_jerk(np.arange(len(plan)) / self.ramp) if self.ramp else 1.0
        out[:, self.joint] += self.gain * amount * share
        if self.range is not msgspec.UNSET and not self.ramp:
            out[:, self.joint] = _within(out[:, self.joint], self.range)
        return out


class TurnPoses(Move, frozen=True, tag="turn-poses"):
    """Turn poses, places and attitudes, about a vertical axis through a point."""

    centre: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the axis, [m]."""
    place: tuple[int, int] = (0, 1)
    """Columns of x and y."""
    vector: Annotated[Columns, msgspec.Meta(min_length=3, max_length=3)] | None = None
    """Columns of a rotation vector, whose axes are those of the table: R -> Rz R."""
    quaternion: Annotated[Columns, msgspec.Meta(min_length=4, max_length=4)] | None = None
    """Columns of a quaternion, in the order w, x, y, z."""
    yaw: int | None = None
    """Column of a heading about the vertical."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        from scipy.spatial.transform import Rotation

        out, centre = plan.copy(), np.array(self.centre)
        out[:, self.place] = (plan[:, self.place] - centre) @ about_vertical(amount).T + centre
        turn = Rotation.from_rotvec([0.0, 0.0, amount])
        if self.vector is not None:
            vector = list(self.vector)
            turned = (turn * Rotation.from_rotvec(plan[:, vector])).as_rotvec()
            out[:, vector] = _unwrapped(turned, plan[0, vector])
        if self.quaternion is not None:
            scalar_last = [*self.quaternion[1:], self.quaternion[0]]
            before = plan[:, scalar_last]
            after = (turn * Rotation.from_quat(before)).as_quat()
            out[:, scalar_last] = after * np.where((after * before).sum(1) < 0, -1, 1)[:, None]
        if self.yaw is not None:
            out[:, self.yaw] += amount
        return out


class TurnIncrements(Move, frozen=True, tag="turn-increments"):
    """Turn increments dx, dy about a point; the first frames lead the hand to its turned start."""

    start: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the hand before the first frame, [m]."""
    centre: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the axis, [m]."""
    place: tuple[int, int] = (0, 1)
    """Columns of dx and dy."""
    yaw: int | None = None
    """Column of the heading's differences."""
    lead: int = 8
    """Frames until the turned start is reached."""

    def increments_of(self) -> Columns:
        """See `Move.increments_of`."""
        return _columns(self.place, self.yaw)

    def _moved(self, plan: Frames, amount: float) -> Moved:
        out, turn = plan.copy(), about_vertical(amount)
        out[:, self.place] = plan[:, self.place] @ turn.T
        arm = np.array(self.start) - self.centre
        out[: self.lead, self.place] += (turn @ arm - arm) / self.lead
        if self.yaw is not None:
            out[: self.lead, self.yaw] += amount / self.lead
        return out


class TurnPath(Move, frozen=True, tag="turn-path"):
    """Turn joint plans about a vertical axis through a point, by inverse kinematics.

    See `kinematics.turned_path`, which refuses what is out of reach.
    """

    chain: Chain
    centre: tuple[float, float]
    """(x, y) of the axis in the base frame, [m]."""
    columns: Columns
    """Columns of the chain's joints, in its order."""
    ranges: tuple[Ends, ...] | msgspec.UnsetType = msgspec.UNSET
    """Limits of these joints, as `TurnJoint.range`."""

    def _moved(self, plan: Frames, amount: float) -> Moved:
        out, columns = plan.copy(), list(self.columns)
        out[:, columns] = turned_path(self.chain, plan[:, columns], amount, self.centre)
        for column, ends in zip(columns, self.ranges or (), strict=bool(self.ranges)):
            out[:, column] = _within(out[:, column], ends)
        return out


AnyMove = (
    Tempo | Amplitude | Delay | Learned | Shift | TurnJoint | TurnPoses | TurnIncrements | TurnPath
)


def _columns(*named: Columns | int | None) -> Columns:
    """Flatten columns that are given one by one, in groups, or not at all."""
    groups = [(each,) if isinstance(each, int) else each or () for each in named]
    return tuple(column for group in groups for column in group)


def _within(angles: Float[np.ndarray, " H"], ends: Ends) -> Float[np.ndarray, " H"]:
    """Move a joint's angles into its range by the fewest whole turns.

    Angles that lie in the range, or that no turn brings there, stay: the gate then says by how far.
    """
    fewest = math.ceil((ends[0] - angles.min()) / (2 * math.pi))
    most = math.floor((ends[1] - angles.max()) / (2 * math.pi))
    if fewest <= 0 <= most or fewest > most:
        return angles
    return np.asarray(angles + 2 * math.pi * (fewest if fewest > 0 else most))


def middle(plan: Frames) -> float:
    """Return the mean frame of a motion by squared speed, columns divided by their range.

    So units do not matter, nor columns that hardly move.
    """
    ranges = np.ptp(plan, axis=0)
    steps = np.diff(plan, axis=0) / np.maximum(ranges, 1e-3 * ranges.max() + 1e-12)
    return mean_frame(np.square(steps).sum(axis=1), first=0.5)


def about_vertical(angle: float) -> Float[np.ndarray, "2 2"]:
    """Return the rotation by an angle in the plane."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def _unwrapped(
    vectors: Float[np.ndarray, "H 3"], first: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "H 3"]:
    """Unwrap rotation vectors: the same attitudes without jumps, beginning near `first`."""
    out, previous = vectors.copy(), first
    for frame, vector in enumerate(vectors):
        angle = np.linalg.norm(vector)
        if angle > 1e-9:
            turns = np.round((previous @ vector / angle - angle) / (2 * np.pi))
            out[frame] = vector * (1 + 2 * np.pi * turns / angle)
        previous = out[frame]
    return out
