"""Where a spline, which is what the arm gets, is farthest, fastest and roughest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.robots.report import Samples, Times
from prior_reinforce.plans.interpolation import RATE

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_JUST = 1e-12
"""Just before and just after an instant, in [s]."""


def turns(spline: CubicSpline) -> Times:
    """The frames, and where q or dq/dt turns: between two of these, both only rise or only fall."""
    a, b, c = spline.c[:3]
    with np.errstate(all="ignore"):  # nan where the velocity 3 a u^2 + 2 b u + c has no root
        w = -(b + np.copysign(np.sqrt(b * b - 3 * a * c), b))
        u = np.stack([w / (3 * a), c / w, -b / (3 * a)])
    inside = (u > 0) & (u < np.diff(spline.x)[:, None])
    return np.unique(np.append(spline.x, spline.x[:-1, None] + np.where(inside, u, 0.0)))


def with_cycles(spline: CubicSpline) -> Times:
    """`turns` and every millisecond, for bounds that change with the position."""
    cycles = np.arange(math.ceil(spline.x[-1] * RATE)) / RATE
    return np.union1d(turns(spline), cycles)


def accelerations(spline: CubicSpline) -> tuple[Times, Samples]:
    """Sizes at the frames, between which acceleration is linear."""
    return spline.x, np.abs(spline(spline.x, 2))


def jerks(spline: CubicSpline) -> tuple[Times, Samples]:
    """How much the acceleration differs over a millisecond, wherever that begins, a second.

    It is largest where the millisecond begins or ends with a frame. Before the first frame and
    after the last there is none, so that the steps where the holds meet the motion count, on either
    side of each step: a stream may have a set point on it.
    """
    end, cycle = float(spline.x[-1]), 1 / RATE
    begin = np.concatenate([spline.x - cycle, spline.x])

    def accelerations_around(t: Times) -> Float[np.ndarray, "2 T d"]:
        both = np.stack([t - _JUST, t + _JUST])
        inside = (both >= 0) & (both <= end)
        return np.asarray(spline(np.clip(both, 0, end), 2) * inside[..., None])

    early, late = accelerations_around(begin), accelerations_around(begin + cycle)
    rise, fall = late.max(axis=0) - early.min(axis=0), early.max(axis=0) - late.min(axis=0)
    return np.clip(begin + cycle, 0, end), np.maximum(rise, fall) * RATE


def speeds(spline: CubicSpline, window: float) -> tuple[Times, Samples]:
    """Sizes of the mean velocity over a window, in [s], wherever that begins, holds included.

    Windows that begin or end with a turn are looked at, and those around one.
    """
    t, end = turns(spline), float(spline.x[-1])
    begin = np.unique(np.concatenate([t, t - window, t - window / 2]))
    early, late = (spline(np.clip(at, 0, end)) for at in (begin, begin + window))
    return np.clip(begin + window / 2, 0, end), np.abs(late - early) / window
