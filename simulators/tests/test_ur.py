"""The simulated UR's protocol; what ur_rtde makes of it is in arm/executing/test_ur."""

import socket
import struct
import threading

import pytest

from prior_reinforce.errors import ConfigurationError
from simulators.ur import DASHBOARD, RTDE, SCRIPT, SimulatedUR

HOST = "127.0.99.1"


@pytest.fixture
def robot():
    robot, ready = SimulatedUR(HOST), threading.Event()
    serving = threading.Thread(target=robot.serve, args=(ready.set,))
    serving.start()
    assert ready.wait(20)
    yield robot
    robot.running = False
    serving.join(20)


def rtde(end, kind, payload=b""):
    """Send a packet; what comes back of the same kind."""
    end.sendall(struct.pack(">HB", 3 + len(payload), ord(kind)) + payload)
    while True:
        size, answer = struct.unpack(">HB", end.recv(3, socket.MSG_WAITALL))
        payload = end.recv(size - 3, socket.MSG_WAITALL)
        if chr(answer) == kind:
            return payload


def test_states_come_by_the_recipe_that_was_asked_for(robot):
    with socket.create_connection((HOST, RTDE)) as end:
        assert rtde(end, "V", b"\0\2") == b"\1"
        names = struct.pack(">d", 500) + b"timestamp,actual_q,payload_mass"
        assert rtde(end, "O", names) == b"\1DOUBLE,VECTOR6D,NOT_FOUND"
        assert (
            rtde(end, "O", struct.pack(">d", 500) + b"timestamp,actual_q") == b"\1DOUBLE,VECTOR6D"
        )
        assert rtde(end, "S") == b"\1"
        times = []
        for _ in range(3):
            size, kind = struct.unpack(">HB", end.recv(3, socket.MSG_WAITALL))
            recipe, t, *q = struct.unpack(">B7d", end.recv(size - 3, socket.MSG_WAITALL))
            assert (chr(kind), recipe, q) == ("U", 1, robot.q.tolist())
            times.append(t)
    assert times[2] - times[0] == pytest.approx(0.004)


def test_only_the_program_that_is_stood_in_for_is_run(robot, capfd):
    with socket.create_connection((HOST, SCRIPT)) as end:
        end.sendall(b"def mine():\n  movej([0,0,0,0,0,0])\nend\n")
        with socket.create_connection((HOST, DASHBOARD)) as dashboard:
            assert b"Dashboard Server" in dashboard.recv(100)
            dashboard.sendall(b"play\n")
            assert dashboard.recv(100) == b"could not understand: 'play'\n"
    assert "not ur_rtde 1.6's was not run" in capfd.readouterr().err


def test_two_of_them_need_two_addresses(robot):
    with pytest.raises(ConfigurationError, match=f"cannot serve on {HOST}"):
        SimulatedUR(HOST).serve()
