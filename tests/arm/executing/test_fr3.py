"""The FR3's executor, through libfranka's own client, on the simulated arm and its limits."""

import contextlib
import itertools
import os
import re
import signal
from types import SimpleNamespace

import numpy as np
import pylibfranka
import pytest

from prior_reinforce.arm.executing.drive import approach
from prior_reinforce.arm.executing.fr3 import FR3, FR3Config
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError, RobotLimitError
from prior_reinforce.plans.interpolation import interpolate
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task
from simulators import served

TASK = make_task("basketball-fr3")
READY = TASK.demonstrations("A").plans[0, 0]
FORM = TASK.format


@pytest.fixture(autouse=True)
def usual_priority():
    """libfranka lets its thread run before all others; later tests would starve what they start."""
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@pytest.fixture(scope="module")
def server():
    with served.fr3() as program:
        yield program


@contextlib.contextmanager
def connected(server):
    """One client; between two, the ball is put back into the spoon."""
    arm = FR3(FR3Config(server.host))
    try:
        yield arm
    finally:
        arm.close()


@pytest.fixture
def arm(server):
    with connected(server) as made:
        yield made


def swing(start, travel, seconds):
    """Minimum jerk of joint 4 by `travel` in `seconds`."""
    s = np.linspace(0, 1, round(seconds / FORM.dt) + 1)[:, None]
    shape = 10 * s**3 - 15 * s**4 + 6 * s**5
    return Plan(start + shape * travel * np.eye(7)[3], FORM)


def go_to(arm, place):
    """Slowly, as `drive` does."""
    if np.abs(arm.where() - place).max() > 0:
        assert arm.run(approach(arm.where(), place, arm.describe())).fault == ""


@pytest.mark.parametrize(
    "options",
    [
        {"host": 5},
        {"host": "a", "collision_thresholds": (20.0, 0.0)},
        {"host": "a", "firmware": "4"},
    ],
)
def test_settings_are_checked(options):
    with pytest.raises(ConfigurationError):
        FR3Config(**options)


def test_a_robot_that_does_not_answer_is_named_with_the_remedy():
    with pytest.raises(ConfigurationError, match=r"cannot reach the robot at 127\.0\.99\.9.*FCI"):
        FR3(FR3Config("127.0.99.9"))


def test_a_throw_follows_its_plan_and_lands_as_without_a_network(server):
    plan = Plan(TASK.demonstrations("A").plans[2], FORM)
    there = TASK.rollout(plan.actions[None], None)[0].outcome
    with connected(server) as arm:
        go_to(arm, plan.actions[0])
    with connected(server) as arm:
        arm.check(plan)
        path = arm.run(plan)
    assert (path.fault, path.moved) == ("", True)
    planned = interpolate(plan.actions, FORM.dt, hold_after=0.2).q
    assert np.abs(path.q - planned[: len(path.q)]).max() < 0.005
    assert np.diff(path.t) == pytest.approx(0.001)
    landed = re.findall(r"-?\d+\.\d+", server.said())
    assert np.array(landed, float) == pytest.approx(there, abs=2e-4)


def test_what_the_arm_would_abort_is_refused_before(arm):
    """The limit of FR3's motion generator is 10 rad/s^2: a hundredth above and below."""
    start = READY - 0.7 * np.eye(7)[3]  # where no velocity bound is near
    travel = 0.6
    peak = 10 / np.sqrt(3) * travel  # of a minimum-jerk motion of a second, in [rad/s^2]
    limit = robot_limits("fr3").acceleration[3]
    for share in (0.99, 1.01):
        seconds = np.sqrt(peak / (share * limit))
        n = round(seconds / FORM.dt)
        form = PlanFormat(FORM.names, FORM.units, seconds / n)
        plan = Plan(swing(start, travel, n * FORM.dt).actions, form)
        if share < 1:
            arm.check(plan)
        else:
            with pytest.raises(RobotLimitError, match="acceleration: joint4"):
                arm.check(plan)


def test_a_reflex_is_told_in_the_arms_words_and_recovered_from_once(arm):
    go_to(arm, READY)
    path = arm.run(swing(arm.where(), -0.6, 0.45))  # nobody asked `check`
    assert "joint_motion_generator_velocity_discontinuity" in path.fault
    # It is refused as soon as it is too fast: most of the motion is never made.
    assert path.t[-1] < 0.2
    here = arm.where()
    assert arm.run(swing(here, -0.3, 1.0)).fault == ""
    assert arm.where() == pytest.approx(here - 0.3 * np.eye(7)[3], abs=1e-3)


