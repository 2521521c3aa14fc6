"""Times come from the file, its rate or a given rate; a guess about them is a doubt."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.clock import clock_of
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
)


def test_frames_without_times_need_a_rate():
    clock = clock_of("a", 3, rate=20.0)
    np.testing.assert_allclose(clock.times, [0, 0.05, 0.1])
    assert (clock.source, clock.ambiguities) == ("the given rate", ())
    with pytest.raises(FileFormatError, match=r"episode a holds neither times nor a rate.*--rate"):
        clock_of("a", 3)


def test_a_given_rate_overrides_a_declared_one_and_says_so():
    assert clock_of("a", 3, name="fps", own_rate=50.0).source == "fps in the file"
    clock = clock_of("a", 3, name="fps", own_rate=50.0, rate=100.0)
    np.testing.assert_allclose(clock.times, [0, 0.01, 0.02])
    assert clock.source == "the given rate (fps in the file says 50 Hz)"


@pytest.mark.parametrize(
    ("rate", "unit", "looks"),
    [(1000, 1e-3, "ms"), (100, 1e-3, "ms"), (500, 1e-6, "us"), (15, 1e-9, "ns")],
)
def test_times_that_cannot_be_seconds_are_a_doubt_with_a_remedy(rate, unit, looks):
    stamps = 5e3 + np.arange(200) / rate / unit
    clock = clock_of("a", 200, stamps=stamps, name="t")
    (doubt,) = clock.ambiguities
    assert doubt.option == f"--time-unit {looks}"
    assert f"in {looks} {rate} Hz" in doubt.what
    said = clock_of("a", 200, stamps=stamps, name="t", time_unit=looks)
    assert said.ambiguities == ()
    np.testing.assert_allclose(said.times, np.arange(200) / rate, atol=1e-9)
    np.testing.assert_array_equal(said.times, clock.times)


def test_a_unit_in_the_name_or_of_the_format_is_no_doubt():
    stamps = np.arange(5) * 10.0
    assert clock_of("a", 5, stamps=stamps, name="t_ms").times[-1] == pytest.approx(0.04)
    assert clock_of("a", 5, stamps=stamps, name="step_start", unit="ms").ambiguities == ()
    with pytest.raises(ConfigurationError, match="t_ms is in ms, but --time-unit says s"):
        clock_of("a", 5, stamps=stamps, name="t_ms", time_unit="s")


@pytest.mark.parametrize("rate", [5, 100, 1000])
def test_plausible_seconds_are_taken_as_they_are(rate):
    clock = clock_of("a", 9, stamps=np.arange(9) / rate, name="t")
    assert clock.ambiguities == ()
    assert clock.source == "t in s"
    assert clock.period == pytest.approx(1 / rate)


def test_times_that_fit_no_unit_say_so():
    (doubt,) = clock_of("a", 9, stamps=np.arange(9) * 1e-7, name="t").ambiguities
    assert "no other unit fits better" in doubt.what


@pytest.mark.parametrize(
    ("unit", "said", "looks"), [(1e-3, "s", "ms"), (1.0, "ms", "s"), (1e-6, "ms", "us")]
)
def test_a_unit_that_makes_no_throw_is_a_doubt_although_it_was_said(unit, said, looks):
    stamps = np.arange(140) * 0.0125 / unit
    clock = clock_of("a", 140, stamps=stamps, name="t", time_unit=said)
    (doubt,) = clock.ambiguities
    assert doubt.option == f"--time-unit {looks}"
    assert f"in {said}, as --time-unit says, would be" in doubt.what
    assert f"in {looks} 80 Hz and 1.74 s long: it looks like {looks}" in doubt.what
    assert clock.period == pytest.approx(0.0125)


def test_slow_seconds_are_taken_when_said():
    clock = clock_of("a", 9, stamps=np.arange(9.0), name="t", time_unit="s")
    assert clock.ambiguities == ()
    assert clock.period == 1


def test_a_column_that_counts_frames_needs_the_rate():
    clock = clock_of("a", 3, stamps=np.array([7, 8, 10]), name="t", time_unit="frame", rate=100)
    np.testing.assert_allclose(clock.times - clock.times[0], [0, 0.01, 0.03])
    with pytest.raises(ConfigurationError, match=r"counts frames.*--rate"):
        clock_of("a", 3, stamps=np.array([7, 8, 10]), name="t", time_unit="frame")
    (doubt,) = clock_of("a", 3, stamps=np.array([7, 8, 9]), name="t").ambiguities
    assert "or it counts frames" in doubt.what


def test_a_rate_that_disagrees_with_the_times_is_refused_and_one_that_agrees_is_not():
    stamps = np.arange(5) / 100
    assert clock_of("a", 5, stamps=stamps, name="t", rate=101.0).period == pytest.approx(0.01)
    with pytest.raises(ConfigurationError, match=r"--rate 1000, but t in s says 100 Hz; drop"):
        clock_of("a", 5, stamps=stamps, name="t", rate=1000.0)


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
    clock = clock_of("a", 3, stamps=np.array([0.0, np.inf, np.inf]), name="t")
    assert clock.ambiguities == ()
    np.testing.assert_array_equal(clock.times, [0, np.inf, np.inf])
