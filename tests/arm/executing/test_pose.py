"""Where the arm stands, held against a plan's first frame unit by unit."""

import pytest

from prior_reinforce.arm.executing.pose import compare_pose
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.plans.plan_format import PlanFormat

UNITS = ("rad", "m", "percent", "steps")
OF_UNITS = PlanFormat(("joint1", "rail", "gripper", "valve"), UNITS, 0.01)


@pytest.mark.parametrize(
    ("off", "said", "there"),
    [
        ((0.01, 0.005, 0.1, 0), "0.005 m (rail), 0.1 percent (gripper)", True),
        (
            (0.01, 0.005, -12.0, 0),
            "12 percent (gripper); 5 is allowed, 0 steps",
            False,
        ),
        (
            (0.03, 0.005, 0.1, 0),
            "0.03 rad (joint1); 0.02 is allowed, 0.005 m",
            False,
        ),
        ((0.01, -0.02, 0.1, 0), "0.02 m (rail); 0.01 is allowed, ", False),
        (
            (0.01, 0.005, 0.1, 90),
            "90 steps (valve), which is held against nothing",
            False,
        ),
        (
            (float("nan"), 0.005, 0.1, 0),
            "inf rad (joint1); 0.02 is allowed",
            False,
        ),
    ],
)
def test_units_are_never_compared_with_each_other(off, said, there):
    pose = dict(zip(OF_UNITS.names, off, strict=True))
    text, near = compare_pose(pose, [0.0] * 4, OF_UNITS, GateSettings())
    assert said in text.replace(" from the start pose", "")
    assert near == there


def test_a_joint_that_is_no_number_is_not_there_whatever_the_others_are():
    form = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.01)
    for pose in ({"joint1": float("nan"), "joint2": 0.0}, {"joint1": 0.0, "joint2": float("nan")}):
        assert not compare_pose(pose, [0.0, 0.0], form, GateSettings())[1]


def test_a_unit_may_be_given_its_own_error():
    own = GateSettings(errors=(("steps", 40.0, 40.0),), start_error=0.1)
    for steps, near in ((39, True), (41, False)):
        pose = {"joint1": 0.09, "valve": steps}
        assert compare_pose(pose, [0.0] * 4, OF_UNITS, own)[1] == near
