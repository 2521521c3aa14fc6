"""Published numbers say where they are from, and agree with one another."""

import numpy as np
import pytest

from prior_reinforce.arm.robots.limits import match_joints
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.plans.plan_format import PlanFormat

FIRMWARES = [("panda", "any"), ("fr3", ">=5.9"), ("fr3", "<5.9"), ("fr3", "any")]


def test_old_firmware_reaches_zero_speed_at_its_position_limit():
    # libfranka ends, to 8 mrad, where the documented range does: upper - offset^2 / (2 dec).
    limits = robot_limits("fr3", "<5.9")
    (e,) = limits.envelopes
    np.testing.assert_allclose(
        e.upper - e.offset**2 / (2 * e.deceleration), limits.upper, atol=1e-2
    )
    np.testing.assert_allclose(
        e.lower + e.offset**2 / (2 * e.deceleration), limits.lower, atol=1e-2
    )


def test_unknown_firmware_is_never_wider_than_a_known_one():
    narrow = robot_limits("fr3")
    q = np.random.default_rng(0).uniform(-3, 3, size=(500, 7))
    low, high = narrow.velocity_bounds(q)
    for firmware in (">=5.9", "<5.9"):
        wide = robot_limits("fr3", firmware)
        assert np.all(narrow.lower >= wide.lower)
        assert np.all(narrow.upper <= wide.upper)
        wide_low, wide_high = wide.velocity_bounds(q)
        assert np.all(low >= wide_low)
        assert np.all(high <= wide_high)


@pytest.mark.parametrize(("robot", "firmware"), FIRMWARES)
def test_every_table_says_where_it_is_from(robot, firmware):
    limits = robot_limits(robot, firmware)
    assert "frank" in limits.source
    assert len(limits.joint_names) == 7


def test_fer_is_the_panda():
    assert robot_limits("FER") is robot_limits("panda")


@pytest.mark.parametrize("robot", ["ur5e", "ur10e", "xarm6", "xarm7"])
def test_arms_without_published_accelerations_say_so(robot):
    limits = robot_limits(robot)
    assert limits.acceleration is None
    assert limits.jerk is None
    assert "not published" in limits.source
    assert limits.chain is not None


def test_an_so101_is_known_by_the_names_of_lerobot():
    limits = robot_limits("so101")
    form = PlanFormat((*limits.joint_names, "gripper.pos"), ("rad",) * 5 + ("percent",), 0.01)
    assert match_joints(form, limits) == {i: i for i in range(5)}
    # 110, 100, 95, 95 and 160 degrees either way; 42 turns a minute.
    assert np.rad2deg(limits.upper) == pytest.approx([110, 100, 95, 95, 160])
    assert np.rad2deg(limits.velocity) == pytest.approx(42 * 6)
    assert "STS3215" in limits.source
    assert limits.chain is None


@pytest.mark.parametrize(
    ("robot", "q", "place"),
    [
        # UR: stretched out along -x of the controller's base, so along +x of ROS's.
        ("ur5e", np.zeros(6), (0.425 + 0.3922, 0.1333 + 0.0996, 0.1625 - 0.0997)),
        ("ur10e", np.zeros(6), (0.6127 + 0.57155, 0.17415 + 0.11655, 0.1807 - 0.11985)),
        # xArm: upright elbow, forearm down again.
        ("xarm6", np.zeros(6), (0.0535 + 0.0775 + 0.076, 0, 0.267 + 0.2845 - 0.3425 - 0.097)),
        ("xarm7", np.zeros(7), (0.0525 + 0.0775 + 0.076, 0, 0.267 + 0.293 - 0.3425 - 0.097)),
    ],
)
def test_where_an_arm_ends_with_all_joints_at_zero(robot, q, place):
    np.testing.assert_allclose(tool_tip(robot_limits(robot).chain, q), place, atol=1e-9)


@pytest.mark.parametrize(("robot", "firmware"), [("ur5", "any"), ("fr3", "6.0"), ("panda", "4.2")])
def test_unknown_robots_and_firmwares_list_the_known(robot, firmware):
    with pytest.raises(ConfigurationError, match="known are"):
        robot_limits(robot, firmware)
