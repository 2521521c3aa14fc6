"""Basketball on the FR3: its plans stay within what the FR3's interface allows."""

import numpy as np
import pytest

from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.plans.motions import Plan
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.simulation.tasks.basketball import BasketballShot


def test_demonstrations_keep_half_of_the_accelerations_unused():
    task = make_task("basketball-fr3")
    for name in task.demonstration_sets:
        demos = task.demonstrations(name)
        assert demos.n == 6
        for plan in demos.plans:
            report = check_plan(Plan(plan, demos.format), robot_limits("fr3"), demos)
            assert not report.refused
            line = next(line for line in report.lines if line.check == "acceleration")
            assert line.value <= 0.5 * line.limit


def test_its_servo_is_stiffer_and_nothing_else_differs():
    fr3, v1 = make_task("basketball-fr3"), BasketballShot()
    assert np.all(fr3.model.actuator_gainprm[:, 0] > 5 * v1.model.actuator_gainprm[:, 0])
    assert fr3.model.body_mass == pytest.approx(v1.model.body_mass)
    assert fr3.tolerance == v1.tolerance
