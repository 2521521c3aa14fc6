"""Errors and places, read from words or numbers, and said again."""

import contextlib
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.parsing import as_place, from_words, read_place, read_uncertain_place
from prior_reinforce.readings import Reading
from prior_reinforce.wording import (
    error_example,
    place_example,
    say_length,
    say_place,
    say_reading,
    say_tolerance,
    to_words,
)

METRES = OutcomeFormat.metres(2)
MIXED = OutcomeFormat(("x", "t"), ("m", "s"))


def of(*units, names="xyzabc"):
    return OutcomeFormat(tuple(names[: len(units)]), units)


INF = np.inf


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("5cm long, 2cm left", [0.05, 0.02]),
        ("2 cm right and 10 cm short", [-0.10, -0.02]),
        ("5 long", [0.05, 0.0]),
        ("20 mm left", [0.0, 0.02]),
        ("0.1m short", [-0.1, 0.0]),
        ("5cm long 2 cm left", [0.05, 0.02]),
        ("Hit", [0.0, 0.0]),
        ("5 centimeters long, 2 millimetres left", [0.05, 0.002]),
        ("long by 5cm, left 2cm", [0.05, 0.02]),
        ("short 5", [-0.05, 0.0]),
        ("5cm too far", [0.05, 0.0]),
        ("left 5cm long 2cm", [0.02, 0.05]),
        ("long 5 left 2", [0.05, 0.02]),
        ("to the left 5cm", [0.0, 0.05]),
        ("5cm past", [0.05, 0.0]),
    ],
)
def test_words_are_read(words, error):
    np.testing.assert_allclose(from_words(words, METRES).error_seen, error, atol=1e-12)


@pytest.mark.parametrize(
    "words",
    [
        "",
        "wide",
        "5 cm",
        "long 5 left",
        "long 5cm left",
        "left 5cm long",
        "right 2 cm short",
        "early 20ms long",
        "straight",
        "miss, straight",
        "5 cm long, 2 cm short",
        "5cm high",
        "-5cm long",
        "5 km long",
    ],
)
def test_other_words_are_refused_with_the_remedy(words):
    with pytest.raises(InvalidFeedbackError, match=r"cannot read|twice"):
        from_words(words, METRES)


@pytest.mark.parametrize(
    ("words", "low", "high", "sd", "hit"),
    [
        ("5cm long, 2cm left", [3.5, 1.0], [7.5, 3.5], [0, 0], None),
        ("10 cm short", [-15, -1], [-7.5, 1], [0, 0], None),
        ("2 cm right", [-1, -3.5], [1, -1 / np.sqrt(2)], [0, 0], None),
        ("0", [-1, -1], [1, 1], [0, 0], None),
        ("3 cm long", [3, -1], [3, 1], [np.hypot(0.2 * 3, 1.0), 0], None),
        ("5 +- 0.5 cm long, 2 cm left", [5, 1], [5, 3.5], [0.5, 0], None),
        ("5 cm +- 3 mm long, 0.01m ± 0.2cm left", [5, 1], [5, 1], [0.3, 0.2], None),
        ("long", [1, -INF], [INF, INF], [0, 0], None),
        ("short, 5 cm left", [-INF, 3.5], [-1, 7.5], [0, 0], None),
        ("5 cm left, somewhere", [-INF, 3.5], [INF, 7.5], [0, 0], None),
        ("long, miss", [1, -INF], [INF, INF], [0, 0], False),
        ("hit", [-INF, -INF], [INF, INF], [0, 0], True),
        ("miss", [-INF, -INF], [INF, INF], [0, 0], False),
        ("lost", [-INF, -INF], [INF, INF], [0, 0], False),
        ("2 cm long, hit", [1 / np.sqrt(2), -1], [3.5, 1], [0, 0], True),
    ],
)
def test_words_are_intervals_in_centimetres(words, low, high, sd, hit):
    reading = from_words(words, METRES)
    np.testing.assert_allclose(100 * reading.low, low)
    np.testing.assert_allclose(100 * reading.high, high)
    np.testing.assert_allclose(100 * reading.sd, sd, atol=1e-12)
    assert reading.hit is hit
    assert reading.lost == (words == "lost")
    assert reading.said == words


