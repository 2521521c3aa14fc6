"""A simulated UR5e whose controller ur_rtde connects to: RTDE, dashboard and script server.

RTDE is Universal Robots' Real-Time Data Exchange, protocol version 2 (their guide; port 30004):
packets of size, type and payload; a client names the outputs that it wants at every cycle, and
recipes of inputs, which are written to registers. The dashboard (29999) answers lines of text. What
is sent to the script server (30003) must be the very program that ur_rtde 1.6 uploads. URScript is
not interpreted: what that program does with `servoJ`, `servoStop`, `setWatchdog` and `stopScript`
is done here, by the same registers; any other of its commands is a protective stop.

`servoj` is a first-order lag with its lookahead time as the time constant; the gain changes
nothing. A joint that would go faster than a UR5e does stops the arm. No masses, torques, contacts
or safety planes are simulated. While a client servoes, a cycle waits for its set point, so that a
busy computer changes no path; otherwise cycles follow the clock.
"""

from __future__ import annotations

import selectors
import socket
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from prior_reinforce.errors import ConfigurationError

DASHBOARD, SCRIPT, RTDE = 29999, 30003, 30004
CYCLE = 0.002
"""Of an e-Series controller, in [s]."""
HOME = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
"""Where it stands at first, in [rad]: the forearm level, the tool down."""
_PROGRAM = b'textmsg("RTDE Control Script Loaded (14.02.2024-12:23)")'
"""In the program that is stood in for: its version."""
_SERVOJ, _SERVO_STOP, _SET_WATCHDOG, _STOP_SCRIPT = 11, 16, 35, 255
"""Its commands, in input integer register 0."""
_READY, _DONE = 1, 2
"""What it says in output integer register 0."""
_FASTEST = np.pi
"""Of any joint of a UR5e, in [rad/s]: 180 deg/s of its data sheet."""
_BRAKING = 0.05
"""Time constant with which the arm comes to rest where nothing drives it, in [s]; ours."""
_ANSWER_WITHIN = 1.0
"""How long a cycle waits for a client that servoes, in [s]; ours, for a busy computer."""
_NORMAL, _PROTECTIVE_STOP = (1, 1 << 0), (3, 1 << 2)
"""Safety mode and safety status bits."""
_FORMATS = {"DOUBLE": ">d", "VECTOR6D": ">6d", "INT32": ">i", "UINT32": ">I"}
_OUTPUTS = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "runtime_state": "UINT32",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
    **{f"output_int_register_{i}": "INT32" for i in range(24)},
    **{f"output_double_register_{i}": "DOUBLE" for i in range(24)},
}
_INPUTS = {
    "external_force_torque": "VECTOR6D",
    **{f"input_int_register_{i}": "INT32" for i in range(24)},
    **{f"input_double_register_{i}": "DOUBLE" for i in range(24)},
}
_SAYS = {
    b"PolyscopeVersion": b"URSoftware 5.12.2.1101534 (Jul 06 2022)",
    b"get serial number": b"20225500001",
    b"is in remote control": b"true",
}


@dataclass(eq=False)
class _Client:
    """One connection."""

    connection: socket.socket
    answer: Callable[[_Client], None]
    received: bytes = b""
    outputs: list[str] = field(default_factory=list)
    recipes: list[list[str]] = field(default_factory=list)
    started: bool = False