def test_what_is_added_to_begin_where_it_stands_is_checked_too(arm):
    """4.9 mrad within 0.2 s take 0.7 rad/s^2, which a plan at 99 % of its limit does not leave."""
    go_to(arm, READY - 0.7 * np.eye(7)[3])  # where no velocity bound is near
    here = arm.where()
    seconds = np.sqrt(10 / np.sqrt(3) * 0.6 / (0.99 * robot_limits("fr3").acceleration[3]))
    n = round(seconds / FORM.dt)
    form = PlanFormat(FORM.names, FORM.units, seconds / n)
    plan = Plan(swing(here - 0.0049 * np.eye(7)[3], 0.6, n * FORM.dt).actions, form)
    arm.check(plan)
    path = arm.run(plan)
    assert (path.moved, len(path.t)) == (False, 0)
    assert path.fault.startswith("from where it stands, acceleration: joint4 at 10.")
    assert arm.where() == pytest.approx(here, abs=1e-9)


def test_a_motion_that_begins_elsewhere_is_not_begun(arm):
    before = arm.where()
    path = arm.run(swing(before + 0.01, -0.3, 1.0))
    assert (path.moved, len(path.t)) == (False, 0)
    assert "it stands 0.0100 rad off the plan" in path.fault
    assert arm.where() == pytest.approx(before, abs=1e-9)


def test_it_stops_in_mid_swing_when_it_is_asked_to(server):
    with connected(server) as arm:
        go_to(arm, READY)
        _stops(arm)
        assert "stopped" in arm.run(swing(arm.where(), -0.1, 1.0)).fault  # it moves no more
    with connected(server) as arm:
        assert arm.run(swing(arm.where(), -0.1, 1.0)).fault == ""


def _stops(arm):
    before = signal.signal(signal.SIGALRM, lambda *_: arm.stop())
    signal.setitimer(signal.ITIMER_REAL, 1.0)
    try:
        path = arm.run(swing(READY, -0.6, 4.0))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert path.fault == "stopped on request"
    assert path.t[-1] < 4.0
    assert path.moved == (np.abs(path.q - READY).max() > 0.002)


@pytest.mark.parametrize("kind", ["works", "trips"])
def test_collision_thresholds_hold_for_a_motion_and_are_set_back_after_it(
    server, monkeypatch, kind
):
    thresholds = []

    class Robot(pylibfranka.Robot):
        def set_collision_behavior(self, *given):
            thresholds.append([values[0] for values in given])
            super().set_collision_behavior(*given)

    monkeypatch.setattr(pylibfranka, "Robot", Robot)
    arm = FR3(FR3Config(server.host, collision_thresholds=(60.0, 80.0)))
    try:
        here = arm.where()
        assert thresholds == []  # who only looks sets nothing
        path = arm.run(swing(here, 0.1, 1.0) if kind == "works" else swing(here, -0.6, 0.45))
    finally:
        arm.close()
    assert (path.fault == "") == (kind == "works")
    assert thresholds == [[60.0, 60.0, 80.0, 80.0], [20.0] * 4]


def test_a_connection_that_dies_in_mid_swing_is_a_fault_of_a_motion():
    with served.fr3() as program:
        arm = FR3(FR3Config(program.host))
        before = signal.signal(signal.SIGALRM, lambda *_: program.program.kill())
        signal.setitimer(signal.ITIMER_REAL, 0.5)
        try:
            path = arm.run(swing(READY, -0.6, 4.0))
        finally:
            signal.signal(signal.SIGALRM, before)
        assert path.moved
        assert re.search("(?i)connection|timeout|receive", path.fault)
        assert np.all(path.t < 4.0)  # none was read where it died at once
        with pytest.raises(ConfigurationError, match="the robot does not answer"):
            arm.where()


def test_it_says_who_it_is_and_what_nobody_checks(arm):
    described = arm.describe()
    assert (described.model, described.rate) == ("fr3", 1000.0)
    assert described.columns == FORM.names
    assert {"torque", "self-collision"} <= {*described.unchecked}


def test_while_it_is_guided_it_says_what_it_measures_by_its_own_clock(arm):
    states = list(itertools.islice(arm.guide(), 20))
    t = np.array([state.t for state in states])
    assert t[0] == 0
    assert np.diff(t).min() > 0.0044
    assert np.round(t / 0.001) * 0.001 == pytest.approx(t, abs=1e-6)
    assert states[-1].measured == pytest.approx(arm.where(), abs=1e-3)


@pytest.mark.parametrize(
    ("mode", "says"),
    [("UserStopped", "its stop button is pressed"), ("Guiding", "it is in mode Guiding")],
)
def test_a_robot_that_is_in_no_state_to_move_says_which(arm, monkeypatch, mode, says):
    state = SimpleNamespace(robot_mode=getattr(pylibfranka.RobotMode, mode))
    monkeypatch.setattr(arm, "_robot", SimpleNamespace(read_once=lambda: state))
    with pytest.raises(ConfigurationError, match=f"cannot move, {says}; see to it, then ask again"):
        arm.where()


def test_a_robot_that_is_gone_while_it_is_guided_says_so(arm, monkeypatch):
    def lost():
        raise pylibfranka.FrankaException("libfranka: UDP receive: Timeout")

    monkeypatch.setattr(arm, "_robot", SimpleNamespace(read_once=lost))
    with pytest.raises(ConfigurationError, match="does not answer: UDP receive: Timeout"):
        next(arm.guide())
