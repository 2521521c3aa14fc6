"""The UR's executor, through ur_rtde's own client, on the simulated controller."""

import contextlib
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

from prior_reinforce.arm.executing.drive import approach
from prior_reinforce.arm.executing.ur import UR, URConfig
from prior_reinforce.errors import ConfigurationError, InvalidPlanError, RobotLimitError
from prior_reinforce.plans.interpolation import join_frames
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from simulators import served
from simulators.ur import CYCLE, HOME

LAG = 0.03 + CYCLE
"""Of `servoj` in the simulation, and of the cycle until the client hears of it."""


@pytest.fixture(scope="module")
def server():
    with served.arm("ur") as program:
        yield program


@contextlib.contextmanager
def connected(server, **settings):
    arm = UR(URConfig(server.host, **settings))
    try:
        yield arm
    finally:
        arm.close()


@pytest.fixture
def arm(server):
    """At home."""
    with connected(server, lag=LAG) as made:
        if np.abs(made.where() - HOME).max() > 1e-4:
            assert made.run(approach(made.where(), np.array(HOME), made.describe())).fault == ""
        yield made


def swing(arm, start=HOME, travel=0.8, seconds=0.8):
    """Minimum jerk of the elbow by `travel` in `seconds`."""
    s = np.linspace(0, 1, round(seconds / 0.02) + 1)[:, None]
    shape = 10 * s**3 - 15 * s**4 + 6 * s**5
    form = PlanFormat(arm.describe().columns, ("rad",) * 6, 0.02)
    return Plan(np.array(start) + shape * travel * np.eye(6)[2], form)


def off(path, plan):
    """How far a measured path is from its plan at most, in [rad]."""
    planned = join_frames(plan.actions, plan.format.dt)(np.clip(path.t, 0, plan.times[-1]))
    return np.abs(path.q - planned).max()


@pytest.mark.parametrize(
    "options",
    [
        {"host": 5},
        {"host": "a", "model": "ur3"},
        {"host": "a", "lookahead": 0.02},
        {"host": "a", "gain": 5000.0},
        {"host": "a", "lag": -0.1},
    ],
)
def test_settings_are_checked(options):
    with pytest.raises(ConfigurationError):
        URConfig(**options)


def test_a_robot_that_does_not_answer_is_named_with_the_remedy():
    with pytest.raises(ConfigurationError, match=r"cannot reach the robot at 127\.0\.99\.9.*RTDE"):
        UR(URConfig("127.0.99.9"))


def test_set_points_ahead_by_the_lag_make_the_measured_motion_the_plan(arm):
    plan = swing(arm)
    arm.check(plan)
    path = arm.run(plan)
    assert (path.fault, path.moved) == ("", True)
    assert off(path, plan) < 0.005
    assert path.t[0] == 0
    assert np.diff(path.t).min() == pytest.approx(CYCLE)
    assert path.t[-1] > plan.times[-1]
    assert path.q[-1] == pytest.approx(plan.actions[-1], abs=1e-3)


def test_the_lag_is_said_to_a_few_milliseconds(server, arm, capfd):
    with connected(server) as without:
        path = without.run(swing(without))
        behind = int(re.search(r"set points (\d+) ms behind", capfd.readouterr().out)[1])
    assert behind == pytest.approx(1e3 * LAG, abs=4)
    assert off(path, swing(arm)) > 0.03


def test_a_plan_that_is_too_fast_is_refused_and_would_have_been_a_protective_stop(arm):
    fast = swing(arm, travel=1.2, seconds=0.6)
    with pytest.raises(RobotLimitError, match="velocity: elbow_joint"):
        arm.check(fast)
    with served.arm("ur") as own, connected(own) as made:
        path = made.run(fast)  # nobody asked `check`
        assert path.fault == "it is in a protective stop"
        assert path.moved
        assert path.t[-1] < 0.6
        with pytest.raises(ConfigurationError, match="cannot move, it is in a protective stop"):
            made.where()


def test_set_points_ahead_of_the_plan_are_checked_too(server, arm):
    """Ahead by 0.2 s, they are faster than the plan, and beyond the joint's end."""
    plan = swing(arm, travel=1.2, seconds=0.8)  # 2.8 of 3.14 rad/s
    arm.check(plan)
    with connected(server, lag=0.2) as early:
        with pytest.raises(RobotLimitError, match=r"run 0.2 s ahead .*velocity: elbow_joint"):
            early.check(plan)
        start = np.array(HOME)
        start[2] = np.pi - 0.5
        near = swing(arm, start=start, travel=0.45, seconds=0.6)
        arm.check(near)
        with pytest.raises(RobotLimitError, match=r"run 0.2 s ahead .*position: elbow_joint"):
            early.check(near)


def test_frames_between_two_set_points_are_not_left_out(arm):
    """Frames a millisecond apart, and set points every two."""
    plan = swing(arm)
    form = PlanFormat(plan.format.names, plan.format.units, 0.001)
    frames = np.tile(HOME, (401, 1))
    frames[100:300, 2] += 2e-4 * (np.arange(200) % 2)
    with pytest.raises(InvalidPlanError, match="is another motion"):
        arm.check(Plan(frames, form))


def test_a_motion_that_begins_elsewhere_is_not_begun(arm):
    before = arm.where()
    path = arm.run(swing(arm, start=np.array(HOME) + 0.01))
    assert (path.moved, len(path.t)) == (False, 0)
    assert "it stands 0.0100 rad off the plan" in path.fault
    assert arm.where() == pytest.approx(before, abs=1e-9)


def test_it_stops_in_mid_swing_when_it_is_asked_to():
    """By a signal's handler, as the executor's program is asked."""
    with served.arm("ur") as own, connected(own) as arm:
        before = signal.signal(signal.SIGALRM, lambda *_: arm.stop())
        moving = threading.Thread(target=lambda: (own.said(), signal.raise_signal(signal.SIGALRM)))
        moving.start()
        try:
            path = arm.run(swing(arm, seconds=60.0))
        finally:
            moving.join()
            signal.signal(signal.SIGALRM, before)
        assert path.fault == "stopped on request"
        assert path.t[-1] < 60
        with connected(own) as again:  # which says where it stands: no program of ours runs
            here = again.where()
            assert again.where() == pytest.approx(here, abs=1e-6)


def test_a_client_that_is_killed_in_mid_swing_leaves_an_arm_at_rest():
    """The controller's watchdog ends the program."""
    with served.arm("ur") as own:
        code = (
            "from tests.arm.executing.test_ur import UR, URConfig, swing; "
            f"arm = UR(URConfig({own.host!r})); arm.run(swing(arm, seconds=60.0))"
        )
        with subprocess.Popen([sys.executable, "-c", code]) as client:
            assert own.said() == "it follows set points"
            client.kill()
        assert own.said() == "the watchdog stopped the program"
        with connected(own) as arm:
            here = arm.where()
            assert arm.where() == pytest.approx(here, abs=1e-6)


def test_a_connection_that_dies_in_mid_swing_is_a_fault_of_a_motion():
    with served.arm("ur") as own, connected(own) as arm:
        ends = threading.Thread(target=lambda: (own.said(), own.program.kill()))
        ends.start()
        path = arm.run(swing(arm, seconds=60.0))
        ends.join()
        assert path.fault.startswith("the robot does not answer")
        assert path.moved
        assert np.all(path.t < 60)


def test_it_says_who_it_is_and_what_nobody_checks(arm):
    described = arm.describe()
    assert (described.model, described.rate) == ("ur5e", 500.0)
    assert described.columns[2] == "elbow_joint"
    assert {"torque", "self-collision"} <= {*described.unchecked}
