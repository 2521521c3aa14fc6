"""Which columns or arrays are the times: by their names, by how they rise, or by a known rate."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.time_finder import (
    counts_down,
    declared_rate,
    find_times,
    guess_times,
    is_clock,
    is_set_back,
    is_set_on,
    looks_like_time,
    skips_frames,
)
from prior_reinforce.arm.recordings.units import FRAME
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
    assert not looks_like_time("n", 641_000_000_000_000_000 + np.arange(rate) * (10**9 // rate))


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
    (doubt,) = guess_times("a", places(q=np.sin(T), up=T), None, in_arrays=False).guessed
    assert doubt.option == "--time-column up"
    assert not doubt.guessed
    for in_arrays in (True, False):
        found = guess_times("a", columns, 20.0, in_arrays=in_arrays)
        assert (found.columns, found.unit) == ((3,), FRAME)
    del columns[3]
    assert guess_times("a", columns, 20.0, in_arrays=False).columns == (2,)


def test_of_arrays_only_one_that_runs_as_the_rate_says_is_held_against_it():
    columns = places(q=np.sin(T), up=1.5 * T)
    assert guess_times("a", columns, 20.0, in_arrays=True).columns == ()
    assert guess_times("a", columns, 15.0, in_arrays=True).columns == (1,)
    assert guess_times("a", columns, None, in_arrays=True).columns == (1,)
    assert guess_times("a", places(up=T, down=2 * T), None, in_arrays=True).columns == ()
    assert guess_times("a", places(frame=2 * T), None, in_arrays=True).columns == ()


@pytest.mark.parametrize(
    ("name", "values", "held"),
    [
        ("recv", 50 + 1.25 * T, True),
        ("host_clk", 1e9 * (5e3 + 2 * T), True),
        ("perf_counter", 33 + 0.5 * T, True),
        ("recv", T + 2.0 * (T > 2), True),  # the same clock, which goes on where frames were lost
        ("unix", 1.7e9 + 5 * T, True),
        ("n", 1.7e15 + 1.25e6 * T, True),
        ("progress", T / 4, False),
        ("belt", 50 + 0.25 * T, False),
        ("belt", 0.1 + 0.8 * T, False),
        ("cycles", 5000 + 10.0 * np.arange(101), False),
        ("swing", 50 + np.cumsum(0.05 * (1 + np.sin(T))), False),
    ],
)
def test_a_clock_of_any_name_is_held_against_the_times(name, values, held):
    found = find_times("a", places(t=T, **{name: values}), (0,), no_motion=True)
    assert found.held == ((1,) if held else ())


@pytest.mark.parametrize("faster", [0.5, 1.1, 1.25, 2.0])
def test_a_clock_of_any_name_is_held_against_a_rate(faster):
    for origin, scale in ((50, 1), (5e12, 1e9)):
        columns = places(q=np.sin(T), perf_counter=origin + scale * faster * T)
        assert guess_times("a", columns, 20.0, in_arrays=True).columns == (1,)
    assert find_times("a", places(unix=1.7e9 + faster * T), ()).columns == (0,)


def test_a_joint_that_rises_evenly_is_no_clock():
    columns = places(t=T, q=2 + 1.25 * T)
    assert find_times("a", columns, (0,)).held == ()


def test_what_is_called_a_time_and_rises_unevenly_is_asked_about():
    uneven = np.append(T, T[-1] + 3.0)
    (doubt,) = find_times("a", places(time_in_contact=uneven), ()).guessed
    assert (doubt.option, doubt.guessed) == ("--time-column time_in_contact", False)
    assert find_times("a", places(time_in_contact=T), ()).guessed == ()
    assert find_times("a", places(time_in_contact=uneven), (0,)).guessed == ()


@pytest.mark.parametrize(("by", "set_back"), [(-0.0495, True), (0.0, False), (0.0495, False)])
def test_a_clock_was_set_back_where_its_order_is_a_longer_way(by, set_back):
    times = np.arange(100) / 100
    motion = np.column_stack([np.sin(3 * times), 1e-6 * np.cos(700 * times)])
    assert is_set_back(times + by * (times > 0.5), motion) is set_back
    late = np.r_[:50, 51, 50, 52:100]  # frames out of order, whose order by time is the shorter way
    assert not is_set_back(times[late], motion[late])


def test_a_clock_was_set_on_by_more_than_periods_and_jitter():
    assert is_set_on(np.array([0.05, 0.2, 2.0]), 0.01).tolist() == [False, True, True]
    assert is_set_on(np.array([0.05, 0.2, 2.0]), 0.1).tolist() == [False, False, True]


def test_of_two_declared_rates_the_given_one_is_taken():
    both = {"dt": 0.02, "fps": 30}
    assert declared_rate("a", both, given=30.0) == (30, "fps")
    assert declared_rate("a", both, given=50.0).name == "dt"


@pytest.mark.parametrize(
    ("said", "rate"),
    [({"fps": 50}, 50), ({"dt_ms": 20, "Frame Rate": 50}, 50), ({"control_freq": 20}, 20),
     ({"sampling_frequency": 125, "mass": 3}, 125), ({"time_step": 0.02}, 50), ({"hz": 30}, 30)],
)  # fmt: skip
def test_rates_that_files_declare(said, rate):
    assert declared_rate("a", said) == (pytest.approx(rate), next(iter(said)))


def test_declared_rates_that_contradict_each_other_or_are_none():
    with pytest.raises(FileFormatError, match="dt says 50 frames a second, but fps 30; take one"):
        declared_rate("a", {"dt": 0.02, "fps": 30})
    assert declared_rate("a", {"mass": 3.0, "generate": 1, "update": 2}) is None


@pytest.mark.parametrize(
    ("stated", "given", "rate"),
    [
        ({"meta.fps": 50}, None, (50, "fps")),
        ({"meta.frame_rate": 50}, None, (50, "frame_rate")),
        ({"meta.timing.dt_ms": 20.0}, None, (50.0, "dt_ms")),
        ({"sample_time_ms": 20.0}, None, (50.0, "sample_time_ms")),
        ({"fps": 50, "cycle_time": 0.002}, None, (50, "fps")),
        ({"meta.fps": 50, "rate": np.array(50.0)}, None, (50.0, "rate")),
        ({"meta.fps": 50, "meta.camera.fps": 30}, None, (50, "fps")),
        ({"meta.fps": 50, "meta.robot.hz": 100}, 50.0, (50, "fps")),
        ({"meta.version": 2}, None, None),
    ],
)
def test_a_rate_deep_in_what_a_file_says_is_its_rate(stated, given, rate):
    assert declared_rate("a.npz", stated, given) == rate


def test_two_rates_that_contradict_each_other_are_refused():
    stated = {"meta.fps": 50, "meta.robot.dt": 0.01}
    with pytest.raises(
        FileFormatError, match=r"meta\.fps says 50 .*, but meta\.robot\.dt 100; .*-r"
    ):
        declared_rate("a.npz", stated)
    with pytest.raises(FileFormatError, match=r"rate says 20 .*, but meta\.fps 50"):
        declared_rate("a.npz", {"rate": np.array(20), "meta.fps": 50})
