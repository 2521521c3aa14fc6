"""Times come from the file, its rate or a given rate; a guess about them is a doubt."""

from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.recordings import clock
from prior_reinforce.arm.recordings.clock import clock_from_arrays
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.time_finder import DeclaredRate, declared_rate
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
)


def clock_of(episode, count, *, rate=None, time_unit=None, **of_file):
    options = ReadOptions(rate=rate, time_unit=time_unit)
    return clock.clock_of(episode, count, options, **of_file)


def test_frames_without_times_need_a_rate():
    found = clock_of("a", 3, rate=20.0)
    np.testing.assert_allclose(found.times, [0, 0.05, 0.1])
    assert (found.source, found.ambiguities) == ("the given rate", ())
    with pytest.raises(FileFormatError, match=r"episode a holds neither times nor a rate.*--rate"):
        clock_of("a", 3)


def test_a_given_rate_agrees_with_a_declared_one_or_is_refused():
    assert clock_of("a", 3, declared=DeclaredRate(50.0, "fps")).source == "fps in the file"
    found = clock_of("a", 3, declared=DeclaredRate(50.0, "fps"), rate=51.0)
    np.testing.assert_allclose(found.times, [0.0, 1 / 51, 2 / 51])
    with pytest.raises(ConfigurationError, match=r"--rate 100, but fps .* 50 .*--time-column none"):
        clock_of("a", 3, declared=DeclaredRate(50.0, "fps"), rate=100.0)
    unread = ReadOptions(rate=100.0, time_column="none")
    unread = clock.clock_of("a", 3, unread, declared=DeclaredRate(50.0, "fps"))
    np.testing.assert_allclose(unread.times, [0.0, 0.01, 0.02])
    # At 5 frames an hour no arm is recorded.
    assert clock_of(
        "a", 3, declared=DeclaredRate(1e-3 * 5, "dt"), rate=20.0
    ).period == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("rate", "unit", "looks"),
    [(1000, 1e-3, "ms"), (100, 1e-3, "ms"), (500, 1e-6, "us"), (15, 1e-9, "ns")],
)
def test_times_that_cannot_be_seconds_are_a_doubt_with_a_remedy(rate, unit, looks):
    stamps = 5e3 + np.arange(200) / rate / unit
    found = clock_of("a", 200, stamps=stamps, name="t")
    (doubt,) = found.ambiguities
    assert doubt.option == f"--time-unit {looks}"
    assert f"in {looks} {rate} Hz" in doubt.what
    said = clock_of("a", 200, stamps=stamps, name="t", time_unit=looks)
    assert said.ambiguities == ()
    np.testing.assert_allclose(said.times, np.arange(200) / rate, atol=1e-9)
    np.testing.assert_array_equal(said.times, found.times)


def test_a_unit_in_the_name_or_of_the_format_is_no_doubt():
    stamps = np.arange(5) * 10.0
    assert clock_of("a", 5, stamps=stamps, name="t_ms").times[-1] == pytest.approx(0.04)
    assert clock_of("a", 5, stamps=stamps, name="step_start", unit="ms").ambiguities == ()
    with pytest.raises(ConfigurationError, match="t_ms is in ms, but --time-unit says s"):
        clock_of("a", 5, stamps=stamps, name="t_ms", time_unit="s")


@pytest.mark.parametrize(
    ("head", "step"),
    [("time [0.1 ms]", 100.0), ("t [100us]", 100.0), ("t (10 ms)", 1.0), ("t [0.01 s]", 1.0)],
)
def test_a_unit_of_time_may_stand_behind_a_number(head, step):
    found = clock_of("a", 5, stamps=np.arange(5) * step, name=head)
    assert (found.times[-1], found.ambiguities) == (pytest.approx(0.04), ())
    said = clock_of("a", 5, stamps=np.arange(5) * step, name=head, rate=100.0)
    np.testing.assert_allclose(said.times, found.times)
    assert declared_rate("a", {"dt [10 ms]": 1.0}).hertz == pytest.approx(100.0)


@pytest.mark.parametrize("rate", [5, 100, 1000])
def test_plausible_seconds_are_taken_as_they_are(rate):
    found = clock_of("a", 9, stamps=np.arange(9) / rate, name="t")
    assert found.ambiguities == ()
    assert found.source == "t in s"
    assert found.period == pytest.approx(1 / rate)


def test_times_that_fit_no_unit_say_so():
    (doubt,) = clock_of("a", 9, stamps=np.arange(9) * 1e-10, name="t").ambiguities
    assert "no other unit fits better" in doubt.what


@pytest.mark.parametrize(
    ("unit", "said", "looks"), [(1e-3, "s", "ms"), (1.0, "ms", "s"), (1e-6, "ms", "us")]
)
def test_a_unit_that_makes_no_throw_is_a_doubt_although_it_was_said(unit, said, looks):
    stamps = np.arange(140) * 0.0125 / unit
    found = clock_of("a", 140, stamps=stamps, name="t", time_unit=said)
    (doubt,) = found.ambiguities
    assert doubt.option == f"--time-unit {looks}"
    assert f"in {said}, as --time-unit says, would be" in doubt.what
    assert f"in {looks} 80 Hz and 1.74 s long: it looks like {looks}" in doubt.what
    assert found.period == pytest.approx(0.0125)


