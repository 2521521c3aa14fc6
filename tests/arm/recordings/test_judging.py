"""Units are judged of each channel on its own, by its name and its numbers."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.errors import ConfigurationError
from tests.arm.recordings.recorded import takes


@pytest.mark.parametrize(
    ("names", "end", "option"),
    [
        (("A1", "A2", "A3", "E1"), (40, -90, 80, 700), "deg deg deg UNIT"),
        (("A1", "A2", "A3", "E1"), (40, -90, 80, 0.7), "deg deg deg UNIT"),
        (("base_yaw", "j1", "j2", "j3"), (80, 0.4, -1.6, 1.2), "deg rad rad rad"),
        (("foo", "j1", "j2", "j3"), (80, 0.4, -1.6, 1.2), "percent rad rad rad"),
        (("foo", "j1", "j2", "j3"), (180, 0.4, -1.6, 1.2), "UNIT rad rad rad"),
        (("j1", "j2", "j3", "robotiq_pos"), (0.4, -1.6, 1.2, 220), "rad rad rad UNIT"),
        (("j1", "j2", "j3", "gripper_yaw"), (0.4, -1.6, 1.2, 70), "rad rad rad deg"),
        (("wrist_flex", "index_finger_mcp"), (20, 75), "deg"),
        (("J1", "J2", "J3", "J4"), (28, -46, 120, 86), "deg deg UNIT deg"),
        (("theta1", "theta2", "d3", "theta4"), (28, -46, 120, 86), "deg deg UNIT deg"),
        (("x", "y", "z", "r"), (210, 90, 60, 40), "mm mm mm deg"),
    ],
)
def test_each_channel_is_asked_about_by_its_name_and_numbers(names, end, option):
    options = [one.option for one in select(takes(names, end, end)).ambiguities]
    assert {*options} == {f"--units {option}"}


def test_increments_are_judged_by_the_way_that_they_sum_to():
    n = len(takes(("dx", "dyaw"), (0, 0))[0].times)
    some = takes(("dx", "dy", "dyaw"), (400 / n, 20 / n, 60 / n))
    assert {one.option for one in select(some).ambiguities} == {"--units mm mm deg"}
    assert select(takes(("dx", "dyaw"), (0.4 / n, 1 / n))).ambiguities == ()


def test_speeds_faster_than_an_arm_are_per_second_in_another_unit():
    (asked,) = select(takes(("vx", "wz"), (0.4, 90))).ambiguities
    assert asked.option == "--units m/s deg/s"
    assert select(takes(("vx", "wz"), (0.4, 90)), units=["m/s", "deg/s"]).units == ("m/s", "rad/s")


def test_a_matrix_beside_joints_in_degrees_is_neither_angle_nor_percent():
    names = [f"J{i}" for i in range(1, 7)] + [f"R{i}{k}" for i in (1, 2, 3) for k in (1, 2, 3)]
    end = (10, -90, 90, 5, 30, 20, 0.9, -0.3, 0, 0.3, 0.9, 0, 0, 0, 1)
    (asked,) = select(takes(names, end, end)).ambiguities
    assert asked.option == f"--units {'deg ' * 6}{'1 ' * 9}".strip()
    units = asked.option.split()[1:]
    assert select(takes(names, end), units=units).units == ("rad",) * 6 + ("1",) * 9


def test_an_axis_that_may_slide_is_not_taken_in_degrees_with_the_joints():
    (asked,) = select(takes(("A1", "A2", "E1"), (40, -90, 700)), units=["deg"]).ambiguities
    assert asked.option == "--units deg deg UNIT"
    with pytest.raises(ConfigurationError, match="UNIT stands for the unit of E1, which only you"):
        select(takes(("A1", "A2", "E1"), (40, -90, 700)), units=["deg", "deg", "UNIT"])
    each = select(takes(("A1", "A2", "E1"), (40, -90, 700)), units=["deg", "deg", "mm"])
    assert (each.units, each.ambiguities) == (("rad", "rad", "m"), ())


def test_the_third_joint_of_four_is_no_slide_in_radians_or_if_its_unit_is_given():
    some = takes(("J1", "J2", "J3", "J4"), (0.4, -1.6, 1.2, 1))
    assert select(some, units=["rad"]).ambiguities == select(some).ambiguities == ()
    some = takes(("J1", "J2", "J3", "J4"), (28, -46, 120, 86))
    (asked,) = select(some, units=["deg"]).ambiguities
    assert asked.option == "--units deg deg UNIT deg"
    assert select(some, units=["deg", "deg", "mm", "deg"]).ambiguities == ()


def test_lengths_of_a_robot_are_in_mm_where_they_are_not_in_m():
    some = takes(("rail", "lift", "gripper"), (280, 60, 25))
    found = select(some, some[0].names, some[0].names, plan_units=("m",) * 3)
    assert {one.option for one in found.ambiguities} == {"--units mm"}
    assert select(some, units=["cm"], plan_units=("m",) * 3).ambiguities == ()


def test_a_joint_that_is_in_radians_beside_others_in_degrees_is_named():
    names = tuple(f"joint{i}" for i in range(1, 5))
    found = select(takes((*names, "joint5"), (40, -90, 120, 30, 0.8)), units=["deg"])
    (said,) = found.remarks
    assert "joint5 of t0 reaches 0.8 deg" in said
    assert said.endswith("--units deg deg deg deg rad")
    assert select(takes((*names, "joint5"), (40, -90, 120, 30, 0.01)), units=["deg"]).remarks == ()


def test_more_than_a_hundred_percent_is_refused_with_both_numbers():
    some = takes(("j1", "robotiq_pos"), (1, 220))
    with pytest.raises(ConfigurationError, match=r"robotiq_pos of t0 reaches 220, .*range has 100"):
        select(some, units=["rad", "percent"])
    assert select(some, units=["rad", "counts"]).units == ("rad", "counts")


def test_one_unit_for_all_is_not_taken_for_what_cannot_be_in_it():
    """A quaternion beside joints in degrees stays a quaternion."""
    names = ("j1", "j2", "qx", "qy", "qz", "qw")
    found = select(takes(names, (40, -90, 0, 0, 0.6, 0.8)), units=["deg"])
    assert (found.units, found.ambiguities) == (("rad", "rad", "1", "1", "1", "1"), ())


def test_coordinates_of_one_place_are_in_one_unit():
    (asked,) = select(takes(("x", "y", "z", "j1"), (450, 0.5, 3, 1))).ambiguities
    assert asked.option == "--units mm mm mm rad"
    assert "x, y, z in m would reach 450 (x of t0), which no arm does: it looks like mm" in (
        asked.what
    )


def test_what_no_arm_does_is_asked_about_beside_a_quaternion_too():
    names = ("j1", "j2", "qx", "qy", "qz", "qw")
    (asked,) = select(takes(names, (60, -90, 0, 0, 0.6, 0.8)), units=["rad"]).ambiguities
    assert asked.option == "--units deg deg 1 1 1 1"


def test_an_angle_that_is_stated_in_degrees_is_not_doubted_with_others():
    found = select(takes(("j1", "j2"), (40, 53), units=[("deg", None)]))
    assert (found.recorded_units, found.remarks) == (("deg", "deg"), ())
    assert [one.option for one in found.ambiguities] == ["--units deg"]


@pytest.mark.parametrize(
    ("end", "option"), [((0.4, -1.6, 33), "rad rad UNIT"), ((30, 4, 90), "deg")]
)
def test_one_joint_of_a_robot_that_counts_turns_is_not_all_in_degrees(end, option):
    names = ("pan", "lift", "spin")
    found = select(takes(names, end, end), names, names, plan_units=("rad",) * 3)
    assert [one.option for one in found.ambiguities] == [f"--units {option}"]


def test_a_gripper_of_another_range_is_told_how_to_say_it():
    names, plan = ("j1", "gripper"), ("rad", "percent")
    (asked,) = select(takes(names, (1, 900)), names, names, plan_units=plan).ambiguities
    assert "'0.1 percent' if its range is 0 to 1000" in asked.what
    found = select(takes(names, (1, 900)), names, names, ["rad", "0.1 percent"], plan)
    assert max(r.positions[:, 1].max() for r in found.recordings) == 90


def test_a_unit_of_two_words_is_one_word_of_the_command_that_is_printed():
    """Joints in rad beside one that was said in hundredths of a degree, and a gripper unsaid."""
    ends = (0.4, -1.6, 220)
    told = select(takes(("j1", "j2", "robotiq_pos"), ends, units=[("0.01 deg", None, None)]))
    assert {one.option for one in told.ambiguities} == {"--units '0.01 deg' rad UNIT"}


@pytest.mark.parametrize("most", [0.8, 1.0, 1.05])
def test_a_gripper_of_0_to_1_is_asked_about_though_it_reaches_all_of_it(most):
    names, plan = ("j1", "gripper"), ("rad", "percent")
    (asked,) = select(takes(names, (1, most)), names, names, plan_units=plan).ambiguities
    assert asked.option == "--units rad share"


@pytest.mark.parametrize(
    ("plan", "most", "unit"),
    [
        ("mm", 0.08, "m"),
        ("mm", 8, None),
        ("m", 0.08, None),
        ("m", 0.8, "UNIT"),
        ("m", 80, "mm"),
        ("share", 80, "percent"),
        ("share", 1.05, None),
        ("percent", 0.08, "UNIT"),  # a share, or metres
        ("percent", 1.4, "UNIT"),  # radians
        ("percent", 80, None),
    ],
)
def test_an_opening_that_no_gripper_has_is_in_another_unit(plan, most, unit):
    names, units = ("j1", "gripper"), ("rad", plan)
    asked = select(takes(names, (1, most)), names, names, plan_units=units).ambiguities
    assert [one.option for one in asked] == [f"--units rad {unit}"] * (unit is not None)


def test_radians_in_columns_that_say_degrees_are_remarked_on():
    found = select(takes(("j1", "j2"), (1.2, -1.6), units=[("deg", "deg")]))
    assert found.ambiguities == ()
    (said,) = found.remarks
    assert "j2 of t0 reaches 1.6 deg, which is hardly a motion (in rad it is one)" in said
    assert select(takes(("j1", "j2"), (1.2, -16), units=[("deg", "deg")])).remarks == ()
    place = takes(("x", "y", "z", "yaw"), (0.4, 0.1, 0.2, 2), units=[("m", "m", "m", "deg")])
    assert select(place).remarks == ()


SO101 = ("shoulder_pan.pos", "shoulder_lift.pos", "elbow_flex.pos", "gripper.pos")


@pytest.mark.parametrize("most", [53.0, 100.0, 104.0])
def test_what_may_be_degrees_or_shares_of_a_range_is_never_guessed(most):
    some = takes(SO101, (20, -most, 40, 70), (-20, 30, 40, 60))
    (joints, gripper) = select(some, normalised=True).ambiguities
    assert joints.option == gripper.option == "--units UNIT UNIT UNIT percent"
    assert not joints.guessed
    assert all(text in joints.what for text in ("deg", "-100 to 100", "0 to 100", "--robot none"))
    degrees = select(some, units=["deg", "deg", "deg", "percent"], normalised=True)
    assert (degrees.units, degrees.ambiguities) == (("rad",) * 3 + ("percent",), ())
    assert any("-100 to 100" in remark for remark in degrees.remarks)


def test_beyond_a_range_are_degrees():
    (joints, _) = select(takes(SO101, (20, -130, 40, 70)), normalised=True).ambiguities
    assert (joints.option, joints.guessed) == ("--units deg deg deg percent", True)


@pytest.mark.parametrize(
    ("largest", "option"),
    [((2300, 1700, 550), "--units UNIT"), ((80, 60, 1700), "--units deg deg UNIT")],
)
def test_a_joint_beside_others_in_no_known_unit_is_not_in_degrees(largest, option):
    for names, units in ((("joint1", "joint2", "joint3"), None), (("a1", "a2", "a3"), ["rad"] * 3)):
        doubts = select(takes(names, largest), plan_units=units).ambiguities
        assert {one.option for one in doubts} == {option}


def test_one_unit_of_a_plan_holds_for_all_joints():
    found = select(takes(SO101, (20, -53, 40, 70)), plan_units=("percent",), normalised=True)
    assert (found.units, found.ambiguities) == (("percent",) * 4, ())


def test_joints_that_all_fill_a_range_were_normalised():
    names = ("pan", "lift", "elbow")
    t = np.linspace(-1, 1, 100)
    some = [Recording("t0", t, np.outer(t, [1, -1, 0.5]), names)]
    some += [Recording("t1", t, np.outer(t**3, [0.9, -0.8, 0.5]), names)]
    (asked,) = select(some).ambiguities
    assert (asked.option, asked.guessed) == ("--units UNIT UNIT rad", False)
    assert "normalised" in asked.what
    assert select(some, units=["rad"]).ambiguities == ()
    one = [replace(r, positions=r.positions * [1, 0.9, 1.1]) for r in some]
    assert select(one).ambiguities == ()
    still = np.full((len(t), 2), -0.5)
    held = [np.column_stack([r.positions[:, :2], still]) for r in some]
    held = [Recording(r.episode, t, q, (*names, "roll")) for r, q in zip(some, held, strict=True)]
    (asked,) = select(held).ambiguities
    assert asked.option == "--units UNIT UNIT rad rad"


def test_joints_of_a_mean_of_0_and_a_deviation_of_1_were_normalised():
    t = np.arange(100) * 0.01
    q = np.column_stack([t, t**2, np.sin(3 * t)])
    q = (q - q.mean(axis=0)) / q.std(axis=0)
    (asked,) = select([Recording("t", t, q, ("pan", "lift", "elbow"))]).ambiguities
    assert asked.option == "--units UNIT"


def test_an_opening_below_0_is_asked_about():
    names, units = ("j1", "gripper"), ("rad", "percent")
    some = takes(names, (1, 1), (1, -1))
    (asked,) = select(some, names, names, plan_units=units).ambiguities
    assert (asked.option, asked.guessed) == ("--units rad UNIT", False)
    assert select(takes(names, (1, 90), (1, -3)), names, names, plan_units=units).ambiguities == ()


@pytest.mark.parametrize(("most", "unit"), [(2961, "0.088 deg"), (47370, "0.0055 deg")])
def test_counts_are_asked_about_with_what_one_is(most, unit):
    names = ("pan", "lift", "elbow")
    asked = select(takes(names, (most, 0.8 * most, 0.7 * most))).ambiguities
    assert {one.option for one in asked} == {"--units UNIT"}
    assert any(f"'{unit}' for" in one.what for one in asked)


def test_speeds_of_one_recorder_are_in_one_unit():
    names = ("pan", "vel_1_cmd", "vel_2_cmd", "vel_3_cmd")
    (asked,) = select(takes(names, (1, 80, 9, 3))).ambiguities
    assert asked.option == "--units rad deg/s deg/s deg/s"
    assert select(takes(names, (1, 8, 9, 3))).ambiguities == ()
