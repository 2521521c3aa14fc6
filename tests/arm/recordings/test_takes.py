"""Takes in another unit than the others are named, and none is converted by what others state."""

import math
from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.arm.recordings.takes import (
    all_return,
    ambiguities_of_times,
    ask_about_increments,
    odd_starts,
    pauses,
    ways_back,
)
from prior_reinforce.arm.recordings.units import Ambiguity
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from tests.arm.recordings.recorded import takes

ARM = ("shoulder", "elbow", "wrist")
RAD = np.array([0.4, -1.6, 0.1])


@pytest.mark.parametrize("robot", [None, ["rad"] * 3])
def test_one_take_in_degrees_is_named_and_not_taken_for_all(robot):
    some = takes(ARM, RAD, RAD * 1.1, RAD * 180 / np.pi, RAD * 0.9)
    (asked,) = select(some, plan_units=robot).ambiguities
    assert "elbow of t2 reaches 91.67, and of the others 1.76 at most" in asked.what
    assert asked.option == "--leave-out t2"
    assert "elbow of t2 reaches" in select(some, plan_units=robot, units=["deg"]).remarks[0]
    assert not select([r for r in some if r.episode != "t2"], plan_units=robot).ambiguities


def test_one_take_in_radians_among_degrees_is_named_beside_the_unit_of_the_rest():
    some = takes(ARM, RAD, *[RAD * 180 / np.pi * k for k in (1, 1.1, 0.9)])
    options = [one.option for one in select(some).ambiguities]
    assert options == ["--leave-out t0", "--units deg"]


def test_a_gripper_in_percent_in_one_take_only_is_named():
    some = takes(("elbow", "gripper"), (1, 0.8), (1, 0.9), (1, 80))
    (asked,) = select(some).ambiguities
    assert asked.option == "--leave-out t2"


def test_takes_that_are_smaller_by_far_less_than_a_unit_are_no_question():
    assert not select(takes(ARM, RAD, RAD / 5, RAD * 2)).ambiguities
    options = [one.option for one in select(takes(ARM, RAD * 50, RAD * 4, RAD * 60)).ambiguities]
    assert options == ["--units deg"]


def test_each_file_is_converted_by_the_unit_that_it_states():
    some = takes(("j1", "lift"), (1, 200), (1, 210), (1, 0.2),
                 units=[(None, "mm"), (None, "mm"), (None, "m")])  # fmt: skip
    found = select(some)
    assert not found.ambiguities
    assert [r.positions[-1, 1] for r in found.recordings] == pytest.approx([0.2, 0.21, 0.2])
    assert found.remarks == (
        "lift is in mm in t0 to t1, in m in t2, as they state: each is converted",
    )
    with pytest.raises(InvalidDemonstrationsError, match="lift is in mm in t0, but in deg in t1"):
        select(takes(("j", "lift"), (1, 9), (1, 9), units=[(None, "mm"), (None, "deg")]))


def test_a_file_that_states_no_unit_where_others_do_is_asked_about():
    some = takes(("j1", "lift"), (1, 200), (1, 210), (1, 0.2),
                 units=[(None, "mm"), (None, "mm"), (None, None)])  # fmt: skip
    (asked,) = select(some).ambiguities
    assert "lift is in mm in t0 to t1 (up to 210), and t2 states no unit (up to 0.2)" in asked.what
    assert asked.option == "--leave-out t2"
    assert "lift of t2 reaches 0.2" in select(some, units=["rad", "mm"]).remarks[0]


def test_takes_whose_times_are_in_another_unit_are_named_if_they_are_the_fewer():
    some = [replace_clock(take, i == 1) for i, take in enumerate(takes(ARM, RAD, RAD, RAD))]
    (asked,) = ambiguities_of_times(some)
    assert asked.what.startswith("t1: would take 1000 s, but t0, t2 would not be in that unit")
    assert (asked.option, asked.guessed) == ("--leave-out t1", False)
    assert ambiguities_of_times(some[1:2]) == list(some[1].ambiguities)


def replace_clock(take, doubtful):
    """The take, with times that may be in [ms]."""
    doubts = (Ambiguity("would take 1000 s", "--time-unit ms"),) * doubtful
    return replace(take, ambiguities=doubts)


