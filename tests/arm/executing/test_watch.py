"""Reading an arm that is guided, from another process; and the takes that are cut."""

import numpy as np
import pytest

from prior_reinforce.arm.executing.base import ArmSettings, GuidedState
from prior_reinforce.arm.executing.lock import executing_lock, stop_executing
from prior_reinforce.arm.executing.result import lag_behind
from prior_reinforce.arm.executing.watch import Take, Watch
from prior_reinforce.arm.recordings import read_recordings
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.plan_format import PlanFormat
from tests.arm.executing.toy_arm import TOY

pytestmark = pytest.mark.usefixtures("toy_plugin")
FORMAT = PlanFormat(("joint2", "joint1"), ("rad", "rad"), 0.02)


def arm(folder, **options):
    return ArmSettings(TOY, {"folder": str(folder), **options})


@pytest.fixture
def lock():
    with executing_lock() as lock:
        yield lock


def test_states_come_with_the_arms_own_times(tmp_path, lock):
    with Watch(arm(tmp_path, led=True), lock) as watch:
        assert watch.arm.columns == ("joint1", "joint2")
        states = [watch.next(20.0) for _ in range(151)]
    assert [state.t for state in states] == pytest.approx(np.arange(151) / 100)
    assert np.all(states[150].commanded != states[150].measured)


def test_an_arm_that_is_not_there_says_why(tmp_path, lock):
    with pytest.raises(ConfigurationError, match="does not answer; switch it on"):
        Watch(arm(tmp_path, kind="dead"), lock)


def test_an_arm_that_is_unplugged_says_so_after_what_it_said(tmp_path, lock):
    with Watch(arm(tmp_path, kind="unplugged"), lock) as watch:
        for _ in range(50):
            assert watch.next(20.0) is not None
        with pytest.raises(ConfigurationError, match="does not answer any more"):
            watch.next(20.0)


def test_the_program_ends_with_whoever_listens(tmp_path, lock):
    watch = Watch(arm(tmp_path, seconds=0.01), lock)
    watch.__exit__()
    assert watch._process.returncode == 0


def test_an_arm_that_is_led_is_stopped_as_any_motion_of_its_workspace(tmp_path):
    with (
        executing_lock(tmp_path) as lock,
        Watch(arm(tmp_path, seconds=0.01), lock) as watch,
    ):
        stop_executing(tmp_path)
        with pytest.raises(ConfigurationError, match="ended without a word"):
            any(watch.next(20.0) is None for _ in range(10_000))


def test_without_an_arm_the_program_says_one_line(lock):
    with pytest.raises(ConfigurationError, match="no executor 'nothing'; known are"):
        Watch(ArmSettings("nothing"), lock)


@pytest.fixture
def take():
    """Two seconds, the measured motion 80 ms behind the commanded one."""
    t = np.arange(200) / 100
    both = [[np.array([np.sin(max(s - lag, 0)), 2.0]) for lag in (0.0, 0.08)] for s in t]
    states = [GuidedState(5.0 + s, *each) for s, each in zip(t, both, strict=True)]
    return Take("take-1", states)


@pytest.mark.parametrize("kind", ["measured", "commanded"])
def test_a_take_is_imported_as_it_was_recorded(take, kind, tmp_path):
    take.save(tmp_path, FORMAT, [1, 0], kind)
    (recording,) = read_recordings(tmp_path)
    assert recording.names == FORMAT.names
    assert recording.times[[0, -1]] == pytest.approx([0.0, 1.99])
    np.testing.assert_array_equal(recording.positions, take.motion(kind, [1, 0]))


def test_the_lag_of_a_take_is_found_to_a_millisecond(take):
    assert take.lag([0]) == pytest.approx(0.08, abs=1e-3)


def test_what_is_not_behind_lags_by_nothing():
    t = np.arange(100) / 100
    path = np.sin(5 * t)[:, None]
    assert lag_behind(t, path, path) == 0.0
