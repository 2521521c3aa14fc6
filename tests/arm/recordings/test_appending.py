"""Recordings of another day, in the turns, signs and units of another day."""

import warnings

import numpy as np
import pytest

from prior_reinforce.arm.recordings.appending import appended, check_scale
from prior_reinforce.arm.recordings.inspection import Wanted, inspect
from prior_reinforce.arm.recordings.preprocessing import Preprocessing
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.whole_turns import attitudes

T = np.arange(61) / 60
S = 10 * T**3 - 15 * T**4 + 6 * T**5
UR = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
N = 3


def demonstrations(names, unit, motion, first=0):
    """Three of what `motion(i)` returns."""
    plans = np.array([motion(i) for i in range(first, first + N)], dtype=float)
    units = (unit,) * len(names) if isinstance(unit, str) else tuple(unit)
    form = PlanFormat(names, units, 0.02, attitudes=attitudes(names) if unit == "1" else ())
    outcomes = [[0.8 + 0.05 * i, 0.1 * (-1) ** i] for i in range(first, first + N)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Demonstrations(plans, np.array(outcomes), form)


def selection(names, unit, motion):
    """Three more of them, as recorded."""
    units = (unit,) * len(names) if isinstance(unit, str) else tuple(unit)
    times = 0.02 * np.arange(len(T))
    takes = [Recording(f"new {i}", times, motion(i), names) for i in range(N, 2 * N)]
    return Selection(tuple(takes), tuple(names), units, units)


def joined(before, more, robot=None):
    how = Preprocessing(0.02, trim=False)
    found = inspect(more, Wanted(preprocessing=how, robot=robot, before=before))
    form = before.format
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        new = Demonstrations(found.processed.plans, before.outcomes_seen + 0.3, form)
    assert found.format == form
    return appended(before, new, more.episodes), found


def alignments(found):
    """What was done to the new ones, without what is only said of their starts."""
    return [said for said in found.selection.remarks if " starts at " not in said]


def quaternion(i):
    half = (1.3 + (0.2 + 0.03 * i) * S[:, None]) / 2
    return np.hstack([np.sin(half) * [0.6, 0.64, 0.48], np.cos(half)])


def kuka(i):
    return np.array([0.2, 1.5, 0.3]) + S[:, None] * [0.1, -0.2 - 0.03 * i, 0.05]


def other_kuka(angles):
    return angles * [1, -1, 1] + [-np.pi, np.pi, np.pi]


def yaw(i):
    return np.array([2.7 + (i >= N) + (0.3 + 0.05 * i) * S]).T


def arm(i):
    return np.array([0.2, -1.6, 1.6, -1.2, -1.5, 3.0]) + S[:, None] * (0.3 + 0.05 * i)


@pytest.mark.parametrize(
    ("names", "unit", "motion", "otherwise", "robot"),
    [
        (("qx", "qy", "qz", "qw"), "1", quaternion, np.negative, None),
        (("a", "b", "c"), "rad", kuka, other_kuka, None),
        (("yaw",), "rad", yaw, lambda y: y - 2 * np.pi, None),
        (UR, "rad", arm, lambda q: q - 2 * np.pi * (np.arange(6) == 5), "ur5e"),
    ],
)
def test_new_ones_are_aligned_with_those_in_use(names, unit, motion, otherwise, robot):
    limits = None if robot is None else robot_limits(robot)
    before = demonstrations(names, unit, motion)
    both, found = joined(before, selection(names, unit, lambda i: otherwise(motion(i))), limits)
    remarks = alignments(found)
    assert remarks
    assert all(said.startswith("new 3, new 4, new 5: ") for said in remarks)
    np.testing.assert_array_equal(both.plans[:N], before.plans)
    np.testing.assert_allclose(both.plans, [motion(i) for i in range(2 * N)], atol=1e-12)
    if robot is not None:  # the gate sees them as they are taken in
        assert not any(report.refused for report in found.reports)
    assert not alignments(joined(before, selection(names, unit, motion), limits)[1])


def gap(i, low, high, scale=1.0):
    return np.column_stack([0.1 + (0.5 + 0.05 * i) * S, scale * (low + (high - low) * S)])


@pytest.mark.parametrize(
    ("unit", "low", "high", "factor"),
    [
        ("m", 0.002, 0.0045, 1000),
        ("m", 0.0, 0.05, 1000),
        ("m", 0.3, 0.4, 0.01),
        ("m", 0.2, 0.3, 10),
        ("rad", 0.02, 0.1, 180 / np.pi),
        ("rad", 1.1, -0.4, np.pi / 180),
    ],
)
def test_a_channel_in_another_unit_is_refused(unit, low, high, factor):
    names, units = ("j1", "gap"), ("rad", unit)
    before = demonstrations(names, units, lambda i: gap(i, low, high))
    more = selection(names, units, lambda i: gap(i, low, high, factor))
    new = [f"{factor * number:.4g}" for number in (low, high)]
    said = rf"gap goes from {new[0]} to {new[1]} {unit} in the new .* from {low:g} to {high:g} in"
    with pytest.raises(InvalidDemonstrationsError, match=f"{said} .* \\(--units\\)"):
        check_scale(before, more)


@pytest.mark.parametrize(
    ("unit", "ends", "later"),
    [
        ("m", (0.0, 0.06), (0.0, 0.6)),
        ("rad", (0.0, 0.004), (0.0, 0.23)),
        ("rad", (0.3, 0.31), (0.3, 0.9)),
        ("percent", (0.0, 100.0), (0.0, 60.0)),
        ("m", (0.0, 0.0), (0.0, 0.4)),
    ],
)
def test_a_channel_that_goes_further_is_taken(unit, ends, later):
    names, units = ("j1", "gap"), ("rad", unit)
    before = demonstrations(names, units, lambda i: gap(i, *ends))
    assert joined(before, selection(names, units, lambda i: gap(i, *later)))[0].n == 2 * N


def test_a_base_that_was_turned_and_stands_still_is_in_no_other_unit():
    def thrown(i, pan):
        return np.column_stack([np.full(len(S), pan), 0.2 + (0.5 + 0.05 * i) * S])

    names = ("pan", "elbow")
    before = demonstrations(names, "rad", lambda i: thrown(i, 0.02))
    assert joined(before, selection(names, "rad", lambda i: thrown(i, 1.2)))[0].n == 2 * N


@pytest.mark.parametrize("noise", [0.0, 0.004])
def test_a_throw_that_is_there_smoothed_or_cut_elsewhere_is_not_appended(noise):
    def motion(i, shift=0.0):
        s = np.interp(T + shift, T, S)
        return np.outer(s, [0.5 + 0.1 * i, -1.0, 0.3])

    names, rng = ("pan", "lift", "elbow"), np.random.default_rng(0)
    before = demonstrations(names, "rad", motion)
    again = demonstrations(
        names, "rad", lambda i: motion(i, 2 / 60) + noise * rng.normal(size=(len(T), 3)), first=1
    )
    with pytest.raises(InvalidDemonstrationsError, match=r"^a, b landed .*--leave-out a b;"):
        appended(before, again, ["a", "b", "c"])
    every = demonstrations(names, "rad", lambda i: motion(i) + 1e-5)
    with pytest.raises(InvalidDemonstrationsError, match=r"nothing to append; .* without --append"):
        appended(before, every, [f"n{i}" for i in range(N)])
    others = demonstrations(names, "rad", motion, first=N)
    assert appended(before, others, ["a", "b", "c"]).n == 2 * N
    other = demonstrations(names, "rad", lambda i: motion(i) * [1, 1, -1])
    with pytest.warns(UserWarning, match="have the same outcome"):  # by another motion
        assert appended(before, other, ["a", "b", "c"]).n == 2 * N
