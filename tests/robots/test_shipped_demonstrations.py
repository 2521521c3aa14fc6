"""The demonstrations of the joint-space tasks pass the gate of the arm they are for."""

from pathlib import Path

import pytest

import prior_reinforce.tasks
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.robots import check_plan, robot_limits

SETS = sorted((Path(prior_reinforce.tasks.__file__).parent / "demonstrations").glob("*.npz"))


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_they_pass(path):
    demos = Demonstrations.load(path)
    if "joint1" not in demos.format.names:
        pytest.skip("plans are no joint positions; inverse kinematics answers for the arm's limits")
    for frames in demos.plans:
        check_plan(Plan(frames, demos.format), robot_limits("panda"), demos).require()