def test_a_mere_direction_stands_for_five_centimetres():
    np.testing.assert_allclose(from_words("long, right", METRES).error_seen, [0.05, -0.05])


def test_what_cannot_be_read_is_named_once():
    with pytest.raises(
        InvalidFeedbackError, match=r"^cannot read 'a hair long': it has 'hair',.*; write"
    ):
        from_words("A hair long", METRES)


@pytest.mark.parametrize("words", ["long 5cm left", "left 5cm long", "long, left 5cm short"])
def test_one_length_with_two_directions_is_refused_with_the_right_form(words):
    with pytest.raises(InvalidFeedbackError, match="5cm long, 2cm left"):
        from_words(words, METRES)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("2 yards long", "it has 'yards', which is no unit (m, cm, mm, in)"),
        ("bit short", 'for instance "short" alone, or "5-10cm short"'),
        ("wildly far", 'for instance "long" alone'),
        ("3 fingers left", 'for instance "left" alone'),
        ("a hand short", "it has 'hand'"),
        ("in the hoop", 'or "hit" or "miss"'),
        ("5cm long, 5cm long", "names long twice"),
        ("quarter of a metre short", "it has 'quarter' and 'of', which is no unit"),
        ("5cm late", "outcomes have no time: x \\[m], y \\[m]"),
        ("5cm wide", "it has 'wide', which is no unit .* and no direction"),
        ("1/2/3 in long", "write 0.5 for 1/2"),
        ("5cm l, 2cm r", "'l' may be long or left"),
        ("5cm r", "'r' may be right"),
        ("5cm over the hoop", "'over' may be long"),
    ],
)
def test_the_word_that_is_not_known_is_named(words, says):
    with pytest.raises(InvalidFeedbackError, match=says.replace("(", r"\(").replace(")", r"\)")):
        from_words(words, METRES)


def test_hit_and_miss_exclude_each_other():
    with pytest.raises(InvalidFeedbackError, match="hit and miss"):
        from_words("hit, miss", METRES)


def test_where_a_lost_object_went_is_not_said_too():
    for text in ("lost, 5 cm long", "lost, hit"):
        with pytest.raises(InvalidFeedbackError, match="say one of them"):
            from_words(text, METRES)


def test_a_place_has_no_spread_and_no_mere_direction():
    for text in ("92 +- 1 cm ahead", "ahead"):
        with pytest.raises(InvalidFeedbackError, match="cannot read"):
            read_place(text, METRES)


@pytest.mark.parametrize(
    "text", ["0.92+-0.01 0.1", "0.92 +- 0.01 0.1", "92cm ± 1cm, 10cm", "92 +/- 1 cm ahead"]
)
def test_a_place_with_a_spread_is_refused_rather_than_read_without_it(text):
    with pytest.raises(InvalidFeedbackError, match=r"leave out the \+-"):
        read_place(text, METRES)


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        (from_words("long, somewhere", METRES), "long, somewhere"),
        (from_words("30 long, 2 to the left", METRES), "30 cm long, 2 cm left"),
        (from_words("5 +- 0.5 long, miss", METRES), "5 +- 0.5 cm long, miss"),
        (from_words("5 +- 0.5 cm long, 2mm left", METRES), "5 +- 0.5 cm long, 2mm left"),
        (Reading.by_eye([0.05, -0.02]), "5 cm long, 2 cm right"),
        (Reading.only(True, 2), "hit"),
        (Reading.only(False, 2), "missed"),
    ],
)
def test_a_reading_is_said_in_its_own_words_or_as_its_number(reading, said):
    assert say_reading(reading, METRES) == said


@pytest.mark.parametrize("words", ["0.05 long", "5cm short, 0.02 left"])
def test_metres_without_their_unit_are_not_taken_for_a_hit(words):
    with pytest.raises(InvalidFeedbackError, match="has no unit and would be 0"):
        from_words(words, METRES)


@pytest.mark.slow
@given(st.lists(st.integers(-900, 900), min_size=1, max_size=3))
def test_words_say_tenths_of_centimetres_without_loss(tenths):
    error = np.array(tenths) / 1000
    read = from_words(to_words(error), OutcomeFormat.metres(len(tenths)))
    np.testing.assert_allclose(read.error_seen, error, atol=1e-12)


