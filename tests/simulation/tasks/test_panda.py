"""The arm against its published numbers: kinematics, limits, servo."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.simulation.tasks import panda

PANDA = robot_limits("panda")

SCENE = Path(panda.__file__).with_name("basketball.xml")

# Modified Denavit-Hartenberg parameters of the maker: a, d, alpha of each joint, then the flange.
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -np.pi / 2),
    (0.0, 0.316, np.pi / 2),
    (0.0825, 0.0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (0.088, 0.0, np.pi / 2),
]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return panda.build_scene(SCENE)


def flange(joints: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    for (a, d, alpha), theta in zip(DH, joints, strict=True):
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
        pose = pose @ np.array(
            [
                [ct, -st, 0, a],
                [st * ca, ct * ca, -sa, -d * sa],
                [st * sa, ct * sa, ca, d * ca],
                [0, 0, 0, 1],
            ]
        )
    return pose @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.107], [0, 0, 0, 1]])


def test_forward_kinematics_is_the_product_of_the_published_transforms(model):
    rng = np.random.default_rng(0)
    data = mujoco.MjData(model)
    for joints in rng.uniform(PANDA.lower, PANDA.upper, (50, 7)):
        data.qpos[:7] = joints
        mujoco.mj_kinematics(model, data)
        expected = flange(joints)
        np.testing.assert_allclose(data.site("panda/flange").xpos, expected[:3, 3], atol=1e-9)
        turned = data.body("panda/link7").xmat.reshape(3, 3)
        np.testing.assert_allclose(turned, expected[:3, :3], atol=1e-9)


def test_joint_ranges_of_the_model_are_the_published_ones(model):
    joints = [model.joint(f"panda/{name}") for name in panda.JOINT_NAMES]
    np.testing.assert_allclose([j.range[0] for j in joints], PANDA.lower)
    np.testing.assert_allclose([j.range[1] for j in joints], PANDA.upper)


def test_setpoints_interpolate_the_frames_at_rest_at_both_ends_and_hold():
    dt, rng = 0.0125, np.random.default_rng(1)
    plans = np.cumsum(rng.normal(0, 0.01, (2, 20, 7)), axis=1)
    position, velocity = panda.setpoints(plans, dt, 1000, lead_in=0.1)
    assert position.shape == velocity.shape == (2, 1000, 7)
    spline = CubicSpline(np.arange(20) * dt, plans[1], bc_type="clamped")
    np.testing.assert_allclose(position[1, 150], spline(0.05), atol=1e-12)
    np.testing.assert_allclose(velocity[1, 150], spline(0.05, 1), atol=1e-9)
    np.testing.assert_array_equal(position[:, :100], np.repeat(plans[:, :1], 100, axis=1))
    np.testing.assert_allclose(position[:, -1], plans[:, -1], atol=1e-12)
    np.testing.assert_allclose(velocity[:, 340:], 0.0, atol=1e-9)


def test_gravity_is_compensated(model):
    data = mujoco.MjData(model)
    start = np.array([0.3, -0.5, 0.2, -1.8, 0.1, 1.9, 0.5])
    data.qpos[:7] = start
    data.ctrl[:] = start
    data.qpos[model.joint("ball").qposadr[0] + 2] = 3.0  # the ball falls elsewhere
    data.qpos[model.joint("ball").qposadr[0]] = 3.0
    for _ in range(500):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos[:7], start, atol=1e-6)


def test_the_servo_follows_a_constant_velocity_without_lag(model):
    """With velocity feed-forward only friction's share of the error is left: damping * dq / kp."""
    times = np.arange(161) * 0.0125
    plan = np.tile([0.0, -0.3, 0.0, -1.8, 0.0, 1.9, 0.0], (161, 1))
    plan[:, 0] = 0.5 * (times - 0.2 * (1 - np.exp(-times / 0.2)))  # reaches 0.5 rad/s smoothly
    controls = panda.servo_controls(model, plan[None], 0.0125, 1800)[0]
    wanted, _ = panda.setpoints(plan[None], 0.0125, 1801)  # the last is where the arm then is
    data = mujoco.MjData(model)
    data.qpos[:7] = plan[0]
    data.qpos[model.joint("ball").qposadr[0]] = 3.0
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
    lag = wanted[0, -1, 0] - data.qpos[0]
    assert lag == pytest.approx(1.0 * 0.5 / 600, rel=0.05)
