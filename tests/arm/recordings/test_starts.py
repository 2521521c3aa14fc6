"""Takes that start elsewhere, go the other way or go back are named; others are not."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.starts import all_return, odd_starts, ways_back

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