@pytest.mark.slow
@given(st.text(max_size=30))
def test_no_text_causes_anything_but_the_named_error(text):
    with contextlib.suppress(InvalidFeedbackError):
        assert from_words(text, METRES).error_seen.shape == (2,)


@pytest.mark.slow
@given(st.lists(st.integers(-9000, 9000), min_size=1, max_size=3))
def test_a_place_that_was_said_is_read_again_to_a_millimetre(millimetres):
    place = np.array(millimetres) / 1000
    form = OutcomeFormat.metres(len(place))
    np.testing.assert_allclose(read_place(say_place(place, form), form), place, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("0.92 0.10", [0.92, 0.10]),
        ("0.92, -1e-1", [0.92, -0.1]),
        ("92cm ahead, 10cm to the left", [0.92, 0.10]),
        ("10 cm right and 1 m behind", [-1.0, -0.1]),
        ("92cm ahead", [0.92, 0.0]),
        ("92 cm 27 cm right", [0.92, -0.27]),
        ("92 cm, 27 cm to the left", [0.92, 0.27]),
        ("1.1m ahead .06 m left", [1.1, 0.06]),
    ],
)
def test_places_are_read_from_numbers_or_words(text, place):
    np.testing.assert_allclose(read_place(text, METRES), place, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "units", "message"),
    [
        ("0.92", METRES, "2 finite numbers: x, y"),
        ("nan 0.1", METRES, "2 finite numbers: x, y"),
        ("", METRES, "2 finite numbers"),
        ("far away", METRES, "one of ahead, behind, left, right"),
        ("hit", METRES, "one of ahead"),
        ("5cm up", METRES, "one of ahead"),
        ("27 cm right, 92 cm", METRES, "names left and right twice"),
        ("92 cm 5 mm ahead", METRES, "names ahead and behind twice"),
        ("92 cm ahead, 5 cm left, 3 cm", METRES, "cannot read '3 cm' in"),
        (
            "111 cm from the base of the arm, 6 cm left",
            METRES,
            "straight to the place or along x only; measure along x and say 111 cm ahead",
        ),
        ("5cm ahead", MIXED, "give 2 finite numbers"),
        (f"{'9' * 400}cm ahead", METRES, "cannot read"),
    ],
)
def test_other_places_are_refused_with_the_remedy(text, units, message):
    with pytest.raises(InvalidFeedbackError, match=message):
        read_place(text, units)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("0.92 -0.1", (0.92, -0.1)),
        ("92cm -10cm", (0.92, -0.1)),
        ("92 cm, -10 cm", (0.92, -0.1)),
        ("92 -10 cm", (0.92, -0.1)),
        ("920mm, -0.1m", (0.92, -0.1)),
    ],
)
def test_a_place_in_numbers_with_or_without_units(text, place):
    np.testing.assert_allclose(read_place(text, METRES), place)


def test_metres_that_are_said_may_be_as_far_as_a_bat_strikes():
    np.testing.assert_allclose(read_place("9.7m -1m", METRES), [9.7, -1])


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("distance", "height"), ("cm", "cm")),
        (("x", "y", "angle"), ("m", "m", "rad")),
        (("how far past the line",), ("in",)),
        (("x", "t"), ("m", "s")),
        (("a", "b", "c", "d"), ("m", "m", "s", "1")),
    ],
)
def test_what_is_printed_of_any_task_can_be_read(names, units):
    form = OutcomeFormat(names, units)
    numbers = np.array([0.9, -0.5, 0.3, 0.1])[: len(names)]
    np.testing.assert_allclose(read_place(say_place(numbers, form), form), numbers)
    np.testing.assert_allclose(read_place(place_example(form), form).shape, numbers.shape)
    error = from_words(to_words(numbers, form), form)
    np.testing.assert_allclose(error.error_seen, numbers)
    with pytest.raises(InvalidFeedbackError, match=re.escape(place_example(form))):
        read_place("over there", form)


def test_words_and_other_numbers_may_stand_beside_each_other():
    pose = OutcomeFormat(("x", "y", "angle"), ("m", "m", "rad"))
    np.testing.assert_allclose(
        read_place("60cm ahead, 5cm left, 20deg", pose), [0.6, 0.05, np.pi / 9]
    )
    with pytest.raises(InvalidFeedbackError, match="3 finite numbers: x, y, angle"):
        read_place("60cm ahead, 5cm left", pose)


