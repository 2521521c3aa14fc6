"""When and how fast a plan moves: each question of that kind is answered here, once.

Three measures of rest, because there are three kinds of data:

- *Speed*, of all dimensions together, smoothed and relative to its peak, where motions are compared
  or cut out: `AT_REST`, `MOVING`, `LARGEST_END_SPEED`.
- *The step of one dimension* from frame to frame, relative to its largest, where only that
  dimension matters: `RESTING_STEP`, `STILL_MOVING_STEP`.
- *The distance from an end pose*, where a recording has any rate and no frames yet: `STILL_SHARE`,
  `STILL_FLOOR`.

They differ because mistakes cost differently: a frame that is cut away or held as if it rested is
lost (so a low threshold), an onset that is only compared is not.

Notation:
    s   speed            (H,)    relative to the pooled rms of its unit [-]
    b   begins           (N,)    frame at which a cut-out motion begins
    L   cut-out length   frames
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from prior_reinforce.arrays import Frames, Plans
from prior_reinforce.errors import InvalidDemonstrationsError
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
"""A first or last frame that is faster, relative to the peak, is not at rest and cannot be held.
Ours."""
RESTING_STEP = 0.01
"""A dimension rests at an end of a plan if its step there is at most this part of its largest step.
Ours: a plan is then generated at rest there too."""
STILL_MOVING_STEP = 0.05
"""A recording ends in motion if the last step of a dimension is over this part of its largest: five
times `RESTING_STEP`, because it only warns, and of jitter it should not. Ours."""
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
_PADDING = 4
"""Resting frames kept at either end of a cut-out motion, if there are as many: about one control
point, which a spline needs to come to rest."""
_TREMOR_PADDING = 12
"""The same where rest is told from speed: a motion's slow onset is then kept well inside."""
_TREMOR_LOST = 0.01
"""What holding may change of any demonstration, rms: this part of the largest range among the
dimensions of that unit. Ours: the shipped tele-operated sets lose at most 0.008, and land within
5 mm of where they did."""

Speed = Float[np.ndarray, " H"]
"""How fast one plan moves at each frame, relative to the pooled rms of each unit."""


class CannotShiftError(InvalidDemonstrationsError):
    """Demonstrations cannot be moved in time."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        """Say why.

        Args:
            reason: Which demonstration, and what of it, as a clause.
            remedy: What follows, and what to do.
        """
        self.reason = reason
        super().__init__(reason + remedy)


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


def check_ends_rest(
    speeds: Float[np.ndarray, "N H"],
    held: Bool[np.ndarray, "N 2"],
    largest: float = LARGEST_END_SPEED,
) -> None:
    """Refuse to hold a frame at which a demonstration is still moving.

    Args:
        speeds: Of each demonstration.
        held: Whether its first, and its last, frame is to be held.
        largest: Speed of a frame that may be held, relative to the demonstration's peak.

    Raises:
        CannotShiftError: One moves faster there.
    """
    for i, speed in enumerate(speeds):
        for frame, name, is_held in ((0, "first", held[i, 0]), (-1, "last", held[i, 1])):
            if is_held and speed[frame] > largest * speed.max():
                raise CannotShiftError(
                    f"demonstration {i} still moves at its {name} frame, with "
                    f"{speed[frame] / speed.max():.0%} of its peak speed (at most {largest:.0%} "
                    "counts as rest)",
                    ", so that frame cannot be held while the rest moves in time; record from "
                    "rest to rest, raise largest_end_speed, or do not align",
                )


# --- one dimension ---


def resting_dimensions(plans: Plans) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    """Tell for each dimension whether every plan starts, and whether every plan ends, at rest."""
    steps = np.abs(np.diff(plans, axis=1))
    slow = RESTING_STEP * steps.max(axis=(0, 1))
    start, end = (steps[:, 0] <= slow).all(axis=0), (steps[:, -1] <= slow).all(axis=0)
    return tuple(start.tolist()), tuple(end.tolist())


def ends_in_motion(plan: Frames) -> bool:
    """Tell whether a dimension is still moving at the last frame."""
    steps = np.abs(np.diff(plan, axis=0))
    return bool(np.any(steps[-1] > STILL_MOVING_STEP * np.maximum(steps.max(axis=0), 1e-9)))


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
    largest = {
        unit: max(r for r, u in zip(ranges, units, strict=True) if u == unit) for unit in set(units)
    }
    return np.array([max(STILL_SHARE * largest[u], STILL_FLOOR.get(u, 0.0)) for u in units])


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


# --- moving and holding ---


def shift(
    plans: Plans, later: Shaped[np.ndarray, " n"], length: int, before: int = 0
) -> Float[np.ndarray, "n L D"]:
    """Return plans that many frames later, their ends held.

    Whole numbers of frames change no value; parts are interpolated by monotone cubics: second-order
    accurate at extrema, fourth elsewhere, and a step (a gripper channel) does not overshoot.

    Args:
        plans: Plans.
        later: Frames, of integer type where they are whole.
        length: L, frames that are returned.
        before: How many of these come before the plans' first frame.
    """
    horizon = plans.shape[1]
    frames = np.clip(np.arange(-before, length - before) - later[:, None], 0, horizon - 1)
    if np.issubdtype(later.dtype, np.integer):
        return plans[np.arange(len(plans))[:, None], frames]
    from scipy.interpolate import PchipInterpolator

    clock = np.arange(horizon)
    return np.stack(
        [PchipInterpolator(clock, p, axis=0)(at) for p, at in zip(plans, frames, strict=True)]
    )


@dataclass(frozen=True, eq=False)
class Cut:
    """Where motions are cut out of their resting ends, all of one length."""

    begins: Int[np.ndarray, " N"]
    """b, frame at which each demonstration's cut-out begins."""
    length: int
    """L; outside its cut-out a demonstration holds its ends."""
    before: int
    """Frames of it before the first motion begins."""
    after: int
    """Frames of it after the last motion has ended."""

    def motions(self, plans: Plans) -> Float[np.ndarray, "n L D"]:
        """Cut the motions out; they grow out of their first frame and die down to their last.

        Where ends rest exactly nothing changes; tremor cut in mid-swing would jerk the arm.
        """
        from scipy.special import betainc

        motions = shift(plans, -self.begins, self.length)
        frames = np.arange(self.length)
        rise = betainc(3, 3, np.minimum(1.0, frames / max(1, self.before)))[:, None]
        fall = betainc(3, 3, np.minimum(1.0, frames[::-1] / max(1, self.after)))[:, None]
        first, last = motions[:, :1], motions[:, -1:]
        settled = first + rise * (motions - first)
        return np.asarray(last + fall * (settled - last))


