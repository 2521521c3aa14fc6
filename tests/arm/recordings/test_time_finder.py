"""Which columns or arrays are the times: by their names, by how they rise, or by a known rate."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.time_finder import (
    FRAME,
    counts_down,
    find_times,
    is_clock,
    other_times,
    skips_frames,
    tells_time,
)
from prior_reinforce.errors import FileFormatError

T = np.arange(101) * 0.05
SKIPS = np.append(np.arange(100.0), 120)


def places(**columns):
    return dict(enumerate(columns.items()))


@pytest.mark.parametrize(
    ("name", "values", "clock"),
    [
        ("x", 5 + T, True),
        ("x", 1e9 * T, True),
        ("x", 1.1 * T, False),
        ("x", T**2, False),
        ("x", np.arange(101.0), True),
        ("frame", np.cumsum(1.0 + np.arange(101) % 3), True),
        ("x", 2.0 * np.arange(101), False),
    ],
)
def test_a_clock_runs_with_the_times_and_a_rail_does_not(name, values, clock):
    assert is_clock(name, values, T) == clock


def test_counters_that_skip():
    assert skips_frames(np.array([7.0, 8, 9, 21, 22]))
    assert skips_frames(np.array([2.0, 4, 6, 12, 14]))
    for other in ([1.0, 2, 3, 4], [1, 1, 2, 9], [0.5, 1.5, 2.5, 9.5], [1, 5, 7, 8, 20]):
        assert not skips_frames(np.array(other))


def test_what_counts_down_falls_and_is_called_a_time():
    left = 2.0 - np.arange(200) / 100
    assert counts_down("time_to_release", left)
    assert not counts_down("fall", left)
    assert not counts_down("t", -left)


@pytest.mark.parametrize("rate", [200, 1000])
def test_nanoseconds_since_2000_are_no_ticks(rate):
    assert not tells_time("n", 641_000_000_000_000_000 + np.arange(rate) * (10**9 // rate))


@pytest.mark.parametrize(
    ("columns", "called", "found", "held"),
    [
        ({"q": T, "wall_time": T}, (), (1,), ()),
        ({"wall_time": T, "t": T}, (1,), (1,), (0,)),
        ({"t": T, "jumps_time": T + (T > 2)}, (), (0,), (1,)),
        ({"q": np.sin(T), "stamp": np.cumsum(T + 0.01)}, (), (1,), ()),
        ({"q": T, "time_left": -T}, (), (1,), ()),
        ({"frame": SKIPS, "t": T}, (), (1,), (0,)),
        ({"q": T}, (), (), ()),
    ],
)
def test_times_are_found_by_name_and_others_are_held_against_them(columns, called, found, held):
    times = find_times("a", places(**columns), called)
    assert (times.columns, times.held, times.summed) == (found, held, False)


def test_periods_are_summed_where_nothing_is_called_a_time():
    found = find_times("a", places(q=T, dt_ms=20 + np.sin(T)), ())
    assert (found.columns, found.summed) == ((1,), True)


def test_times_of_one_name_that_differ_are_refused():
    columns = {0: ("Time", T), 1: ("Time.1", T + 1)}
    with pytest.raises(FileFormatError, match=r"two columns Time that differ.*numpy\.interp"):
        find_times("a", columns, (0, 1))


def test_what_rises_is_asked_about_or_held_against_a_rate():
    columns = places(q=np.sin(T), n=np.arange(101.0), up=1.5 * T, frame=SKIPS)
    (doubt,) = other_times("a", places(q=np.sin(T), up=T), None, in_arrays=False).guessed
    assert doubt.option == "--time-column up"
    assert not doubt.guessed
    for in_arrays in (True, False):
        found = other_times("a", columns, 20.0, in_arrays=in_arrays)
        assert (found.columns, found.unit) == ((3,), FRAME)
    del columns[3]
    assert other_times("a", columns, 20.0, in_arrays=False).columns == (2,)


def test_of_arrays_only_one_that_runs_as_the_rate_says_is_held_against_it():
    columns = places(q=np.sin(T), up=1.5 * T)
    assert other_times("a", columns, 20.0, in_arrays=True).columns == ()
    assert other_times("a", columns, 15.0, in_arrays=True).columns == (1,)
    assert other_times("a", columns, None, in_arrays=True).columns == (1,)
    assert other_times("a", places(up=T, down=2 * T), None, in_arrays=True).columns == ()
    assert other_times("a", places(frame=2 * T), None, in_arrays=True).columns == ()


def test_what_is_called_a_time_and_rises_unevenly_is_asked_about():
    uneven = np.append(T, T[-1] + 3.0)
    (doubt,) = find_times("a", places(time_in_contact=uneven), ()).guessed
    assert (doubt.option, doubt.guessed) == ("--time-column time_in_contact", False)
    assert find_times("a", places(time_in_contact=T), ()).guessed == ()
    assert find_times("a", places(time_in_contact=uneven), (0,)).guessed == ()