class SimulatedUR:
    """The controller and the arm."""

    def __init__(self, host: str, said: Callable[[str], None] = lambda text: None) -> None:
        """Stand still at `HOME`, powered on.

        Args:
            host: Address to serve on; ports are the controller's own.
            said: Called with what somebody beside the arm would see.
        """
        self.host, self._said = host, said
        self.running = True
        self.q, self._velocity, self.time = np.array(HOME), np.zeros(6), 0.0
        """Joint positions, in [rad]; time since power-on, in [s]."""
        self._registers: dict[str, float] = dict.fromkeys([*_INPUTS, *_OUTPUTS], 0)
        self._safety = _NORMAL
        self._program, self._servoing, self._executing = False, False, False
        self._watchdog, self._silent = 0.0, 0.0
        self._in_step, self._answered = False, False
        self._clients: list[_Client] = []
        self._selector = selectors.DefaultSelector()

    def serve(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serve until `running` is made false; `ready` is called when clients may connect.

        Raises:
            ConfigurationError: Somebody else serves there, or the address is not this computer's.
        """
        answers = {DASHBOARD: self._dashboard, SCRIPT: self._script, RTDE: self._rtde}
        listening = []
        try:
            for port, answer in answers.items():
                listening.append(listener := socket.socket())
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    listener.bind((self.host, port))
                except OSError as error:
                    raise ConfigurationError(
                        f"cannot serve on {self.host} ({error.strerror}); stop what serves there, "
                        "or give another --host, such as 127.0.77.2"
                    ) from error
                listener.listen()
                self._selector.register(listener, selectors.EVENT_READ, answer)
            ready()
            self._go_on()
        finally:
            for end in [*listening, *(client.connection for client in self._clients)]:
                end.close()
            self._selector.close()

    def _go_on(self) -> None:
        last = time.monotonic()
        while self.running:
            in_step = self._servoing and self._in_step
            period = CYCLE if not in_step else 0.0 if self._answered else _ANSWER_WITHIN
            due = last + period
            for key, _ in self._selector.select(max(0.0, due - time.monotonic())):
                if isinstance(key.data, _Client):
                    self._read(key.data)
                else:
                    connection, _ = key.fileobj.accept()  # type: ignore[union-attr]
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    client = _Client(connection, key.data)
                    self._clients.append(client)
                    self._selector.register(connection, selectors.EVENT_READ, client)
                    if key.data == self._dashboard:
                        connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
            answered = in_step and self._answered
            if answered or time.monotonic() >= due:
                if in_step and not answered:  # cycles go on without it
                    self._in_step = False
                last, self._answered = time.monotonic(), False
                self._cycle()

    def _read(self, client: _Client) -> None:
        content = b""
        with suppress(OSError):
            content = client.connection.recv(1 << 16)
        client.received += content
        if content:
            with suppress(OSError):  # it left before it was answered
                client.answer(client)
            return
        self._selector.unregister(client.connection)
        self._clients.remove(client)
        client.connection.close()
        self._in_step = False

    def _dashboard(self, client: _Client) -> None:
        while b"\n" in client.received:
            line, _, client.received = client.received.partition(b"\n")
            answer = _SAYS.get(line.strip(), b"could not understand: '%s'" % line.strip())
            client.connection.sendall(answer + b"\n")

    def _script(self, client: _Client) -> None:
        """Start the program once it is there as a whole."""
        if not client.received.rstrip().endswith(b"\nend"):
            return
        if _PROGRAM in client.received:
            self._program, self._executing, self._watchdog = True, False, 0.0
            self._registers["input_int_register_0"] = 0
            self._registers["output_int_register_0"] = _READY
        else:
            print("a program that is not ur_rtde 1.6's was not run", file=sys.stderr)
        client.received = b""

    def _rtde(self, client: _Client) -> None:
        while len(client.received) >= 3:
            size = int.from_bytes(client.received[:2], "big")
            if len(client.received) < size:
                return
            kind, payload = chr(client.received[2]), client.received[3:size]
            client.received = client.received[size:]
            if kind == "U":
                self._take(client, payload)
                continue
            answer = b"\1"  # accepted
            if kind == "v":
                answer = struct.pack(">4I", 5, 12, 2, 1101534)
            elif kind == "O":
                client.outputs = _names(payload[8:])
                answer += _types(client.outputs, _OUTPUTS)
            elif kind == "I":
                client.recipes.append(_names(payload))
                answer = bytes([len(client.recipes)]) + _types(client.recipes[-1], _INPUTS)
            elif kind in "SP":
                client.started = kind == "S"
            client.connection.sendall(_packet(kind, answer))

    def _take(self, client: _Client, payload: bytes) -> None:
        """Write a client's inputs to the registers."""
        at = 1
        for name in client.recipes[payload[0] - 1]:
            form = _FORMATS[_INPUTS[name]]
            values = struct.unpack_from(form, payload, at)
            at += struct.calcsize(form)
            self._registers[name] = values[0]
            if name == "input_int_register_0":
                self._silent, self._answered, self._in_step = 0.0, True, True

    def _cycle(self) -> None:
        """2 ms: the program's loop goes round, the arm moves, clients hear of it."""
        if self._program:
            self._run_program()
        before, self.time = self.q, self.time + CYCLE
        if self._servoing:
            goal = np.array([self._registers[f"input_double_register_{i}"] for i in range(6)])
            lookahead = self._registers["input_double_register_9"]
            self.q = goal + (self.q - goal) * np.exp(-CYCLE / lookahead)
        else:
            self.q = self.q + CYCLE * self._velocity * np.exp(-CYCLE / _BRAKING)
        self._velocity = (self.q - before) / CYCLE
        if np.any(np.abs(self._velocity) > _FASTEST):
            self.q, self._velocity = before, np.zeros(6)
            self.protective_stop()
        mode, bits = self._safety
        values: dict[str, float | list[float]] = {
            **self._registers,
            "timestamp": self.time,
            "actual_q": self.q.tolist(),
            "robot_mode": 7,  # running
            "safety_mode": mode,
            "safety_status_bits": bits,
            "runtime_state": 2 if self._program else 1,  # playing, stopped
            "robot_status_bits": 1 | 2 * self._program,  # power is on, the program runs
        }
        for client in self._clients:
            if client.started:
                state = b"\1" + b"".join(_packed(values[n], _OUTPUTS[n]) for n in client.outputs)
                with suppress(OSError):  # it left; its end is read next
                    client.connection.sendall(_packet("U", state))

    def _run_program(self) -> None:
        """Once round the loop of ur_rtde's control script."""
        command, done = int(self._registers["input_int_register_0"]), "output_int_register_0"
        self._silent += CYCLE
        if self._watchdog and self._silent > 1 / self._watchdog:
            self._end_program("the watchdog stopped the program")
        elif command == _SERVOJ:
            if not self._servoing:
                self._said("it follows set points")
            self._servoing = True
            self._registers[done] = _READY
        elif command == 0:
            self._executing = False
            self._registers[done] = _READY
        elif not self._executing:
            self._executing = True
            self._registers[done] = _DONE
            if command == _SERVO_STOP:
                self._servoing = False
                self._said("it stands still")
            elif command == _SET_WATCHDOG:
                self._watchdog = self._registers["input_double_register_0"]
            elif command == _STOP_SCRIPT:
                self._end_program("")
            else:
                print(f"command {command} of ur_rtde is not simulated", file=sys.stderr)
                self.protective_stop()

    def protective_stop(self) -> None:
        """What a controller does where a limit of its safety system is broken."""
        self._safety = _PROTECTIVE_STOP
        self._end_program("protective stop")

    def _end_program(self, said: str) -> None:
        self._program = self._servoing = False
        if said:
            self._said(said)


def _names(text: bytes) -> list[str]:
    return [name for name in text.decode().split(",") if name]


def _types(names: list[str], known: dict[str, str]) -> bytes:
    return ",".join(known.get(name, "NOT_FOUND") for name in names).encode()


def _packed(value: float | list[float], kind: str) -> bytes:
    return struct.pack(_FORMATS[kind], *(value if isinstance(value, list) else [value]))


def _packet(kind: str, payload: bytes) -> bytes:
    return struct.pack(">HB", 3 + len(payload), ord(kind)) + payload
