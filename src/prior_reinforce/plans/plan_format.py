"""The format of a plan's frames: names, units, time step, turns and attitudes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Frames, Point, is_positive
from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.channels import increments
from prior_reinforce.plans.whole_turns import TURN, other_form


@dataclass(frozen=True)
class PlanFormat:
    """Meaning of a frame's numbers (paper, Table I: "Frame Action Format")."""

    names: tuple[str, ...]
    """Name of each of the D action dimensions, for instance `joint1`."""
    units: tuple[str, ...]
    """Unit of each dimension: `rad`, `m`, `1` for pure numbers, or any other word."""
    dt: float
    """Time between two frames, in [s]."""
    per_plan: tuple[str, ...] = ()
    """Names of the dimensions that are one number a plan, the same at every frame: the start of a
    motion, for instance."""
    periodic: tuple[str, ...] = ()
    """Names of the angles that repeat after a whole turn: of a joint that turns endlessly, of a
    yaw."""
    attitudes: tuple[tuple[str, ...], ...] = ()
    """Names of four dimensions that are a unit quaternion, or of three that are a rotation vector;
    each has two forms (`plans.whole_turns`)."""

    def __post_init__(self) -> None:
        """Check the format.

        InvalidPlanError for no names, repeated names, or another number of units than of names.
        """
        for name in ("names", "units", "per_plan", "periodic"):
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
        object.__setattr__(self, "attitudes", tuple(map(tuple, self.attitudes)))
        named = {
            "per_plan": self.per_plan,
            "periodic": self.periodic,
            "attitudes": tuple(chain.from_iterable(self.attitudes)),
        }
        for key, given in named.items():
            if unknown := set(given) - set(self.names):
                raise InvalidPlanError(f"{key} names {sorted(unknown)}, but actions {self.names}")

    @property
    def action_dim(self) -> int:
        """D, the number of action dimensions."""
        return len(self.names)

    @property
    def increments(self) -> tuple[int, ...]:
        """Columns that are changes of a pose until the next frame: `dx`, `joint1_delta`.

        Their sum is the pose. Those of a place and a heading are along the table's axes (`x` and
        `y` of outcomes); odometry, along a body's own, must be recorded as poses. A rate, as in
        m/s, is no increment; nor is `d_joint1` beside `joint1` or `dx` beside `x`, which are rates
        in exports and states.
        """
        return increments(self.names, self.units)

    def toward(self, frames: Frames, pose: Point) -> Frames:
        """Return the same motion in the whole turns and signs that begin nearest to a pose.

        Only the numbers of periodic dimensions and attitudes change.

        Args:
            frames: Shape (T, D).
            pose: Shape (D,), in the same units.
        """
        frames = np.array(frames, dtype=np.float64)
        for name in self.periodic:
            i = self.names.index(name)
            turn = TURN[self.units[i]]
            frames[:, i] += turn * np.round((pose[i] - frames[0, i]) / turn)
        for group in self.attitudes:
            columns = [self.names.index(name) for name in group]
            own, other = frames[:, columns], other_form(frames[:, columns])
            if np.linalg.norm(other[0] - pose[columns]) < np.linalg.norm(own[0] - pose[columns]):
                frames[:, columns] = other
        return frames


def summed(
    frames: Float[np.ndarray, "*N T D"], increments: Sequence[int]
) -> Float[np.ndarray, "*N T+1 D"]:
    """Return the poses of a motion of increments: from 0 before the first frame to after the last.

    Poses can be resampled. Other columns stay with the pose at which they are commanded, and hold
    their last value. Frames are of shape (..., T, D), `increments` those columns
    (`PlanFormat.increments`).
    """
    poses, columns = np.concatenate([frames, frames[..., -1:, :]], axis=-2), list(increments)
    poses[..., 0, columns] = 0.0
    poses[..., 1:, columns] = np.cumsum(frames[..., columns], axis=-2)
    return poses


def stepped(
    poses: Float[np.ndarray, "*N P D"], increments: Sequence[int]
) -> Float[np.ndarray, "*N P-1 D"]:
    """Return the increments between poses: the inverse of `summed`."""
    frames, columns = np.array(poses[..., :-1, :]), list(increments)
    frames[..., columns] = np.diff(poses[..., columns], axis=-2)
    return frames
