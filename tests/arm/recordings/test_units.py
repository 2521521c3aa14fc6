"""Units are read from names, and guessed only where an arm could not be in them."""

import math

import numpy as np
import pytest

from prior_reinforce.arm.recordings.units import (
    CHANNEL_UNITS,
    SECONDS,
    Ambiguity,
    conversion,
    is_possible,
    judge_unit,
    known_unit,
    raise_if_ambiguous,
    say_names,
    split_unit,
    unit_of_other,
)
from prior_reinforce.errors import ConfigurationError, UnclearUnitsError
from prior_reinforce.units import base_of


@pytest.mark.parametrize(
    ("column", "name", "unit"),
    [
        ("x_cm", "x", "cm"),
        ("x [cm]", "x", "cm"),
        ("joint1 (°)", "joint1", "deg"),
        ("q0_deg", "q0", "deg"),
        ("x [in]", "x", "in"),
        ("x_inch", "x", "in"),
        ("plug_in", "plug_in", None),
        ("q[0]", "q[0]", None),
        ("joint1_pos", "joint1_pos", None),
        ("q [rad/s]", "q [rad/s]", None),
        ("elbow", "elbow", None),
        ("panDeg", "pan", "deg"),
        ("liftMm", "lift", "mm"),
        ("q_min", "q_min", None),
        ("elbowRadius", "elbowRadius", None),
        ("base_turn", "base_turn", None),
        ("base [rev]", "base", "rev"),
        ("Gelenk 1 in °", "Gelenk 1", "deg"),
        ("x in cm", "x", "cm"),
        ("x_in_cm", "x", "cm"),
        ("x in [cm]", "x", "cm"),
        ("plug in", "plug in", None),
    ],
)
def test_a_unit_that_stands_in_a_channels_name(column, name, unit):
    assert split_unit(column, CHANNEL_UNITS) == (name, unit)


def test_only_the_units_that_may_stand_there_are_taken():
    assert split_unit("timestamp_ms", SECONDS) == ("timestamp", "ms")
    assert split_unit("timestamp_ms", CHANNEL_UNITS) == ("timestamp_ms", None)
    assert known_unit(" [µs] ") == "us"
    assert split_unit("timeMs", SECONDS) == ("time", "ms")
    assert split_unit("Time [min]", SECONDS) == ("Time", "min")
    assert known_unit("counts") is None


@pytest.mark.parametrize("unit", ["milli m", "cm ahead", "N m", "0.01 deg", "bar", "%"])
def test_whatever_holds_a_letter_in_square_brackets_is_a_unit_and_a_number_is_none(unit):
    found = split_unit(f"x [{unit}]", any_word=True)
    assert found[0] == "x"
    assert found[1] is not None
    assert split_unit("x[0]", any_word=True) == ("x[0]", None)


def test_conversions():
    assert conversion("deg", "rad", "q") == pytest.approx(math.pi / 180)
    assert conversion("rad", "deg", "q") == pytest.approx(180 / math.pi)
    assert conversion("mm", "cm", "x") == pytest.approx(0.1)
    assert conversion("counts", "counts", "x") == 1
    assert conversion("in", "m", "x") == 0.0254
    with pytest.raises(ConfigurationError, match="x is recorded in cm, but plans are in rad"):
        conversion("cm", "rad", "x")


@pytest.mark.parametrize(
    ("wanted", "reach", "looks"),
    [
        ("rad", 6.28, "rad"),
        ("rad", 7.5, "deg"),
        ("rad", 145.0, "deg"),
        ("rad", 65536.0, None),
        ("m", 1.2, "m"),
        ("m", 78.5, "cm"),
        ("m", 785.0, "mm"),
        ("counts", 65536.0, "counts"),
        ("s", 0.01, "s"),
        ("s", 10.0, "ms"),
        ("s", 2e6, "ns"),
        ("ms", 10.0, "ms"),
        ("ms", 0.002, "s"),
        ("ns", 0.0, None),
    ],
)
def test_what_no_arm_does_is_another_unit(wanted, reach, looks):
    period = wanted in SECONDS
    assert judge_unit(wanted, reach, period=period) == looks


def test_doubts_are_one_line_with_the_options_that_settle_them():
    raise_if_ambiguous([])
    doubts = [
        Ambiguity("t looks like ms", "--time-unit ms"),
        Ambiguity("q looks like deg", "--units deg"),
    ]
    with pytest.raises(UnclearUnitsError) as caught:
        raise_if_ambiguous(doubts)
    assert str(caught.value) == (
        "t looks like ms; q looks like deg; if so, add: --time-unit ms --units deg"
    )
    assert caught.value.options == "--time-unit ms --units deg"
    with pytest.raises(UnclearUnitsError, match="; and no outcomes") as caught:
        raise_if_ambiguous(doubts, also="no outcomes")
    assert caught.value.also == "no outcomes"


def test_many_names_are_few_words():
    ninety = ["time", *(f"q[{i}]" for i in range(7)), *(f"cmd.q_{i}" for i in range(1, 7)), "x"]
    assert say_names(ninety) == "time, q[0] to q[6], cmd.q_1 to cmd.q_6, x"
    assert say_names([f"{c}{c}" for c in "abcdefghijklmno"]).endswith("ll and 3 more")


@pytest.mark.parametrize(
    ("unit", "reach", "cannot"),
    [("rad", 12.0, False), ("rad", 151.0, True), ("m", 9.0, False), ("m", 92.0, True)],
)
def test_what_no_arm_can_do_whoever_says_it(unit, reach, cannot):
    assert is_possible(unit, reach) is not cannot
    assert is_possible("counts", 1e9)


def test_a_motors_hundredths_of_a_degree_are_converted():
    assert split_unit("pan [0.01 deg]", CHANNEL_UNITS, any_word=True) == ("pan", "0.01 deg")
    assert conversion("0.01 deg", "rad", "pan") == pytest.approx(math.pi / 18000)


def test_a_unit_behind_a_number_in_any_brackets_is_one():
    for head in ("j(0.001deg)", "j [0.001 deg]"):
        name, unit = split_unit(head, CHANNEL_UNITS)
        assert (name, base_of(unit)[1]) == ("j", pytest.approx(np.pi / 180_000))
    assert split_unit("j(2)", CHANNEL_UNITS) == ("j(2)", None)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("vel_1_degps", "deg/s"), ("vel_1_rad_per_s", "rad/s"), ("w_dps", "deg/s"),
        ("tcp_speed_mmps", "mm/s"), ("torque_4_Nm", "Nm"), ("steps", None), ("temps", None),
        ("q_d_1", None), ("vel_1", None),
    ],
)  # fmt: skip
def test_the_unit_of_a_speed_or_a_load_in_a_name(name, unit):
    assert unit_of_other(name) == unit
