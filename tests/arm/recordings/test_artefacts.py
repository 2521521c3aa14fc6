"""Numbers that no arm makes are refused or remarked; what an arm or a gripper may do is not."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.artefacts import refuse_leaps
from prior_reinforce.arm.recordings.preprocessing import Preprocessing, preprocess
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.plan_format import PlanFormat
from tests.arm.recordings.recorded import JOINTS, sampled


def course(rate):
    t = np.arange(2 * rate) / rate
    s = np.clip(t - 0.4, 0, 1)
    return t, 10 * s**3 - 15 * s**4 + 6 * s**5


def check(t, values, unit, name="pan"):
    values = np.column_stack([values])
    names = (name, "p2", "p3")[: values.shape[1]]
    units = (unit,) * len(names)
    refuse_leaps([Recording("7", t, values, names, units=units)], units)


@pytest.mark.parametrize("rate", [20, 100, 500])
@pytest.mark.parametrize(
    ("count", "start", "way"),
    [
        (4096, 3700, 800),
        (4096, 300, -700),
        (65536, 65000, 20000),
        (1024, 1010, 40),
        (360, 300, 200),
    ],
)
def test_a_counter_that_starts_again_is_refused(rate, count, start, way):
    t, s = course(rate)
    said = rf"episode 7: pan leaps from \S+ to \S+ ticks at .*counts to {count} .*--joints"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        check(t, np.round(start + way * s) % count, "ticks")


def test_what_moves_on_after_a_leap_is_refused():
    t, s = course(100)
    with pytest.raises(InvalidDemonstrationsError, match=r"from 0.3\S* to 1.3\S* m at .*before"):
        check(t, 0.3 * s + 0.5 + 1.0 * (t > 0.9) - 0.33, "m", "slide")


def test_two_angles_that_flip_in_one_frame_are_refused():
    t, s = course(100)
    flips = np.pi * (t > 0.8)
    with pytest.raises(
        InvalidDemonstrationsError, match=r"pan leaps .* and p3 leaps .*half a turn"
    ):
        check(t, np.column_stack([0.1 + flips, 0.4 * s, flips - 0.3]), "rad")


@pytest.mark.parametrize("rate", [20, 100, 500])
@pytest.mark.parametrize("shift", [0.16, 0.5, 3600.0])
def test_a_clock_that_leaps_while_the_joints_go_on_is_refused(rate, shift):
    t, s = course(rate)
    said = rf"episode 7: time leaps by {shift:.3f} s.* at frame \d+ .*--time-column none --rate HZ"
    with pytest.raises(InvalidDemonstrationsError, match=said) as refused:
        check(t + shift * (t > 0.86), np.column_stack([s, 0.4 * s]), "rad")
    assert ("an hour" in str(refused.value)) == (shift == 3600)


@pytest.mark.parametrize(("clock", "other"), [("header", "recorder"), ("recorder", "header")])
def test_of_a_bag_whose_clock_was_set_the_other_is_named(clock, other):
    t, s = course(100)
    stamps = {"header": "header stamps in ns", "recorder": "the recorder's stamps in ns"}
    bag = Recording("7", t + (t > 0.86), np.column_stack([s, 0.4 * s]), clock=stamps[clock])
    with pytest.raises(InvalidDemonstrationsError, match=rf"--time-column {other}\)") as refused:
        refuse_leaps([bag], ["rad", "rad"])
    assert "none" not in str(refused.value)


@pytest.mark.parametrize("rate", [20, 100, 500])
def test_frames_that_were_lost_held_or_late_are_no_leap_of_the_clock(rate):
    t, s = course(rate)
    lost = (t < 0.7) | (t > 1.1)
    check(t[lost], s[lost], "rad")
    check(t + 0.5 * (t > 0.4) + 0.5 * (t > 1.4), s, "rad")  # a pause before, and one after
    late = np.where((t > 0.7) & (t < 1.1), 1.09 + (t - 0.7) / 100, t)  # stalled, then all at once
    check(late, s, "rad")
    reaches = np.interp(np.arange(0, 1, 0.02), s[s > 0][:-1], t[s > 0][:-1])  # written at changes
    check(np.append(reaches, 2.0), np.append(np.arange(0, 1, 0.02), 1.0), "rad")
    swings = np.sin(2 * np.pi * t)
    check(t[lost], swings[lost], "rad")


@pytest.mark.parametrize("rate", [10, 20, 100, 500])
@pytest.mark.parametrize("sigma", [0.0, 0.003])
def test_steps_between_rests_and_lost_frames_are_none(rate, sigma):
    t, s = course(rate)
    rng = np.random.default_rng(rate)
    for _ in range(3):
        noise = sigma * rng.normal(size=t.size)
        check(t, (t > 0.9) + noise, "A", "magnet")
        check(t, 0.08 * (t > 0.9) + 0.08 * np.exp(-8 * np.maximum(t - 0.9, 0)) + noise, "m", "lift")
        check(t, np.minimum(s, 0.5) + 0.5 * (t > 0.9) + noise, "m", "lift")
        check(t, s + noise, "rad")
        kept = (t < 0.7) | (t > 1.1)
        check(t[kept], (s + noise)[kept], "rad")
        held = np.floor(t * 5) / 5
        check(t, np.interp(held, t, s) + noise, "rad")
    for i in range(6):
        t, q = sampled(i, rate)
        refuse_leaps([Recording("7", t, q)], ("rad",) * q.shape[1])


def remarks(t, q, names=JOINTS):
    form = PlanFormat(names, ("rad",) * len(names), 1.0)
    return preprocess([Recording("7", t, q, names)], form, Preprocessing()).remarks


def with_stall(t, q, first, frames):
    held = q.copy()
    held[first : first + frames] = q[first]
    return remarks(t, held)


def about(said):
    """Those of remarks that this file is about."""
    return [one for one in said if "a read failed" in one or "in mid-motion" in one]


def in_steps(said):
    return [one for one in said if "they move in steps" in one]


@pytest.mark.parametrize("value", [0.0, -1.5, 7.0])
@pytest.mark.parametrize("sigma", [0.0, 1e-3])
def test_one_frame_of_one_joint_off_its_course_is_remarked(value, sigma):
    t, q = sampled(1, 50)
    q += sigma * np.random.default_rng(0).normal(size=q.shape)
    q[40, 3] = value
    (said,) = about(remarks(t, q))
    values = f"joint4 is {value:.4g} rad in frame 40 alone (0.800 s), between {q[39, 3]:.4g} and "
    assert said.startswith("7: " + values)
    assert said.endswith("write their middle there, or leave that episode out (--leave-out)")
    q[55, 3] = value
    assert len(about(remarks(t, q))) == 2


@pytest.mark.parametrize(("rate", "frames"), [(100, 6), (100, 10), (500, 30), (30, 5)])
def test_one_frame_again_and_again_in_mid_motion_is_remarked(rate, frames):
    t, q = sampled(1, rate)
    first = round(0.7 * rate)
    (said,) = about(with_stall(t, q, first, frames))
    assert said == (
        f"7: nothing recorded in mid-motion for {frames / rate:.3f} s at {t[first]:.2f} s: one "
        "frame again and again"
    )


@pytest.mark.parametrize(("rate", "own"), [(500, 50), (500, 30), (100, 50), (200, 60), (1000, 125)])
def test_poses_that_are_held_on_a_faster_clock_are_remarked(rate, own):
    t, q = sampled(1, rate)
    frame = np.floor(np.arange(len(t)) * own / rate + 1e-9).astype(int)
    held = q[np.unique(frame, return_index=True)[1][frame]]
    (said,) = in_steps(remarks(t, held))
    assert float(said.split()[4]) == pytest.approx(own, rel=0.1)
    assert f"times a second in frames at {rate} Hz, held in between" in said
    new = np.append(True, np.any(np.diff(held, axis=0) != 0, axis=1))
    assert not in_steps(remarks(t[new], held[new]))


@pytest.mark.parametrize("rate", [20, 100, 500])
def test_poses_that_are_rounded_are_not_remarked_as_held(rate):
    t, q = sampled(1, rate)
    for decimals in (1, 2, 3, 4):
        assert not in_steps(remarks(t, np.round(q, decimals)))
        assert not in_steps(remarks(t, np.round(q[:, :1], decimals), JOINTS[:1]))


@pytest.mark.parametrize("rate", [15, 20, 30, 100, 500])
def test_what_an_arm_or_a_recorder_may_do_is_not_remarked(rate):
    t, q = sampled(1, rate)
    rng = np.random.default_rng(rate)
    dwell = np.interp(t, [0, 0.9, 1.2, 3], [0, 0.9, 0.9, 2.7])
    flick = q.copy()
    flick[:, 6] += 0.5 * np.maximum(np.cos(np.pi * np.clip((t - 0.81) / 0.2, -0.5, 0.5)), 0) ** 2
    for motion in (
        q,
        q + 1e-3 * rng.normal(size=q.shape),
        np.round(q, 2),
        np.array([q[np.searchsorted(t, at)] for at in dwell]),
        q[np.arange(len(t)) // 3 * 3],
        flick,
    ):
        assert not about(remarks(t, motion))
    pulse = np.column_stack([q, t == t[len(t) // 2], t > 0.9])
    assert not about(remarks(t, pulse, (*JOINTS, "gripper", "column9")))
    assert not about(remarks(t, pulse, tuple(f"column{i}" for i in range(9))))


def test_a_cusp_no_larger_than_a_step_beside_it_is_not_remarked():
    """An angle about an axis, which turns back at half a turn as the axis turns round."""
    t, q = sampled(1, 100)
    q[:, 3] = np.pi - np.abs(0.005 + 0.03 * (np.arange(len(t)) - 90)) / (1 + 0.01 * t)
    assert not about(remarks(t, q))


def test_a_recording_of_three_frames_is_read():
    t, q = sampled(1, 50)
    remarks(t[:3], np.where(np.arange(3)[:, None] == 1, 1.0, q[:3]))