def test_slow_seconds_are_taken_when_said():
    found = clock_of("a", 9, stamps=np.arange(9.0), name="t", time_unit="s")
    assert found.ambiguities == ()
    assert found.period == 1


def test_key_frames_of_a_throw_are_in_seconds():
    stamps = np.array([0, 0.4, 0.65, 0.9, 1.15, 1.4, 1.99])
    found = clock_of("a", 7, stamps=stamps, name="t")
    assert [doubt.option for doubt in found.ambiguities] == ["--time-unit s"]
    assert found.times[-1] == pytest.approx(1.99)


def test_a_column_that_counts_frames_needs_the_rate():
    found = clock_of("a", 3, stamps=np.array([7, 8, 10]), name="t", time_unit="frame", rate=100)
    np.testing.assert_allclose(found.times - found.times[0], [0, 0.01, 0.03])
    with pytest.raises(ConfigurationError, match=r"counts frames.*--rate"):
        clock_of("a", 3, stamps=np.array([7, 8, 10]), name="t", time_unit="frame")
    (doubt,) = clock_of("a", 3, stamps=np.array([7, 8, 9]), name="t").ambiguities
    assert "or it counts frames" in doubt.what
    # What is not even called a time more probably counts.
    (doubt,) = clock_of("a", 3, stamps=np.array([7, 8, 9]), name="ms").ambiguities
    assert doubt.option == "--time-unit ms"
    (doubt,) = clock_of("a", 3, stamps=np.array([7, 8, 9]), name="X").ambiguities
    assert (doubt.option, doubt.guessed) == ("--time-unit frame --rate HZ", False)


def test_a_rate_that_disagrees_with_the_times_is_refused_and_one_that_agrees_is_not():
    stamps = np.arange(5) / 100
    assert clock_of("a", 5, stamps=stamps, name="t", rate=101.0).period == pytest.approx(0.01)
    with pytest.raises(ConfigurationError, match=r"--rate 1000, but t in s says 100 Hz; drop"):
        clock_of("a", 5, stamps=stamps, name="t", rate=1000.0)


@pytest.mark.parametrize(
    ("name", "number", "likely"),
    [("dt", 20, "50 or 20"), ("dt", 50, "20 or 50"), ("rate", 0.02, "50 or 20"),
     ("dt", 2e-5, "5e+04")],
)  # fmt: skip
def test_a_declared_rate_at_which_no_arm_is_recorded_is_a_doubt(name, number, likely):
    declared = declared_rate("a", {name: number})
    (doubt,) = clock_of("a", 100, declared=declared).ambiguities
    assert doubt.what.endswith(f"it looks like {likely}")
    assert doubt.option == f"--rate {float(likely.split()[0]):g}"
    assert (
        clock_of("a", 100, declared=declared_rate("a", {name: number}), rate=50).ambiguities == ()
    )


@pytest.mark.parametrize(("name", "unit"), [("t_ms", None), ("t", "ms")])
def test_a_unit_of_the_file_that_makes_no_recording_is_a_doubt(name, unit):
    stamps = np.arange(200) / 100
    (doubt,) = clock_of("a", 200, stamps=stamps, name=name, unit=unit).ambiguities
    by = "format" if unit else "name"
    assert f"{name} in ms, as its {by} says, would be 1e+05 Hz and 0.00199 s long" in doubt.what
    assert doubt.option == "--time-unit s"
    for said, period in (("s", 0.01), ("ms", 1e-5)):
        found = clock_of("a", 200, stamps=stamps, name=name, unit=unit, time_unit=said)
        assert (found.ambiguities, found.period) == ((), pytest.approx(period))


def test_serial_dates_are_in_days():
    stamps = 45987.5 + np.arange(200) / 100 / 86400
    for said in (None, "s"):
        (doubt,) = clock_of("a", 200, stamps=stamps, name="time", time_unit=said).ambiguities
        assert doubt.option == "--time-unit day"
    found = clock_of("a", 200, stamps=stamps, name="time", time_unit="day")
    np.testing.assert_allclose(found.times, np.arange(200) / 100, atol=1e-6)


@pytest.mark.parametrize("rate", [None, 125.0])
def test_ticks_since_the_year_1_are_of_100_ns(rate):
    stamps = 6.39e17 + np.arange(200) * 80_000
    found = clock_of("a", 200, stamps=stamps, name="Ticks", rate=rate)
    assert found.ambiguities == ()
    np.testing.assert_allclose(found.times, np.arange(200) / 125, atol=2e-5)


@pytest.mark.parametrize("rate", [{"rate": 50.0}, {"declared": DeclaredRate(50.0, "fps")}])
def test_a_counter_by_one_has_the_rate_of_its_frames_where_some_are_lost(rate):
    frames = np.array([7, 8, 9, 12, 13])
    found = clock_of("a", 5, stamps=frames, name="frame", **rate)
    np.testing.assert_allclose(found.times, frames / 50)
    assert found.ambiguities == ()


