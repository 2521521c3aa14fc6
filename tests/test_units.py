"""One table of units: what converts to what, and which numbers look like another unit."""

import math

import pytest

from prior_reinforce.units import (
    UNITS,
    base_of,
    factor,
    in_unit,
    is_force,
    kind_of,
    looks_like,
    per_time,
    rates,
    spelt,
    spoken,
    units_of,
)


def test_every_unit_is_spelt_in_its_own_way_and_converts_to_its_base():
    for name, unit in UNITS.items():
        spellings = (name, unit.plural, *unit.spellings.split())
        assert {spelt(spelling) for spelling in spellings} == {name}
        assert unit.spoken in ("", *units_of(unit.kind))
    for kind, base in (("length", "m"), ("angle", "rad"), ("time", "s")):
        assert next(iter(units_of(kind).items())) == (base, 1.0)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("°", "deg"), ("Inches", "in"), ("Degrés", "deg"), ("Grad", None), ("counts", None)],
)
def test_spellings(text, unit):
    assert spelt(text) == unit


def test_units_of_one_kind_convert():
    assert factor("in", "m") == 0.0254
    assert factor("rad", "deg") == pytest.approx(180 / math.pi)
    assert factor("turns", "turns") == 1.0
    assert factor("cm", "rad") is None
    assert factor("turns", "rad") is None
    assert (base_of("cm"), base_of("percent"), base_of("N")) == (
        ("m", 0.01),
        ("percent", 1),
        ("N", 1),
    )
    assert (kind_of("us"), kind_of("N")) == ("time", "N")


@pytest.mark.parametrize(
    ("powers", "units"),
    [
        (0, ("m", "s", "steps", "m/step", "percent", "N")),
        (
            1,
            ("rad/s", "rad/sec", "m/sec", "mm/min", "rpm", "rad s^-1", "rad s⁻¹", "°/s", "m per s"),
        ),
        (1, ("0.229 rpm", "0.229rpm", "0.01 deg/s", "dps", "RPM", "M/S")),
        (2, ("m/s^2", "m/s²", "m/s/s", "rad s-2", "rpm/s")),
    ],
)
def test_rates_and_accelerations_are_told_by_their_units(powers, units):
    assert {unit: per_time(unit) for unit in units} == dict.fromkeys(units, powers)


def test_forces_and_torques_are_told_by_their_units():
    assert all(map(is_force, ("N", "Nm", "N m", "N·m", "mNm", "kN", "N cm")))
    assert not any(map(is_force, ("m", "min", "in", "1", "rad")))


def test_a_rate_is_per_time():
    units = ["m/s", "rad/sec", "deg/min", "rpm", "counts/turn", "m", "1", "percent", "m/s^2"]
    assert rates(units) == [0, 1, 2, 3]
    assert factor("deg/s", "rad/sec") == pytest.approx(math.pi / 180)
    assert factor("mm/s", "m/min") == pytest.approx(0.06)
    assert factor("deg", "rad/s") is None


@pytest.mark.parametrize(
    ("unit", "wanted", "times"),
    [
        ("rpm", "rad/s", math.pi / 30),
        ("0.229 rpm", "rad/s", 0.229 * math.pi / 30),
        ("rps", "deg/s", 360.0),
        ("dps", "rad s^-1", math.pi / 180),
        ("0.01 deg/s", "dps", 0.01),
        ("m per min", "m/s", 1 / 60),
        ("cm/s^2", "m/s/s", 0.01),
        ("counts s^-1", "counts/s", 1.0),
        ("m/s^2", "m/s", None),
        ("rpm", "rev", None),
    ],
)
def test_rates_convert_however_they_are_written(unit, wanted, times):
    assert factor(unit, wanted) == (times if times is None else pytest.approx(times))


def test_people_say_centimetres_milliseconds_and_degrees():
    assert (spoken("m"), spoken("s"), spoken("in")) == (("cm", 100.0), ("ms", 1000.0), ("in", 1.0))
    assert spoken("rad") == ("deg", pytest.approx(180 / math.pi))
    assert spoken("turns") == ("turns", 1.0)


def test_a_threshold_holds_in_every_unit_of_its_kind():
    slow = {"angle": 0.3, "share": 0.5}
    assert in_unit(slow, "rad") == 0.3
    assert in_unit(slow, "deg") == pytest.approx(math.degrees(0.3))
    assert in_unit(slow, "percent") == 50.0
    assert (in_unit(slow, "m"), in_unit(slow, "steps")) == (None, None)


@pytest.mark.parametrize(
    ("unit", "number", "said", "looks"),
    [
        ("m", 5.0, {}, ""),
        ("m", -5.1, {}, "cm"),
        ("m", 34.0, {"stated": True}, ""),
        ("m", 36.0, {"stated": True}, "cm"),
        ("m", math.inf, {}, "cm"),
        ("m", 301.0, {}, "mm"),
        ("m", 1200.0, {"stated": True}, "mm"),
        ("m", 0.99, {"error": True}, ""),
        ("m", -1.0, {"error": True}, "cm"),
        ("rad", 6.9, {}, ""),
        ("rad", 7.1, {}, "deg"),
        ("rad", 721.0, {}, "deg"),
        ("rad", 3.2, {"error": True}, "deg"),
        ("s", 1e6, {}, ""),
        ("deg", 1e6, {}, ""),
        ("steps", 1e6, {}, ""),
    ],
)
def test_a_number_that_is_too_large_looks_like_another_unit(unit, number, said, looks):
    assert looks_like(unit, number, **said) == looks


def test_a_number_may_stand_before_a_unit():
    assert factor("0.01 deg", "rad") == pytest.approx(0.01 * math.pi / 180)
    assert factor("0.1mm", "m") == pytest.approx(1e-4)
    assert factor("0.01 bar", "rad") is None
    assert base_of("2 bar") == ("2 bar", 1.0)
    assert factor("0.1 percent", "share") == pytest.approx(1e-3)
    assert kind_of("0.01 deg") == "angle"
    assert kind_of("2 bar") == "2 bar"
