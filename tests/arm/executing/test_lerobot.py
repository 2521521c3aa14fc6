"""What LeRobot is asked, and what becomes of its answers; and its own SO-101 class on a bus."""

import json
import math
import os
import shlex
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.executing.base import ArmSettings
from prior_reinforce.arm.executing.drive import guiding_of, make_executor
from prior_reinforce.arm.executing.lerobot import LeRobotArm, LeRobotConfig
from prior_reinforce.errors import ConfigurationError, InvalidPlanError, RobotLimitError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks.so101 import LAG, SO101Shot
from simulators.feetech import GOAL_POSITION, PRESENT_POSITION, TORQUE_ENABLE
from simulators.so101 import Port, SimulatedSO101

COLUMNS = PlanFormat(("joint1.pos", "gripper.pos"), ("rad", "percent"), 0.02)


@pytest.fixture
def toy(tmp_path):
    """Start an arm whose LeRobot is `toy_bridge`."""
    python = tmp_path / "python"
    bridge = Path(__file__).with_name("toy_bridge.py")
    python.write_text(
        f"#!/bin/sh\nPYTHONPATH={shlex.quote(os.environ['PYTHONPATH'])} "
        f'exec {sys.executable} {shlex.quote(str(bridge))} "$@"\n'
    )
    python.chmod(0o755)
    started = []

    def start(kind="works", **settings):
        robot = {"type": "toy", "kind": kind, "folder": str(tmp_path)}
        arm = LeRobotArm(
            LeRobotConfig(robot=robot, python=str(python), **{"clock": "cycles"} | settings)
        )
        started.append(arm)
        return arm

    yield start
    for arm in started:
        arm.close()


def sent(tmp_path):
    return [json.loads(line)["joint1.pos"] for line in (tmp_path / "log").read_text().splitlines()]


def swing(travel=0.5, frames=21):
    s = np.linspace(0, 1, frames)
    course = 10 * s**3 - 15 * s**4 + 6 * s**5
    return Plan(np.column_stack([travel * course, np.full(frames, 20.0)]), COLUMNS)


def test_degrees_become_radians_and_a_gripper_keeps_its_per_cent(toy, tmp_path):
    arm = toy()
    assert arm.describe().units == ("rad", "percent")
    path = arm.run(swing())
    assert path.fault == ""
    assert path.q[-1] == pytest.approx([0.5, 20.0])
    assert max(sent(tmp_path)) == pytest.approx(math.degrees(0.5))
    assert arm.where() == pytest.approx([0.5, 20.0])


def test_goals_are_ahead_of_the_plan_by_the_lag(toy, tmp_path):
    arm, plan = toy(lag=0.1), swing()
    arm.run(plan)
    steady, ahead = sent(tmp_path), 20
    (tmp_path / "log").unlink()
    toy(lag=0.1, goals="as planned").run(plan)
    planned = sent(tmp_path)
    assert len(planned) == len(steady) == 41 + 30 + 50  # the plan, a wait, five times the lag
    speed = (planned[ahead + 1] - planned[ahead - 1]) / 0.02
    assert steady[ahead] == pytest.approx(planned[ahead] + 0.1 * speed, rel=1e-3)


def test_a_plan_that_is_followed_late_on_purpose_is_measured_as_that_plan(toy):
    arm = toy(lag=0.1, goals="as planned")
    path = arm.run(swing())
    assert path.t[0] == pytest.approx(-0.1)


def test_a_goal_beyond_the_calibrated_range_is_refused(toy):
    arm = toy()
    arm.check(swing(math.radians(89.9)))
    with pytest.raises(RobotLimitError, match=r"joint1\.pos would be sent to 1\.587 rad"):
        arm.check(swing(math.radians(90.9)))


