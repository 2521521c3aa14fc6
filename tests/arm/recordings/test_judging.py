"""Units are judged of each take and each channel on its own, and the odd ones are named."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError

T = np.arange(100) * 0.01


def takes(names, *ends, units=()):
    """One take for each row of numbers that its channels end at, from half of these."""
    s = 0.5 + 0.5 * np.linspace(0, 1, 100)[:, None]
    return [Recording(f"t{i}", T, s * np.array(end), names, units=u) for i, (end, u) in
            enumerate(zip(ends, units or [()] * len(ends), strict=True))]  # fmt: skip


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
    ],
)
def test_each_channel_is_asked_about_by_its_name_and_numbers(names, end, option):
    options = [one.option for one in select(takes(names, end, end)).ambiguities]
    assert {*options} == {f"--units {option}"}


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


def test_more_than_a_hundred_percent_is_refused_with_both_numbers():
    some = takes(("j1", "robotiq_pos"), (1, 220))
    with pytest.raises(ConfigurationError, match=r"reaches 220 in t0, .*a range has 100"):
        select(some, units=["rad", "percent"])
    assert select(some, units=["rad", "counts"]).units == ("rad", "counts")