def test_other_ticks_are_asked_for_their_length():
    stamps = np.arange(200) * 80_000.0
    (doubt,) = clock_of("a", 200, stamps=stamps, name="Ticks").ambiguities
    assert "80000, and nothing says how long a tick is" in doubt.what
    assert (doubt.option, doubt.guessed) == ("--time-unit UNIT", False)
    (doubt,) = clock_of("a", 200, stamps=stamps / 1e4, name="tick").ambiguities
    assert doubt.option == "--time-unit ms"


@pytest.mark.parametrize("rate", [None, 100.0, 125.0])
def test_a_time_that_counts_down_is_named(rate):
    left = 2.0 - np.arange(200) / 100
    says = "time_to_release falls with every frame, as what counts down does"
    with pytest.raises(InvalidDemonstrationsError, match=says):
        clock_of("a", 200, stamps=left, name="time_to_release", rate=rate)


def test_a_rate_that_contradicts_the_name_of_a_recording_is_said():
    assert clock_of("throw_0_100Hz", 3, rate=100.0).source == "the given rate"
    found = clock_of("throw_4_12,5Hz", 3, rate=100.0)
    assert found.source == "the given rate (the name throw_4_12,5Hz says 12.5 Hz)"
    assert found.period == pytest.approx(0.01)


@pytest.mark.parametrize("rate", [200, 1000])
def test_nanoseconds_since_2000_are_no_ticks(rate):
    stamps = 641_000_000_000_000_000 + np.arange(rate) * (1_000_000_000 // rate)
    found = clock_of("a", rate, stamps=stamps, name="timestamp", time_unit="ns")
    assert found.period == pytest.approx(1 / rate, rel=1e-3)


def test_a_stated_unit_is_believed_of_ticks():
    ticks = 638_000_000_000_000_000 + np.arange(200) * 100_000
    assert clock_of("a", 200, stamps=ticks, name="n").period == pytest.approx(0.01, rel=1e-3)
    found = clock_of("a", 200, stamps=ticks, name="n", time_unit="us")
    assert found.period == pytest.approx(0.1, rel=1e-3)


def test_a_rate_settles_the_unit_of_times():
    stamps = np.arange(200) * 10.0
    found = clock_of("a", 200, stamps=stamps, name="t", rate=100)
    assert (found.ambiguities, found.source) == ((), "t in ms")


def test_what_has_no_use_is_refused():
    with pytest.raises(ConfigurationError, match=r"--time-unit ms is of a column of times.*drop"):
        clock_of("a", 3, rate=20.0, time_unit="ms")


def test_times_of_another_length_or_kind_are_named():
    with pytest.raises(InvalidDemonstrationsError, match=r"has 3 frames, but t of shape \(2,\)"):
        clock_of("a", 3, stamps=np.array([0, 1]), name="t")
    with pytest.raises(InvalidDemonstrationsError, match="t must hold numbers"):
        clock_of("a", 2, stamps=np.array(["a", "b"]), name="t")


def test_nanoseconds_since_1970_keep_their_order():
    stamps = 1.7e18 + np.arange(5) * 1e7
    np.testing.assert_allclose(
        clock_of("a", 5, stamps=stamps, name="t_ns").times, np.arange(5) * 0.01, atol=1e-6
    )


def test_times_that_are_no_numbers_are_left_to_the_recording():
    found = clock_of("a", 3, stamps=np.array([0.0, np.inf, np.inf]), name="t")
    assert found.ambiguities == ()
    np.testing.assert_array_equal(found.times, [0, np.inf, np.inf])


@pytest.mark.parametrize(("count", "option"), [(280, "frame --rate HZ"), (2000, "ms")])
def test_whole_numbers_called_t_count_frames_where_milliseconds_are_no_throw(count, option):
    found = clock_of("0", count, stamps=np.arange(count), name="t")
    assert [one.option for one in found.ambiguities] == [f"--time-unit {option}"]


def test_a_given_rate_beside_a_period_in_an_unknown_unit_is_held_against_it():
    declared = DeclaredRate(1 / 20, "dt")
    told = clock_of("a", 3, declared=declared, rate=100.0)
    assert all(rate in told.source for rate in ("50", "20"))
    assert told.period == pytest.approx(0.01)
    for rate in (50.0, 20.0):
        assert (
            clock_of("a", 3, declared=DeclaredRate(1 / 20, "dt"), rate=rate).source
            == "the given rate"
        )


def test_the_rate_of_each_frame_is_none_of_the_file():
    rates = {"control_rate": np.array([999.0, 1000, 1001]), "t": np.arange(3) / 50}
    options = ReadOptions()
    assert clock_from_arrays(Path("a.npz"), "a", 3, rates, options, rates).period == pytest.approx(
        0.02
    )
    same = {"fps": np.full(3, 50.0)}
    assert clock_from_arrays(Path("a.npz"), "a", 3, same, options, same).period == pytest.approx(
        0.02
    )
