"""What kind of signal each channel of a plan is: the one place that decides it.

A plan is rarely all smooth joint paths. A base is turned and then held, a gripper opens within six
frames, a valve is on or off. Each kind is timed, coded and interpolated in its own way:

- `held`: one number a plan; what changes within a plan is noise.
- `switch`: takes a few values only, and jumps between them.
- `step`: rests, but for short transitions: a gripper that opens.
- `smooth`: everything else.

Notation:
    A      plans               (N, H, D)  in their units
    sigma  noise of a channel  (D,)       in its unit
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans

ChannelKind = Literal["held", "switch", "step", "smooth"]

HELD = 1e-4
"""A channel is held if it leaves its mean by at most this, rms, in rad or m (in other units: this
part of the largest range of that unit). Ours: what a plan may be off by and still count as come
back as recorded, and five times the encoder noise of a Panda's held joint (2e-5 rad)."""
MOST_LEVELS = 4
"""A channel that takes no more values than these is a switch. Ours."""
_STEP_SHARE = 0.25
"""A step's transitions last at most this part of the longest motion of any channel. Ours: a gripper
opens within six frames of a throw of 40, and joints that move together last about as long as each
other."""
_ACTIVE = 0.03
"""A frame takes part in a transition if it changes by over this part of the channel's largest
change. Ours."""
_FEWEST_FRAMES = 20
"""Fewer frames show motion, and not its noise. Ours."""
_QUANTILE, _NORMAL = 0.3, 0.385
"""Noise is read off the 30 % quietest third differences: 0.385 standard deviations of a normal
variable, in absolute value, lie below its 30 % quantile."""


def noise(plans: Plans) -> Float[np.ndarray, " D"]:
    """Estimate each channel's measuring noise, as a standard deviation in its unit.

    Third differences of a motion that rests for a third of its time are noise there; of white noise
    they have 20 times its variance. An upper estimate where nothing rests.

    Args:
        plans: A; from less than 20 frames no noise is told.

    Source: ours, after the difference-based estimators of Gasser, Sroka and Jennen-Steinmetz
    (Biometrika 1986).
    """
    if plans.shape[1] < _FEWEST_FRAMES:
        return np.zeros(plans.shape[2])
    third = np.abs(np.diff(plans, n=3, axis=1)).reshape(-1, plans.shape[2])
    return np.asarray(np.quantile(third, _QUANTILE, axis=0) / (_NORMAL * np.sqrt(20.0)))


def largest_of_unit(
    ranges: Float[np.ndarray, " D"], units: Sequence[str]
) -> Float[np.ndarray, " D"]:
    """Return for each channel the largest range of all that share its unit.

    Args:
        ranges: Of the D channels, each in its unit.
        units: Of the D channels.
    """
    of = np.array(units)
    return np.array([ranges[of == unit].max() for unit in of])


def kinds(plans: Plans, units: tuple[str, ...]) -> tuple[ChannelKind, ...]:
    """Tell what kind of signal each channel is, from all demonstrations together.

    Args:
        plans: A.
        units: Of the D channels.
    """
    ranges = np.ptp(plans, axis=(0, 1))
    absolute = np.array([unit in ("rad", "m") for unit in units])
    floors = HELD * np.where(absolute, 1.0, largest_of_unit(ranges, units))
    held = np.all(np.std(plans, axis=1) <= floors, axis=0)
    runs = [[] if held[d] else _all_runs(plans[:, :, d]) for d in range(len(units))]
    longest = max((b - a for each in runs for a, b in each), default=0)
    found: list[ChannelKind] = []
    for d, each in enumerate(runs):
        if held[d]:
            found.append("held")
        elif len(np.unique(plans[:, :, d])) <= MOST_LEVELS:
            found.append("switch")
        elif all(b - a <= _STEP_SHARE * longest for a, b in each):
            found.append("step")
        else:
            found.append("smooth")
    return tuple(found)


def without_noise_where_held(plans: Plans, units: tuple[str, ...]) -> Plans:
    """Return the plans with each channel that is `held` at its mean, one number a plan.

    Args:
        plans: A.
        units: Of the D channels.
    """
    plans = plans.copy()
    for d, kind in enumerate(kinds(plans, units)):
        if kind == "held" and np.any(np.ptp(plans[:, :, d], axis=1)):
            plans[:, :, d] = plans[:, :, d].mean(axis=1, keepdims=True)
    return plans


def transitions(
    values: Float[np.ndarray, "N H"],
) -> Float[np.ndarray, "N M"] | None:
    """Return when a `step` or `switch` changes: the middle of each transition, in frames.

    Args:
        values: One channel of the demonstrations.

    Returns:
        M times of each demonstration, in order; None where demonstrations differ in their number.
    """
    times = []
    for changes in np.abs(np.diff(values, axis=1)):
        runs = _runs(changes > _ACTIVE * max(changes.max(), 1e-300))
        times.append(
            [float(np.average(np.arange(a, b) + 0.5, weights=changes[a:b])) for a, b in runs]
        )
    if len({len(each) for each in times}) != 1:
        return None
    return np.array(times)


def _all_runs(values: Float[np.ndarray, "N H"]) -> list[tuple[int, int]]:
    """Stretches in which one channel changes, of all demonstrations."""
    changes = np.abs(np.diff(values, axis=1))
    return [run for row in changes > _ACTIVE * changes.max() for run in _runs(row)]


def _runs(active: np.ndarray) -> list[tuple[int, int]]:
    """Begin and end of each stretch of active frames; single quiet frames do not part them."""
    frames = np.flatnonzero(active)
    if not frames.size:
        return []
    gaps = np.flatnonzero(np.diff(frames) > 2)
    begins = frames[np.r_[0, gaps + 1]]
    ends = frames[np.r_[gaps, len(frames) - 1]] + 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