def cut_out(demonstrations: Demonstrations, delays: Int[np.ndarray, " N"]) -> Cut:
    """Find the shortest common cut-out that holds every motion.

    Where hands tremble to the very ends no frame rests exactly; what is slow there is then held.

    Args:
        demonstrations: N of them.
        delays: How many frames later than the others each one's motion comes.

    Raises:
        CannotShiftError: The longest motion with the latest start would not end within the plan, or
            a demonstration moves where it would have to be held.
    """
    plans, horizon = demonstrations.plans, demonstrations.horizon
    moving = [np.flatnonzero(np.any(plan[1:] != plan[:-1], axis=1)) for plan in plans]
    with suppress(CannotShiftError):
        return _window(moving, delays, horizon, _PADDING)
    moving = [np.flatnonzero(speed > MOVING * speed.max()) for speed in speeds(demonstrations)]
    cut = _window(moving, delays, horizon, _TREMOR_PADDING)
    _check_tremor(cut, demonstrations)
    return cut


def _window(
    moving: list[Int[np.ndarray, " _"]], delays: Int[np.ndarray, " N"], horizon: int, padding: int
) -> Cut:
    """The shortest common cut-out, if it fits into the plan at any demonstrated start.

    A slower motion may be generated with a later start than any demonstrated pair of the two: the
    cut-out has to lie within the plan at every start, so that no rest is ever cut off.
    """
    some = [i for i, frames in enumerate(moving) if frames.size]
    firsts = {i: int(moving[i][0] - delays[i]) for i in some}
    lasts = {i: int(moving[i][-1]) + 1 - int(delays[i]) for i in some}
    first, last = min(firsts.values()), max(lasts.values())
    before = min(padding, int(delays.min()) + first)
    after = min(padding, horizon - 1 - int(delays.max()) - last)
    if before < 0:
        raise CannotShiftError(
            f"demonstration {min(firsts, key=firsts.__getitem__)}'s motion, begun as early as "
            f"demonstration {int(delays.argmin())}'s, would begin {-before} frames before the plan"
        )
    if after < 0:
        raise CannotShiftError(
            f"demonstration {max(lasts, key=lasts.__getitem__)}'s motion, begun as late as "
            f"demonstration {int(delays.argmax())}'s, would end {-after} frames after the plan"
        )
    return Cut(delays + first - before, last - first + 1 + before + after, before, after)


def _check_tremor(cut: Cut, demonstrations: Demonstrations) -> None:
    """Refuse to hold ends that do not tremble but move."""
    plans, plan_format = demonstrations.plans, demonstrations.format
    back = shift(cut.motions(plans), cut.begins, demonstrations.horizon)
    squares = (back - plans) ** 2
    ranges, units = np.ptp(plans, axis=(0, 1)), np.array(plan_format.units)
    largest = np.array([ranges[units == unit].max() for unit in units])
    lost = np.sqrt(np.mean(squares, axis=1))
    if np.all(lost <= _TREMOR_LOST * largest):
        return
    share = lost / np.where(largest > 0, largest, 1.0)
    i, d = np.unravel_index(share.argmax(), share.shape)
    middle = int(cut.begins[i]) + cut.length // 2
    end = "before" if squares[i, :middle, d].sum() > squares[i, middle:, d].sum() else "after"
    raise CannotShiftError(
        f"demonstration {i} does not rest {end} its motion: holding {plan_format.names[d]} still "
        f"there would change it by {share[i, d]:.1%} of the largest range, rms (at most "
        f"{_TREMOR_LOST:.0%} counts as tremor)"
    )
