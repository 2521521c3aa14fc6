"""LeRobot's side of the bridge, with LeRobot: what it refuses before anything moves."""

from types import SimpleNamespace

import pytest

from prior_reinforce.bench.robots.executors.lerobot_bridge import Bridge
from prior_reinforce.errors import ConfigurationError
from tests.bench.robots.executors.test_lerobot import serve, so101  # noqa: F401


def test_servos_are_told_to_stay_before_lerobot_gives_them_torque():
    done = []
    bus = SimpleNamespace(
        sync_read=lambda what, **_: {"pan": 7 if what == "Present_Position" else 0},
        sync_write=lambda *what, **_: done.append(what),
    )
    bridge = object.__new__(Bridge)
    bridge.bus, bridge._configure = bus, lambda: done.append("configured, with torque")
    bridge._configure_once()
    assert done == [("Goal_Position", {"pan": 7}), "configured, with torque"]


@pytest.mark.slow
def test_a_port_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match="Could not connect on port"):
        so101(tmp_path)


@pytest.mark.slow
def test_an_arm_that_is_calibrated_otherwise_than_its_file_says_is_refused(serve, tmp_path):  # noqa: F811
    arm = serve()
    arm.servos[2].write_word(9, 700)
    with pytest.raises(ConfigurationError, match="is not calibrated, or not as its file says"):
        so101(tmp_path)
