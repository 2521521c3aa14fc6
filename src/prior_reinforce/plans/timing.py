"""When and how fast a plan moves: each question of that kind is answered here, once.

Three measures of rest, because there are three kinds of data:

- *Speed*, of all dimensions together, smoothed and relative to its peak, where motions are compared
  or cut out: `AT_REST`, `MOVING`, `LARGEST_END_SPEED`.
- *The step of one dimension* from frame to frame, relative to its largest, where only that
  dimension matters: `RESTING_STEP`.
- *The distance from an end pose*, where a recording has any rate and no frames yet: `STILL_SHARE`,
  `STILL_FLOOR`.

They differ because mistakes cost differently: a frame that is cut away is lost (so a low
threshold), an onset that is only compared is not.

Notation:
    s   speed   (H,)   relative to the pooled rms of its unit [-]
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.channels import kinds, largest_of_unit
from prior_reinforce.plans.motions import Demonstrations

SMOOTHING = 0.03
"""Standard deviation of the Gaussian that smooths velocities before they are compared, in [s].
Ours: well above a frame of jitter, well below the dynamic phase of a throw."""
AT_REST = 0.005
"""Slower than this part of the peak speed, frames may be cut away. Ours, low: they are lost."""
MOVING = 0.05
"""A motion begins and ends where its speed crosses this part of its peak. Ours, the usual 5 %: the
tremor of the shipped tele-operated sets reaches 0.03, and their motions start within two frames of
this crossing."""
LARGEST_END_SPEED = 0.1
"""A first or last frame that is faster, relative to the peak, is not at rest: the motion goes on
beyond it. Ours."""
RESTING_STEP = 0.01
"""A dimension rests at an end of a plan if its step there is at most this part of its largest step.
Ours: a plan is then generated at rest there too."""
STILL_SHARE = 0.005
"""A channel is still within this share of the largest range of any channel of its unit. Ours: above
encoder noise, and reached by a smooth start within its first tenth."""
STILL_FLOOR = {"rad": 1e-3, "m": 5e-4}
"""But never within less than this. Ours: several counts of a joint encoder or a gripper."""

_NO_MOTION = 1e-12
"""Velocities below this part of the values are rounding, not motion."""
_EDGE = 0.1
"""A motion's span includes the rest next to it for this part of its duration, so that nothing
slower than `MOVING` is lost."""
_JUMPS = ("step", "switch")
_SLOPE_FRAMES = 3
"""Steps at an end over which its velocity is averaged. Ours."""

Speed = Float[np.ndarray, " H"]
"""How fast one plan moves at each frame, relative to the pooled rms of each unit."""


# --- speed ---


def velocity_profiles(
    plans: Plans, units: tuple[str, ...], smoothing: float
) -> Float[np.ndarray, "n H D"]:
    """Return smoothed velocities, scaled so that the dimensions of every unit count alike.

    Dimensions of one unit share one scale, their pooled root mean square over all plans: a joint
    that only jitters stays small beside one that throws. A unit in which nothing moves gives zeros.

    Args:
        plans: Plans.
        units: Unit of each dimension.
        smoothing: Standard deviation of the Gaussian they are smoothed with, in frames.

    Returns:
        Central differences, smoothed and scaled: pure numbers.
    """
    from scipy.ndimage import gaussian_filter1d

    velocities = np.gradient(plans, axis=1)
    if smoothing > 0:
        velocities = gaussian_filter1d(velocities, smoothing, axis=1, mode="reflect")
    profiles = np.zeros_like(velocities)
    for unit in dict.fromkeys(units):
        members = [d for d, other in enumerate(units) if other == unit]
        pooled = math.sqrt(float(np.mean(velocities[..., members] ** 2)))
        if pooled > _NO_MOTION * float(np.abs(plans[..., members]).max()):
            profiles[..., members] = velocities[..., members] / pooled
    return profiles


def speeds(demonstrations: Demonstrations) -> Float[np.ndarray, "N H"]:
    """Return how fast each demonstration moves: the norm of its `velocity_profiles`."""
    plan_format = demonstrations.format
    profiles = velocity_profiles(
        demonstrations.plans, plan_format.units, SMOOTHING / plan_format.dt
    )
    return np.asarray(np.linalg.norm(profiles, axis=2))


def recorded_speeds(demonstrations: Demonstrations) -> Float[np.ndarray, "N H"]:
    """Return how fast each demonstration moves frame by frame, to show rather than to compare.

    Not smoothed, each dimension relative to the largest range among the dimensions of its unit.
    """
    plans, units = demonstrations.plans, np.array(demonstrations.format.units)
    ranges = np.ptp(plans, axis=1).max(axis=0)
    scaled = plans / [max(ranges[units == unit].max(), 1e-12) for unit in units]
    return np.asarray(np.linalg.norm(np.gradient(scaled, axis=1), axis=-1))


def onset(speed: Speed) -> float:
    """Return the first frame that counts as moving."""
    return float(np.argmax(speed > MOVING * speed.max()))


def middle(speed: Speed) -> float:
    """Return the middle of the dynamic phase: the mean frame, weighted by squared speed."""
    return float(np.average(np.arange(len(speed)), weights=speed**2))


def motion_span(speed: Speed) -> Float[np.ndarray, 2]:
    """Return where a motion begins and ends, in frames and parts of them.

    Crossings of `MOVING` are interpolated between frames and widened by a tenth of the duration; an
    end at which the plan does not rest is the plan's own. A plan that never moves is one motion.
    """
    last = len(speed) - 1
    threshold = MOVING * speed.max()
    moving = np.flatnonzero(speed > threshold)
    if not moving.size:
        return np.array([0.0, float(last)])
    a, b = int(moving[0]), int(moving[-1])
    start, end = float(a), float(b)
    if a > 0:
        start -= (speed[a] - threshold) / (speed[a] - speed[a - 1])
    if b < last:
        end += (speed[b] - threshold) / (speed[b] - speed[b + 1])
    edge = _EDGE * (end - start)
    return np.array([start - edge * (a > 0), end + edge * (b < last)])


def frames_at_rest(speed: Speed) -> tuple[int, int]:
    """Count the frames before a motion begins and after it has ended; all of a constant plan."""
    moving = np.flatnonzero(speed > AT_REST * speed.max())
    if not moving.size:
        return len(speed), len(speed)
    return int(moving[0]), len(speed) - 1 - int(moving[-1])


# --- one dimension ---


def resting_dimensions(plans: Plans) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    """Tell for each dimension whether every plan starts, and whether every plan ends, at rest."""
    steps = np.abs(np.diff(plans, axis=1))
    slow = RESTING_STEP * steps.max(axis=(0, 1))
    start, end = (steps[:, 0] <= slow).all(axis=0), (steps[:, -1] <= slow).all(axis=0)
    return tuple(start.tolist()), tuple(end.tolist())


# --- recordings ---


def still_bands(
    recordings: Sequence[Float[np.ndarray, "_ D"]], units: Sequence[str]
) -> Float[np.ndarray, " D"]:
    """Return how far each channel may stray from a pose and still count as there, in its unit.

    Args:
        recordings: Positions of each, of any length.
        units: Of the D channels.
    """
    ranges = np.max([np.ptp(positions, axis=0) for positions in recordings], axis=0)
    floors = np.array([STILL_FLOOR.get(unit, 0.0) for unit in units])
    return np.maximum(STILL_SHARE * largest_of_unit(ranges, units), floors)


def moving_rows(
    positions: Float[np.ndarray, "T D"], still: Float[np.ndarray, " D"]
) -> tuple[int, int] | None:
    """Return the first row away from the first pose, and the last one away from the last pose.

    A motion that returns to where it began has rows of both kinds all the same. None if nothing
    moves.

    Args:
        positions: A recording.
        still: From `still_bands`.
    """
    left = np.flatnonzero(np.any(np.abs(positions - positions[0]) > still, axis=1))
    ahead = np.flatnonzero(np.any(np.abs(positions - positions[-1]) > still, axis=1))
    if not left.size:
        return None
    return int(left[0]), int(ahead[-1] if ahead.size else left[-1])


# --- before a plan begins, and after it has ended ---


class Continued:
    """Plans as functions of time, also outside the frames that were recorded.

    Where a plan rests at an end it holds there; where it does not, it goes on with the velocity of
    its last frames. Whole frames are recorded values; parts of frames are on a cubic spline, those
    of a step between two frames on a line, so that it does not overshoot.
    """

    def __init__(
        self, plans: Plans, units: tuple[str, ...], speeds: Float[np.ndarray, "n H"]
    ) -> None:
        """Tell where each plan rests.

        Args:
            plans: A, of the demonstrations.
            units: Of the D dimensions.
            speeds: How fast each moves at each frame.
        """
        from scipy.interpolate import make_interp_spline

        horizon = plans.shape[1]
        clock, n = np.arange(horizon, dtype=float), min(_SLOPE_FRAMES, horizon - 1)
        self.plans = plans
        self._splines = [make_interp_spline(clock, plan, k=min(3, horizon - 1)) for plan in plans]
        self._steps = [d for d, kind in enumerate(kinds(plans, units)) if kind in _JUMPS]
        moving = speeds[:, [0, -1]] > LARGEST_END_SPEED * speeds.max(axis=1, keepdims=True)
        slopes = np.stack([plans[:, n] - plans[:, 0], plans[:, -1] - plans[:, -1 - n]]) / n
        self._slopes = slopes * moving.T[:, :, None]
        self._slopes[:, :, self._steps] = 0.0  # a step that has just changed does not go on

    def __call__(self, i: int, t: Float[np.ndarray, " L"]) -> Float[np.ndarray, "L D"]:
        """Return plan i at times t, in frames."""
        last = self.plans.shape[1] - 1
        before, after = self._slopes[:, i]
        outside = np.minimum(t, 0.0)[:, None] * before + np.maximum(t - last, 0.0)[:, None] * after
        inside = np.clip(t, 0.0, last)
        values = self._splines[i](inside)
        for d in self._steps:
            values[:, d] = np.interp(inside, np.arange(last + 1), self.plans[i, :, d])
        whole = inside == np.floor(inside)
        values[whole] = self.plans[i, inside[whole].astype(int)]
        return np.asarray(values + outside)