def test_goals_that_come_too_seldom_to_make_the_motion_are_refused(toy):
    arm = toy(rate=4.0)
    with pytest.raises(InvalidPlanError, match="at 4 samples a second the plan is another motion"):
        arm.check(swing())


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("unplugged", "LeRobot: There is no status packet!"),
        ("crashes", "ended without a word"),
        ("clips", r"LeRobot sent joint1\.pos .* instead of"),
        ("forgets", r"LeRobot does not say where joint1\.pos is"),
        ("blocked", r"joint1\.pos is 0\.\d+ rad from where it should be"),
    ],
)
def test_what_goes_wrong_in_mid_swing_is_a_fault(toy, kind, said):
    path = toy(kind).run(swing(1.0))
    assert path.moved
    assert 0 < len(path.t) < 60
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(path.fault)


def test_a_goal_that_comes_late_in_a_swing_ends_the_motion(toy):
    path = toy("slow", clock="wall").run(swing(1.0))
    assert "ms late" in path.fault
    assert path.moved


def test_a_late_goal_that_leaves_out_little_does_not_and_what_is_overdue_is_not_sent(toy, tmp_path):
    path = toy("slow", clock="wall").run(swing(0.09))
    assert path.fault == ""
    assert path.q[-1, 0] == pytest.approx(0.09)
    assert len(sent(tmp_path)) == len(path.t) < 71 - 25  # of which 0.3 s came too late
    assert np.diff(path.t).min() > 0


def test_to_stop_is_to_hold_where_the_arm_is(toy, tmp_path):
    arm = toy()
    arm.stop()
    path = arm.run(swing())
    assert (path.fault, path.moved, len(path.t)) == ("it was asked to stop", False, 0)
    assert not (tmp_path / "log").exists()


def test_a_joint_that_is_not_seen_any_more_is_held_where_it_was_seen_last(toy, tmp_path):
    path = toy("forgets").run(swing(1.0))
    assert np.isfinite(path.q).all()
    assert np.isfinite(sent(tmp_path)).all()
    assert sent(tmp_path)[-1] == pytest.approx(math.degrees(path.q[-1, 0]))


def test_an_arm_that_jams_is_held_where_it_was_measured(toy, tmp_path):
    path = toy("blocked").run(swing(1.0))
    assert sent(tmp_path)[-1] == pytest.approx(math.degrees(path.q[-1, 0]))


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("not there", "LeRobot: Could not connect on port"),
        ("percent", r"joint1\.pos is in range_m100_100; set use_degrees"),
        ("mute", r"gripper\.pos is in a unit that LeRobot does not say"),
    ],
)
def test_an_arm_that_cannot_be_used_says_why(toy, kind, said):
    with pytest.raises(ConfigurationError, match=said):
        toy(kind)


def test_units_that_lerobot_does_not_say_are_given(toy):
    assert toy("mute", units={"gripper.pos": "range_0_100"}).describe().units[1] == "percent"


def test_a_python_that_is_not_there_is_named():
    options = {"robot": {"type": "so101_follower"}, "python": "/no/such/python"}
    with pytest.raises(ConfigurationError, match="cannot start '/no/such/python'"):
        make_executor(ArmSettings("lerobot", options))


@pytest.mark.parametrize(
    "options",
    [
        {"robot": {"port": "/dev/ttyACM0"}},
        {"robot": {"type": "so101_follower"}, "rate": 0},
        {"robot": {"type": "so101_follower"}, "lag": -0.1},
        {"robot": {"type": "so101_follower"}, "goals": "behind"},
        {},
    ],
)
def test_settings_that_cannot_be_are_refused(options):
    with pytest.raises(ConfigurationError):
        make_executor(ArmSettings("lerobot", options))


def test_a_guided_arm_says_what_its_leader_asks_for_and_where_it_is(toy):
    state = next(iter(toy("led").guide()))
    assert state.commanded == pytest.approx([math.radians(9.0), 9.0])
    assert state.measured == pytest.approx([0.0, 20.0])
    alone = next(iter(toy().guide()))
    assert np.array_equal(alone.commanded, alone.measured)


