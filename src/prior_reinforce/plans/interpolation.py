"""Interpolation of a plan's frames to the arm's commands at 1 kHz; no other module does it.

The frames are joined by a cubic spline with continuous acceleration that starts and ends at rest;
the first pose is held before, the last one after. Ours, because servo loops are given such a
clamped spline, indexed by the robot's clock: it passes through every frame, and its peak velocity
and acceleration are those of the recorded motion rather than of a filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Real
from numpy.typing import ArrayLike

from prior_reinforce.errors import InvalidPlanError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

RATE = 1000.0
"""Control cycles a second of the Franka arms' interface (frankarobotics/docs,
robot_specifications.rst: limits hold for the command stream at 1 kHz)."""


@dataclass(frozen=True, eq=False)
class FineMotion:
    """A plan sampled evenly in time."""

    t: Float[np.ndarray, " T"]
    """Time from the plan's first frame, in [s]; negative during the hold before."""
    q: Float[np.ndarray, "T D"]
    """Positions, in the plan's unit, mostly [rad]."""
    dq: Float[np.ndarray, "T D"]
    """Velocities, unit/s: the spline's exact derivative."""
    ddq: Float[np.ndarray, "T D"]
    """Accelerations, unit/s^2: the spline's exact second derivative, 0 while a pose is held."""
    dddq: Float[np.ndarray, "T D"]
    """Jerks, unit/s^3: backward differences of `ddq`, as a controller sees them, so that the step
    of acceleration between a hold and the motion counts too."""


def minimum_jerk(phase: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Return the minimum-jerk course from 0 at phase 0 to 1 at phase 1: 10 p^3 - 15 p^4 + 6 p^5.

    Its ends are held outside. Source: Flash and Hogan, The coordination of arm movements, 1985.
    """
    phase = np.clip(phase, 0.0, 1.0)
    return phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)


def interp_columns(
    at: Float[np.ndarray, " n"],
    times: Real[np.ndarray, " T"],
    columns: Float[np.ndarray, "T D"],
) -> Float[np.ndarray, "n D"]:
    """Interpolate columns linearly between rising `times`, as `numpy.interp`; their ends are held.

    `at` and `times` are in the same unit, [s] or frames.
    """
    values = np.empty((len(at), columns.shape[1]))
    for d, column in enumerate(columns.T):
        values[:, d] = np.interp(at, times, column)
    return values


def join_frames(frames: ArrayLike, dt: float) -> CubicSpline:
    """Return the spline over [0, (H - 1) dt [s]] through frames (H, D), at rest at both ends.

    InvalidPlanError for another shape, values that are not finite, or a dt that is not positive.
    """
    from scipy.interpolate import CubicSpline

    frames = np.asarray(frames, dtype=np.float64)
    if frames.ndim != 2 or frames.shape[0] < 2 or not np.all(np.isfinite(frames)):
        raise InvalidPlanError(
            f"frames must be finite, of shape (H, D) with H >= 2, got {frames.shape}"
        )
    if not (math.isfinite(dt) and dt > 0):
        raise InvalidPlanError(f"dt must be a positive number of seconds, got {dt}")
    return CubicSpline(np.arange(frames.shape[0]) * dt, frames, bc_type="clamped")


def interpolate(
    frames: ArrayLike,
    dt: float,
    *,
    rate: float = RATE,
    hold_before: float = 0.0,
    hold_after: float = 0.0,
) -> FineMotion:
    """Sample a plan at a fixed rate, with its end poses held before and after.

    The map is linear in the frames: `interpolate(numpy.eye(H), dt)` gives the matrices that map the
    frames of any plan of that horizon to positions, velocities and so on.

    Args:
        frames: Shape (H, D), H >= 2.
        dt: Time between two frames, in [s].
        rate: Samples a second.
        hold_before: How long the first pose is held, in [s]; rounded up to a sample.
        hold_after: How long the last pose is held, in [s]; rounded up to a sample.

    Raises:
        InvalidPlanError: As `join_frames`, or a rate or a hold out of range.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise InvalidPlanError(f"rate must be a positive number of samples a second, got {rate}")
    if not (0 <= hold_before < math.inf and 0 <= hold_after < math.inf):
        raise InvalidPlanError(f"holds must be 0 s or more, got {hold_before} and {hold_after}")
    spline = join_frames(frames, dt)
    end = float(spline.x[-1])
    # Rounding in 1.39 s * 1000 Hz = 1390.0000000000002 must not add a sample.
    first = -math.ceil(hold_before * rate - 1e-9)
    last = math.ceil(end * rate - 1e-9) + math.ceil(hold_after * rate - 1e-9)
    t = np.arange(first, last + 1) / rate
    inside = ((t >= 0) & (t <= end + 1e-12))[:, None]
    at = np.clip(t, 0.0, end)
    ddq = spline(at, 2) * inside
    before = np.zeros_like(ddq[:1])
    return FineMotion(
        t=t,
        q=spline(at),
        dq=spline(at, 1) * inside,
        ddq=ddq,
        dddq=np.diff(ddq, axis=0, prepend=before) * rate,
    )
