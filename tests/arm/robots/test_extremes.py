"""Extremes of splines against dense samples of them."""

import numpy as np
import pytest

from prior_reinforce.arm.robots.extremes import (
    accelerations,
    jerks,
    speeds,
    turns,
    with_cycles,
)
from prior_reinforce.plans.interpolation import join_frames


@pytest.mark.parametrize(("dt", "frames"), [(0.001, 2), (0.0033, 9), (0.02, 12), (1 / 30, 40)])
def test_nothing_between_is_larger_than_the_extremes(dt, frames):
    plan = np.random.default_rng(frames).normal(size=(frames, 3))
    spline = join_frames(plan, dt)
    end, step = spline.x[-1], dt / 2000
    t = np.linspace(-0.02, end + 0.02, round((end + 0.04) / step) + 1)
    inside = ((t >= 0) & (t <= end))[:, None]
    q, ddq = spline(np.clip(t, 0, end)), spline(np.clip(t, 0, end), 2) * inside
    at = turns(spline)
    for order in (0, 1):
        dense = np.abs(spline(np.clip(t, 0, end), order)).max(axis=0)
        assert np.all(np.abs(spline(at, order)).max(axis=0) >= dense * (1 - 1e-12))
    assert accelerations(spline)[1].max(axis=0) == pytest.approx(np.abs(ddq).max(axis=0), rel=0.01)
    for window, largest, of in ((0.001, jerks(spline), ddq), (0.01, speeds(spline, 0.01), q)):
        early = np.stack([np.interp(t, t, column) for column in of.T])
        late = np.stack([np.interp(t + window, t, column) for column in of.T])
        dense = np.abs(late - early).max(axis=1) / window
        assert np.all(largest[1].max(axis=0) >= dense * (1 - 2e-2))
        assert np.all(largest[1].max(axis=0) <= dense * (1 + 2e-2))


def test_every_millisecond_is_looked_at_where_bounds_change_with_the_position():
    spline = join_frames(np.array([[0.0], [1.0]]), 0.0105)
    assert {*np.arange(11) / 1000} <= {*with_cycles(spline)}
    assert turns(spline).tolist() == [0, 0.00525, 0.0105]