def test_a_place_in_another_unit_is_converted():
    assert read_place("30 deg", of("rad")) == pytest.approx([np.pi / 6])
    assert read_place("0.5rad", of("deg")) == pytest.approx([90 / np.pi])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("53, -13", "53 m is farther than any arm throws; say the unit, for instance 53cm"),
        ("9.7, -1", "for instance 9.7cm, or 9.7m"),
        ("53m, -13m", "53 m is farther than any arm throws"),
        ("92cm", "is not 2 finite numbers"),
        ("92cm 10deg", "cannot read"),
        ("92cm -10", "cannot read"),
        ("nan 1", "is not 2 finite numbers"),
    ],
)
def test_a_place_that_cannot_be_meant_is_refused(text, says):
    with pytest.raises(InvalidFeedbackError, match=says):
        read_place(text, METRES)


def test_a_goal_of_more_than_a_turn_is_refused_as_65_metres_are():
    with pytest.raises(InvalidFeedbackError, match=r"80 rad is more than a turn; say .* 80deg"):
        read_place("80", of("rad"))
    assert read_place("80", of("deg")) == pytest.approx([80])


@pytest.mark.parametrize(
    ("text", "turned"),
    [("8rad", 8.0), ("8 rad", 8.0), ("460deg", np.deg2rad(460)), ("1.3turns", 2.6 * np.pi)],
)
def test_an_angle_of_more_than_a_turn_is_read_where_its_unit_is_said(text, turned):
    assert read_place(text, of("rad")) == pytest.approx([turned])
    error = from_words(f"{text} too far", of("rad")).error_seen
    np.testing.assert_allclose(error, [turned])


def test_the_remedy_for_a_bare_angle_of_more_than_a_turn_can_be_said():
    with pytest.raises(InvalidFeedbackError, match=r"for instance 8deg, or 8rad$"):
        read_place("8", of("rad"))
    with pytest.raises(InvalidFeedbackError, match=r"8 rad .* say its unit, deg or rad"):
        from_words("8 long", of("rad"))


def test_a_stated_unit_is_not_asked_for():
    with pytest.raises(InvalidFeedbackError, match="much more than a turn") as error:
        read_place("4600deg", of("rad"))
    assert "deg" not in str(error.value).removeprefix("4600deg")
    with pytest.raises(InvalidFeedbackError, match="say it again"):
        from_words("80rad long", of("rad"))