def test_a_word_that_is_no_unit_is_what_somebody_says_it_is():
    """Grad, which is a degree in German and a gradian elsewhere."""
    told = takes(("pan",), [30.0], units=[("Grad",)])
    assert select(told, units=["deg"]).recorded_units == ("deg",)
    with pytest.raises(ConfigurationError, match="is in deg, but --units says rad"):
        select(takes(("pan",), [30.0], units=[("deg",)]), units=["rad"])


def test_a_unit_that_is_listed_nowhere_is_not_taken_for_another_such_one():
    with pytest.raises(ConfigurationError, match="is in bar, but --units says psi"):
        select(takes(("valve",), [3.0], units=[("bar",)]), units=["psi"])
    (remark,) = select(takes(("pan",), [30.0], units=[("Grad",)]), units=["deg"]).remarks
    assert "pan recorded in Grad in t0, taken for deg" in remark


@pytest.mark.parametrize(
    ("recorded", "wanted", "said", "scale"),
    [("m", "percent", "1250 percent", 1250), ("mdeg", "rad", "0.001 deg", math.pi / 180_000)],
)
def test_what_one_of_a_unit_is_may_be_said(recorded, wanted, said, scale):
    """A gripper's metres in percent, or a word: the refusal names such an option."""
    told, plan = takes(("j1", "gripper"), [0.3, 0.08], units=[(None, recorded)]), ("rad", wanted)
    with pytest.raises(ConfigurationError, match=f"in {recorded}, but .* --units .*'{said}'"):
        select(told, plan_units=plan)
    found = select(told, units=["rad", said], plan_units=plan)
    assert found.recordings[0].positions[-1, 1] == pytest.approx(0.08 * scale)
    assert f"recorded in {recorded} in t0, taken for {said}" in " ".join(found.remarks)


def test_joints_in_one_unknown_word_are_one_remark():
    told = takes(("j1", "j2", "j3"), [30.0, 20.0, 40.0], units=[("Grad",) * 3])
    (remark,) = select(told, units=["deg"]).remarks
    assert remark.startswith("j1 to j3 recorded in Grad in t0, taken for deg")
    with pytest.raises(ConfigurationError, match=r"in Grad, but .* --units deg"):
        select(told, plan_units=("rad",) * 3)


T = np.linspace(0, 1, 40)
S = 10 * T**3 - 15 * T**4 + 6 * T**5
NAMES, UNITS = ("elbow", "gripper"), ("rad", "percent")
TAKES = ("a", "b", "c", "d", "e", "f")


def take(i, elbow=0.0, inverted=False):
    gripper = 10 + 75 * S
    return np.column_stack([1.6 + elbow - (0.5 + 0.05 * i) * S,
                            100 - gripper if inverted else gripper])  # fmt: skip


def said(motions, before=()):
    return [*odd_starts(before, motions, TAKES[: len(motions)], NAMES, UNITS)]


def test_a_zero_that_was_moved_is_named_with_its_takes():
    (remark,) = said([take(i, -1.57 * (i in (1, 4))) for i in range(6)])
    assert remark.startswith("elbow starts at 0.03 rad in b, e, and at 1.6 rad in the others:")


def test_a_gripper_that_counts_the_other_way_is_named():
    (remark,) = said([take(i, inverted=i > 2) for i in range(6)])
    assert "gripper starts at 10 percent in a, b, c, and at 90 percent" in remark
    assert "goes the other way" in remark


def test_more_takes_are_held_against_those_so_far():
    before = [take(i) for i in range(3)]
    (remark,) = said([take(i, -1.57) for i in range(3, 6)], before)
    assert remark.startswith("elbow starts at 0.03 rad in a, b, c, and at 1.6 rad in the others")
    assert said([take(i) for i in range(3, 6)], before) == []


@pytest.mark.parametrize("apart", [0.0, 0.05, 0.3, 0.9])
def test_starts_that_differ_by_about_a_motion_are_none(apart):
    assert said([take(i, apart * (i % 2)) for i in range(6)]) == []
    assert said([take(0)]) == []


def recordings(*motions):
    return [Recording(name, T, q, NAMES) for name, q in zip(TAKES, motions, strict=False)]


