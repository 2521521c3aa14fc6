"""LeRobot's side of the bridge, with LeRobot: what it refuses before anything moves."""

from types import SimpleNamespace

import pytest

from prior_reinforce.arm.executing.lerobot_bridge import Bridge
from prior_reinforce.errors import ConfigurationError
from tests.arm.executing.test_lerobot import serve, so101  # noqa: F401


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


def device(**values):
    """One end of LeRobot's: where it stands, or goes."""
    return SimpleNamespace(
        is_connected=False,
        is_calibrated=True,
        connect=lambda calibrate: None,
        action_features=dict.fromkeys(values, float),
        get_action=lambda: values,
        get_observation=lambda: values,
    )


def test_an_arm_does_not_jump_to_a_leader_that_is_elsewhere():
    bridge, sent = object.__new__(Bridge), []
    bridge.robot, bridge.leader = device(pan=0.0, lift=5.0), device(pan=3.0, lift=26.0)
    bridge.robot.send_action = sent.append
    with pytest.raises(ValueError, match=r"lift of the leader is 21 from .* would jump there"):
        bridge.guide()
    assert not sent


def test_a_leader_that_is_not_calibrated_leads_nothing():
    bridge = object.__new__(Bridge)
    bridge.robot, bridge.leader = device(pan=0.0), device(pan=0.0)
    bridge.leader.is_calibrated = False
    with pytest.raises(ValueError, match=r"not calibrated, .*run lerobot-calibrate"):
        bridge.guide()


def test_positions_that_are_lost_again_and_again_are_an_error():
    tries = []

    def lost():
        tries.append(1)
        raise ConnectionError("no status packet")

    bridge = object.__new__(Bridge)
    bridge.robot, bridge.bus = device(pan=0.0), None
    bridge.robot.get_observation = lost
    with pytest.raises(ConnectionError, match="no status packet"):
        bridge.observe()
    assert len(tries) == 3


@pytest.mark.slow
def test_a_port_that_is_not_there_is_named(lerobot, tmp_path):
    with pytest.raises(ConfigurationError, match="Could not connect on port"):
        so101(lerobot, tmp_path)


@pytest.mark.slow
def test_an_arm_that_is_calibrated_otherwise_than_its_file_is_refused(serve, lerobot, tmp_path):  # noqa: F811
    arm = serve()
    arm.servos[2].write_word(9, 700)
    with pytest.raises(ConfigurationError, match="is not calibrated, or not as its file says"):
        so101(lerobot, tmp_path)