def test_numbers_up_to_twice_those_shown_are_in_the_outcomes_unit():
    shown = np.array([[8.5], [-3.0]])
    for place in ("8", np.array([8.0])):
        assert as_place(place, of("rad"), shown) == pytest.approx([8.0])
        with pytest.raises(InvalidGoalError, match="deg"):
            as_place(place, of("rad"), shown[1:])
    for place in ("16", np.array([16.0])):  # a slip of units is a factor of 57 or more
        assert as_place(place, of("rad"), shown) == pytest.approx([16.0])
        with pytest.raises(InvalidGoalError, match="deg"):
            as_place(place, of("rad"), 0.9 * shown)
    assert read_uncertain_place("8 +- 1", of("rad"), shown)[0] == pytest.approx([8.0])
    assert as_place("8rad", of("rad"), shown[1:]) == pytest.approx([8.0])


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("about 5cm long", [0.05, 0.0]),
        ("ca. 5 cm long, ~2cm left", [0.05, 0.02]),
        ("5 cm too long", [0.05, 0.0]),
        ("5cm long, 2cm right.", [0.05, -0.02]),
        ("5,5cm long", [0.055, 0.0]),
        ("2in long", [0.0508, 0.0]),
        ("hit!", [0.0, 0.0]),
        ("spot on", [0.0, 0.0]),
        ("2 inches short", [-0.0508, 0.0]),
        ("30cm way too long", [0.3, 0.0]),
        ("one foot long", [0.3048, 0.0]),
        ("a foot long", [0.3048, 0.0]),
        ("half a metre short", [-0.5, 0.0]),
        ("half an inch short", [-0.0127, 0.0]),
        ("three cm left", [0.0, 0.03]),
        ("5cms long", [0.05, 0.0]),
        ("5cm long, straight", [0.05, 0.0]),
        ("5cm short of the goal", [-0.05, 0.0]),
        ('2" short', [-0.0508, 0.0]),
    ],
)
def test_words_as_people_say_them(text, error):
    np.testing.assert_allclose(from_words(text, METRES).error_seen, error, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "units", "error"),
    [
        ("2in long", ["in"], [2.0]),
        ("2.54 cm short", ["in"], [-1.0]),
        ("5 deg long", ["rad"], [np.deg2rad(5)]),
        ("0.2 short", ["turns"], [-0.2]),
        ("3cm long, 1cm left, 20ms late", ["m", "m", "s"], [0.03, 0.01, 0.02]),
        ("20 ms early", ["m", "s"], [0.0, -0.02]),
        ("2 long", ["in"], [2.0]),
        ("5 deg high", ["rad"], [np.deg2rad(5)]),
        ("5° low", ["deg"], [-5.0]),
        ("0.1 s late", ["ms"], [100.0]),
        ("late, hit", ["s"], [0.0]),
    ],
)
def test_words_of_other_units(text, units, error):
    seen = from_words(text, of(*units, names=["r0", "r1", "r2"]))
    np.testing.assert_allclose(seen.error_seen, error, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "units", "low", "high", "sd"),
    [
        ("5-7cm long", ["m", "m"], [0.05, -0.01], [0.07, 0.01], [0, 0]),
        ("5 to 7 cm short", ["m", "m"], [-0.07, -0.01], [-0.05, 0.01], [0, 0]),
        ("50mm – 7cm short", ["m"], [-0.07], [-0.05], [0]),
        ("2 +- 0.5 long", ["in"], [2.0], [2.0], [0.5]),
        ("20 +- 5 ms late", ["m", "s"], [-0.01, 0.02], [0.01, 0.02], [0, 0.005]),
        ("20ms late", ["s"], [0.02], [0.02], [np.hypot(0.004, 0.01)]),
        ("10-30 ms late", ["m", "s"], [-0.01, 0.01], [0.01, 0.03], [0, 0]),
        ("early", ["m", "s"], [-INF, -INF], [INF, 0.0], [0, 0]),
    ],
)
def test_every_task_is_told_in_intervals(text, units, low, high, sd):
    reading = from_words(text, of(*units, names="xt").within([0.03] * len(units)))
    np.testing.assert_allclose(reading.low, low)
    np.testing.assert_allclose(reading.high, high)
    np.testing.assert_allclose(reading.sd, sd, atol=1e-12)


def test_components_have_the_words_of_their_names():
    through, yz = of("m", "m", "s", names=("y", "z", "flight")), of("m", "m", names="yz")
    read = from_words("5cm left, 2cm low, 20ms late", through)
    np.testing.assert_allclose(read.error_seen, [0.05, -0.02, 0.02])
    with pytest.raises(InvalidFeedbackError, match="one of left, right, high, low, late, early"):
        from_words("5cm long", through)
    assert error_example(through) == "5cm left, 2cm high, 20ms late"
    assert to_words([0.05, -0.02], yz) == "5 cm left, 2 cm low"
    assert say_place([0.05, 0.8], yz) == "5 cm left, 80 cm up"
    np.testing.assert_allclose(read_place("80cm up, 5cm right", yz), [-0.05, 0.8])


@pytest.mark.parametrize(
    ("units", "example"),
    [
        (["m"], "5cm long"),
        (["in"], "2in long"),
        (["rad"], "5deg long"),
        (["turns"], "2turns too much"),
        (["ml"], "2ml too much"),
        (["1"], "2 too much"),
        (["s", "s"], ""),
        (["m"] * 4, ""),
    ],
)
def test_an_example_of_words_can_be_read(units, example):
    form = of(*units, names=["r0", "r1", "r2", "r3"])
    assert error_example(form) == example
    assert not example or from_words(example, form).has_number


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("25ml too much", 25.0),
        ("25ml more", 25.0),
        ("25ml over", 25.0),
        ("over by 25ml", 25.0),
        ("25 too much", 25.0),
        ("25ml too many", 25.0),
        ("25ml too little", -25.0),
        ("25ml less", -25.0),
        ("25ml under", -25.0),
        ("25ml short of", -25.0),
        ("25ml high", 25.0),
    ],
)
def test_an_amount_has_its_own_words_and_the_sign_is_said(words, error):
    read = from_words(words, of("ml", names=["amount"]))
    np.testing.assert_allclose(read.error_seen, [error])
    assert read.said.endswith(f" (amount {error:+g} ml)")