def test_an_arm_is_let_go_unless_a_leader_leads_it():
    robot = {"type": "so101_follower"}
    assert guiding_of(ArmSettings("lerobot", {"robot": robot})) == "let go"
    assert guiding_of(ArmSettings("lerobot", {"robot": robot, "leader": {"type": "x"}})) == "led"


@pytest.fixture
def serve(tmp_path):
    """A simulated SO-101 on a port, in lock-step with whoever reads it."""
    ports = []

    def start(landed=lambda rollout: None, **more):
        arm = SimulatedSO101(landed=landed)
        arm.advance(0.01)  # the first time takes longer than LeRobot waits for an answer
        port = Port(arm, tmp_path / "arm", lock_step=0.01, **more)
        thread = threading.Thread(target=port.serve)
        thread.start()
        ports.append((port, thread))
        return arm

    yield start
    for port, thread in ports:
        port.stop()
        thread.join(10)


def so101(lerobot, folder, **settings):
    """LeRobot's own class, in the Python that `make lerobot` makes."""
    robot = {
        "type": "so101_follower",
        "port": str(folder / "arm/port"),
        "id": "simulated",
        "calibration_dir": str(folder / "arm/calibration"),
    }
    config = LeRobotConfig(robot=robot, python=str(lerobot), lag=LAG, clock="cycles", **settings)
    return LeRobotArm(config)


def plan_of(frames, arm):
    """The task's plan, the gripper as it is."""
    description, here = arm.describe(), arm.where()
    columns = np.column_stack([frames, np.full(len(frames), here[5])])
    return Plan(columns, PlanFormat(description.columns, description.units, 0.02))


def line_to(arm, frame):
    s = np.linspace(0, 1, 76)[:, None]
    here = arm.where()[:5]
    return plan_of(here + (10 * s**3 - 15 * s**4 + 6 * s**5) * (frame - here), arm)


def _steps(arm):
    return [servo.word(PRESENT_POSITION) for servo in arm.servos.values()]


@pytest.mark.slow
def test_lerobots_own_so101_class_throws_as_the_task_does(serve, lerobot, tmp_path):
    landed, task = [], SO101Shot()
    simulated = serve(landed.append)
    frames = task.demonstrations("A").plans[4]
    for servo in simulated.servos.values():  # goals of long ago
        servo.write_word(GOAL_POSITION, servo.word(PRESENT_POSITION) + 200)
    before, arm = _steps(simulated), so101(lerobot, tmp_path)
    try:
        for _ in range(50):  # half a second of the arm's time
            arm.where()
        assert all(servo.memory[TORQUE_ENABLE] for servo in simulated.servos.values())
        assert _steps(simulated) == pytest.approx(before, abs=3)  # it did not jump there
        assert arm.describe().columns[:5] == task.format.names
        with pytest.raises(RobotLimitError, match="calibrated range"):
            arm.check(plan_of(frames - np.array([0, 0, 1.3, 0, 0]), arm))
        assert arm.run(line_to(arm, frames[0])).fault == ""
        plan = plan_of(frames, arm)
        arm.check(plan)
        path = arm.run(plan)
    finally:
        arm.close()
    assert path.fault == ""
    planned = np.array([np.interp(path.t, plan.times, column) for column in plan.actions.T]).T
    assert np.abs(path.q - planned)[:, :5].max() < 0.02
    (throw,) = landed
    expected = task.rollout(frames[None], None)[0].outcome
    assert throw.outcome == pytest.approx(expected, abs=0.005)


@pytest.mark.slow
def test_a_bus_that_dies_in_mid_swing_is_a_fault(serve, lerobot, tmp_path):
    serve(dies_after=100)
    arm = so101(lerobot, tmp_path)
    try:
        path = arm.run(line_to(arm, np.array([0.0, -0.5, -0.5, -0.5, 0.0])))
    finally:
        arm.close()
    assert path.fault.startswith("LeRobot: ")
    assert path.moved
    assert 0 < len(path.t) <= 100