def test_ways_back_are_named_and_motions_that_return_by_themselves_are_none():
    there = [take(0), take(0)[::-1], take(1), take(1)[::-1]]
    assert ways_back(recordings(*there)).endswith("--leave-out b d")
    assert ways_back(recordings(*(take(i) for i in range(6)))) == ""
    closed = [np.vstack([take(i)[::2], take(i)[::-2]]) for i in range(6)]
    assert ways_back(recordings(*closed)) == ""


@pytest.mark.parametrize(("short", "said"), [(0.0, True), (0.08, True), (0.2, False)])
def test_motions_that_all_end_where_they_began_may_hold_a_way_back(short, said):
    there = np.array([take(i) for i in range(3)])
    back = there[:, ::-1] + short * (there[:, -1:] - there[:, :1])
    found = all_return(np.concatenate([there, back], axis=1))
    assert found.startswith("every motion ends where it began") == said
    assert ("(--rests 0.3)" in found) == said
    assert all_return(there) == ""


def test_what_stands_still_may_stand_anywhere():
    still = [np.column_stack([np.full(40, 1.5 * (-1) ** i), 10 + 75 * S]) for i in range(6)]
    assert said(still) == []
    noise = np.random.default_rng(0).normal(0, 1e-4, (6, 40))
    near = [np.column_stack([1.5 + 0.01 * (i % 2) + n, 10 + 75 * S]) for i, n in enumerate(noise)]
    assert said(near) == []


SO101 = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


@pytest.mark.parametrize(
    ("key", "names", "told"),
    [
        ("actions", ("x", "y", "z", "roll", "pitch", "yaw", "gripper"), True),
        ("action", ("x", "y", "z"), True),
        ("qpos", ("x", "y", "z"), False),
        ("action", ("dx", "dy", "dz"), False),
        ("action", tuple(f"action.{motor}.pos" for motor in SO101), False),
        ("action", tuple(f"action.m{i}.pos" for i in range(6)), False),
        ("actions", tuple(f"joint{i}" for i in range(7)), False),
        ("actions", tuple(f"action_{i}" for i in range(7)), True),
    ],
)
def test_actions_that_are_0_at_both_ends_may_be_increments(key, names, told):
    steps = np.diff(S, append=S[-1])[:, None] * np.linspace(1, 0.5, len(names))
    steps[:, 6:] = S[:, None] > 0.5
    some = [Recording(f"t{i}", np.arange(len(S)) / 20, steps, names) for i in range(2)]
    asked = ask_about_increments(some, [key])
    assert [one.option for one in asked] == [f"--joints {' '.join(names)}"] * told
    assert all("--action-names dx dy dz" in one.what for one in asked)
    poses = [Recording("t", np.arange(len(S)) / 20, S[:, None] * np.ones(3), ("x", "y", "z"))]
    assert ask_about_increments(poses, [key]) == ()


@pytest.mark.parametrize(
    ("rest", "size", "told"), [(0.6, 1.0, True), (0.6, 0.1, False), (0.1, 1.0, False)]
)
def test_an_approach_before_every_throw_is_named_with_what_cuts_it_off(rest, size, told):
    """An approach, a rest in [s], and a throw, a small one of which may be a bump."""

    def takes_of(rests):
        courses = [np.concatenate([S - 1, np.zeros(round(50 * rest)), size * S]) for rest in rests]
        swings = [course[:, None] * [0.3, 0.4, -0.2] for course in courses]
        return [Recording(f"t{i}", np.arange(len(q)) / 50, q, ARM) for i, q in enumerate(swings)]

    said = "".join(pauses(takes_of([rest] * 3)))
    assert ("--rests 0.5 --leave-out t0-0 t1-0 t2-0" in said) == told
    assert not [*pauses(takes_of([rest, rest, 0]))]


def test_a_throw_before_a_retreat_is_named_by_its_speed():
    """A wind-up, a rest, a throw of half the time, a rest, and a way to another pose."""
    rest = np.zeros(40)
    course = np.concatenate([-0.4 * S, rest - 0.4, 1.4 * S[::2] - 0.4, rest + 1, 1 - 0.6 * S])
    some = [
        Recording(
            f"t{i}", 9 + np.arange(len(course)) / 50, k * course[:, None] * [0.3, 0.4, 0], ARM
        )
        for i, k in enumerate((1.0, 1.1))
    ]
    (told,) = pauses(some)
    assert "(t0-1, t1-1)" in told
    assert "--rests 0.5 --leave-out t0-0 t0-2 t1-0 t1-2 (" in told
