"""Where the arm stands: a command says it, of every joint."""

import sys

import pytest

from prior_reinforce.bench.robots.executors.pose import compare_pose, read_pose
from prior_reinforce.bench.robots.gate import GateSettings
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import PlanFormat

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="commands run there")
FORM = PlanFormat(("joint1", "joint2", "gripper"), ("rad", "rad", "m"), 0.01)


def says(text):
    return f"echo '{text}'"


def test_a_list_and_a_mapping_are_positions_by_column():
    assert read_pose(says("[1, 2, 3]"), FORM) == {"joint1": 1, "joint2": 2, "gripper": 3}
    assert read_pose(says('{"joint2": 2, "joint1": 1, "other": 0}'), FORM) == {
        "joint1": 1,
        "joint2": 2,
    }


@pytest.mark.parametrize(
    "pose", ['{"joint1": 0.1}', '{"joint1": 0.1, "panda_joint2": 0}', '{"gripper": 0}', "{}"]
)
def test_a_joint_that_is_left_out_is_refused(pose):
    with pytest.raises(ConfigurationError, match=r"says nothing of .*joint2 \[rad\]"):
        read_pose(says(pose), FORM)


@pytest.mark.parametrize(
    "line", ["", "ready", "[1, 2]", '{"joint1": "far"}', '{"joint1": NaN, "joint2": 0}']
)
def test_a_line_that_is_no_pose_is_refused(line):
    with pytest.raises(ConfigurationError, match="must end with a line of JSON such as"):
        read_pose(says(line), FORM)


@pytest.mark.parametrize("command", ["false", "sh -c 'echo [1,2,3]; exit 1'", "sleep 60"])
def test_a_command_that_fails_says_nothing(command):
    with pytest.raises(ConfigurationError, match="did not say where the arm stands"):
        read_pose(command, FORM, time_limit=0.5)


UNITS = ("rad", "m", "percent", "steps")
OF_UNITS = PlanFormat(("joint1", "rail", "gripper", "valve"), UNITS, 0.01)


@pytest.mark.parametrize(
    ("off", "said", "there"),
    [
        ((0.01, 0.005, 0.1, 0), "0.01 rad (joint1); 0.005 m (rail); 0.1 percent (gripper)", True),
        ((0.01, 0.005, -12.0, 0), "12 percent (gripper), more than 5; 0 steps", False),
        ((0.03, 0.005, 0.1, 0), "0.03 rad (joint1), more than 0.02; 0.005 m", False),
        ((0.01, -0.02, 0.1, 0), "0.02 m (rail), more than 0.01; ", False),
        ((0.01, 0.005, 0.1, 90), "90 steps (valve), which is held against nothing", False),
        ((float("nan"), 0.005, 0.1, 0), "inf rad (joint1), more than 0.02", False),
    ],
)
def test_units_are_never_compared_with_each_other(off, said, there):
    pose = dict(zip(OF_UNITS.names, off, strict=True))
    text, near = compare_pose(pose, [0.0] * 4, OF_UNITS, GateSettings())
    assert said in text
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
