"""The simulated SO-101: its servos' memory, its ball, the hand that guides it, its port."""

import os
import select
import threading
import tty
from contextlib import suppress

import numpy as np
import pytest

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.so101 import SPEED, SO101Shot
from simulators.feetech import GOAL_POSITION, PRESENT_POSITION, TORQUE_ENABLE
from simulators.so101 import Port, SimulatedSO101

STEPS = 4095 / (2 * np.pi)


def powered(arm):
    for servo in arm.servos.values():
        servo.memory[TORQUE_ENABLE] = 1
    return arm


def test_a_servo_goes_to_its_goal_no_faster_than_it_can():
    arm = powered(SimulatedSO101())
    pan = arm.servos[1]
    pan.write_word(GOAL_POSITION, pan.word(PRESENT_POSITION) + 1000)
    arm.advance(0.1)
    travelled = (pan.word(PRESENT_POSITION) - 2047) / STEPS
    assert 0.05 < travelled <= 0.1 * SPEED
    arm.advance(1.0)
    assert pan.word(PRESENT_POSITION) == pytest.approx(3047, abs=1)


def test_without_torque_a_goal_moves_nothing():
    arm = SimulatedSO101()
    arm.servos[2].write_word(GOAL_POSITION, 1500)
    arm.advance(0.3)
    assert arm.servos[2].word(PRESENT_POSITION) == pytest.approx(2047, abs=1)


def test_a_hand_guides_it_through_a_throw_that_lands_as_without_the_bus():
    task, landed = SO101Shot(), []
    demos = task.demonstrations("A")
    one = Demonstrations(demos.plans[:2], demos.outcomes_seen[:2], demos.format)
    arm = SimulatedSO101(one, landed.append)
    arm.advance(2 * (2.0 + 2.0 + 1.5) + 1.0)
    expected = np.array([rollout.outcome for rollout in task.rollout(one.plans, None)])
    # The servos that follow goals are 1 mrad off the plan, a hand is not.
    assert np.array([rollout.outcome for rollout in landed]) == pytest.approx(expected, abs=0.005)


@pytest.fixture
def client(tmp_path):
    """A port in lock-step that dies after two goals, and a client's end of it."""
    port = Port(SimulatedSO101(), tmp_path, lock_step=0.01, dies_after=2)
    serving = threading.Thread(target=port.serve)
    serving.start()
    end = os.open(os.readlink(tmp_path / "port"), os.O_RDWR | os.O_NOCTTY)
    tty.setraw(end)
    yield end
    os.close(end)
    port.stop()
    serving.join(10)
    assert not serving.is_alive()


def packet(text):
    body = bytes.fromhex(text)
    return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def test_the_port_answers_until_the_plug_is_pulled(client):
    os.write(client, packet("03 02 01"))
    assert select.select([client], [], [], 10)[0]
    assert os.read(client, 100) == packet("03 02 00")
    goal = packet("fe 07 83 2a 02 01 0008")
    os.write(client, goal)
    os.write(client, goal)
    assert select.select([client], [], [], 10)[0]
    with suppress(OSError):  # as a device that is gone says, where it does not just end
        assert os.read(client, 100) == b""
    with pytest.raises(OSError, match="Input/output error"):
        os.write(client, goal)


def test_lerobots_calibration_file_is_what_the_servos_hold(tmp_path):
    arm = SimulatedSO101()
    Port(arm, tmp_path).stop()
    assert arm.calibration()["shoulder_lift"]["range_min"] == 2047 - round(1.74533 * STEPS)
    assert (tmp_path / "calibration" / "simulated.json").is_file()