def test_an_amount_may_be_told_without_a_number():
    much, little = (from_words(f"too {word}", of("ml")) for word in ("much", "little"))
    assert (much.low, much.high, little.low, little.high) == (0, INF, -INF, 0)
    np.testing.assert_allclose(from_words("10 deg over", of("rad")).error_seen, [np.pi / 18])
    with pytest.raises(InvalidFeedbackError, match='for instance "2ml too much"'):
        from_words("green", of("ml"))
    with pytest.raises(InvalidFeedbackError, match="'over'"):
        from_words("5cm over", METRES)


@pytest.mark.parametrize(
    ("vague", "plain"),
    [
        ("a bit long", "long"),
        ("slightly left", "left"),
        ("way too far", "long"),
        ("long, straight", "long, 0cm left"),
    ],
)
def test_a_vague_distance_says_no_more_than_its_direction(vague, plain):
    seen, expected = from_words(vague, METRES), from_words(plain, METRES)
    np.testing.assert_allclose([seen.low, seen.high], [expected.low, expected.high])
    assert seen.said == vague


def test_what_was_said_is_shown_with_the_unit_that_was_understood():
    assert say_reading(from_words("2 long", of("in")), of("in")) == "2 in long"
    assert say_reading(from_words("5-7 long, 2 left", METRES), METRES) == "5-7 cm long, 2 cm left"


def test_inches_are_an_interval_as_centimetres_are():
    reading = from_words("2cm long", of("in"))
    np.testing.assert_allclose(reading.low, 1 / 2.54)
    np.testing.assert_allclose(reading.high, 3.5 / 2.54)


@pytest.mark.parametrize(
    ("text", "units", "says"),
    [
        ("green", ["rad"], "cannot read 'green'"),
        ("5 cm late", ["m", "s"], "is to be in s"),
        ("5 late", ["m", "s"], "say that unit"),
        ("5 kg long", ["rad"], "cannot read"),
        ("5 deg long, 2 deg short", ["rad"], "names long and short twice"),
        ("20 ms late", ["s", "s"], "cannot read"),
        ("80 rad long", ["rad"], "more than a turn"),
        ("90 m long", ["m"], "farther than any arm throws"),
    ],
)
def test_other_words_of_other_units_are_refused(text, units, says):
    with pytest.raises(InvalidFeedbackError, match=says):
        from_words(text, of(*units))


def test_a_place_may_have_one_spread():
    place, sd = read_uncertain_place("80 20 cm +/- 5 cm", METRES)
    np.testing.assert_allclose([*place, sd], [0.8, 0.2, 0.05])
    with pytest.raises(InvalidFeedbackError, match="components of one unit"):
        read_uncertain_place("0.8 0.2 +- 0.1", MIXED)


def test_a_place_of_one_component_in_inches_is_said_in_words():
    assert read_place("20in ahead", of("in", names=["distance"])) == pytest.approx([20.0])
    assert read_place("20 behind", of("in", names=["distance"])) == pytest.approx([-20.0])
    np.testing.assert_allclose(read_place("50.8cm ahead, 2in left", of("in", "in")), [20.0, 2.0])


@pytest.mark.parametrize(
    ("text", "units", "place"),
    [
        ("1,20 0,3", "mm", [1.2, 0.3]),
        ("1,2m 30cm", "mm", [1.2, 0.3]),
        ("1.2, 0.3", "mm", [1.2, 0.3]),
        ("1.2 \u22120.3", "mm", [1.2, -0.3]),
        ("0,9 s", "s", [0.9]),
        ("0,9", "s", [0.9]),
        ("0.92,0.1 m", "mm", [0.92, 0.1]),
    ],
)
def test_decimal_commas_of_a_place_are_told_by_how_many_numbers_there_are(text, units, place):
    np.testing.assert_allclose(read_place(text, of(*units)), place)


