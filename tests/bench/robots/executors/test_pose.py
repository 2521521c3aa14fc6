"""Where the arm stands: a command says it, of every joint."""

import sys

import pytest

from prior_reinforce.bench.robots.executors.pose import read_pose
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


@pytest.mark.parametrize("command", ["false", "sh -c 'echo [1,2,3]; exit 1'", "sleep 60"])
def test_a_command_that_fails_says_nothing(command):
    with pytest.raises(ConfigurationError, match="did not say where the arm stands"):
        read_pose(command, FORM, time_limit=0.5)