def test_what_may_be_a_thousand_is_not_read_as_a_decimal_number():
    for words in ("1,500 mm long", "2 cm left, 1,500 mm long", "1,500 long"):
        with pytest.raises(InvalidFeedbackError, match=r"may be a thousand; write 1500, or 1\.500"):
            from_words(words, METRES)
    with pytest.raises(InvalidFeedbackError, match="may be a thousand"):
        read_place("1,500 0,300", METRES)
    assert from_words("0,500 m long", METRES).error_seen == pytest.approx([0.5, 0])
    assert from_words("5,5 cm long, 1,25cm left", METRES).error_seen == pytest.approx(
        [0.055, 0.0125]
    )


@pytest.mark.parametrize(
    ("unit", "goal", "words", "error"),
    [
        ("pins", "7 pins", "3 pins high", 3.0),
        ("m/s", "3.2 m/s", "0.2 m/s low", -0.2),
        ("N", "12 N", "2-4 N low", -3.0),
    ],
)
def test_a_unit_of_the_task_s_own_is_read_as_it_is_printed(unit, goal, words, error):
    form = OutcomeFormat(("out",), (unit,))
    place = read_place(goal, form)
    assert say_place(place, form) == f"out {goal}"
    np.testing.assert_allclose(from_words(words, form).error_seen, [error])
    pair = OutcomeFormat(("x", "out"), ("m", unit))
    np.testing.assert_allclose(read_place(f"0.9m, {goal}", pair), [0.9, *place])


def test_a_number_without_a_unit_is_printed_without_one():
    form = OutcomeFormat(("pins",), ("1",), (1.0,))
    assert say_place([7.0], form) == "pins 7"
    assert from_words("2 high", form).said == "2 high (pins +2)"
    assert (say_tolerance(form), say_length(2.5, form)) == ("1", "2.5")


def test_the_sign_that_a_word_was_given_is_said_where_it_has_none_of_its_own():
    bearing = OutcomeFormat(("bearing",), ("deg",))
    assert from_words("5 deg right", bearing).said == "5 deg right (bearing -5 deg)"
    assert from_words("5cm right", METRES).said == "5cm right"


@pytest.mark.parametrize("text", ["6m long", "6 m long, 2cm left", "600cm long"])
def test_an_error_farther_than_any_arm_throws_is_refused_whatever_its_unit(text):
    with pytest.raises(InvalidFeedbackError, match="farther than any arm throws"):
        from_words(text)


SHOWN = np.array([[0.9, -0.1], [1.2, 0.15]])


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1.05 10cm", "1.05"),
        ("1.05 -10 cm", "1.05"),
        ("1.05 ahead, 10cm left", "1.05"),
        ("1 ahead, 0.1 left", "1"),
    ],
)
def test_a_number_that_may_be_in_metres_is_not_read_in_centimetres_unasked(text, number):
    says = rf"{number} has no unit; say {number}cm or {number}m"
    with pytest.raises(InvalidFeedbackError, match=says):
        read_place(text, OutcomeFormat.metres(2), SHOWN)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("92 10cm", [0.92, 0.1]),
        ("92 ahead, 1 left", [0.92, 0.01]),
        ("0 10cm", [0.0, 0.1]),
        ("5 10cm", [0.05, 0.1]),
        ("1.05m 10cm", [1.05, 0.1]),
        ("1.05 0.1", [1.05, 0.1]),
    ],
)
def test_centimetres_that_can_be_nothing_else_are_read(text, place):
    assert read_place(text, OutcomeFormat.metres(2), SHOWN) == pytest.approx(place)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("92cm ahead, 0.1 left", [[0.9, 0.0]]),  # straight ahead
        ("0.8 -2.5cm", [1.0, 1.0]),
        ("1.0 ahead, 0.2 right", [1.0, 1.0]),
    ],
)
def test_a_decimal_number_is_asked_about_whatever_was_shown_of_its_component(text, shown):
    with pytest.raises(InvalidFeedbackError, match="has no unit; say"):
        read_place(text, OutcomeFormat.metres(2), shown)


def test_the_unit_of_the_last_number_is_that_of_all_where_the_outcomes_is_smaller():
    shown = [[900.0, 100.0]]
    place = read_place("92 10 cm", OutcomeFormat(("x", "y"), ("mm", "mm")), shown)
    assert place == pytest.approx([920.0, 100.0])
    assert read_place("80 -20.5 cm", OutcomeFormat.metres(2)) == pytest.approx([0.8, -0.205])
