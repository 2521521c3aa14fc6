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

import asyncio
import socket
import struct
import sys
import time
from asyncio import StreamReader, StreamWriter
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, suppress

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
_FIELDS = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "runtime_state": "UINT32",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
    "external_force_torque": "VECTOR6D",
    **{f"{way}_int_register_{i}": "INT32" for way in ("input", "output") for i in range(24)},
    **{f"{way}_double_register_{i}": "DOUBLE" for way in ("input", "output") for i in range(24)},
}
"""What a client may ask for, or write."""
_SAYS = {
    b"PolyscopeVersion": b"URSoftware 5.12.2.1101534 (Jul 06 2022)",
    b"get serial number": b"20225500001",
    b"is in remote control": b"true",
}
_Talk = Callable[[StreamReader, StreamWriter], Awaitable[None]]
"""With one client, until it leaves."""


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
        self._registers: dict[str, float] = dict.fromkeys(_FIELDS, 0)
        self._safety = _NORMAL
        self._program, self._servoing, self._executing = False, False, False
        self._watchdog, self._silent = 0.0, 0.0
        self._in_step, self._told = False, asyncio.Event()
        """Whether a client gives a set point every cycle; that it did, or that one left."""
        self._outputs: dict[StreamWriter, list[str]] = {}
        """What each client hears of at every cycle."""

    def serve(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serve until `running` is made false; `ready` is called when clients may connect.

        Raises:
            ConfigurationError: Somebody else serves there, or the address is not this computer's.
        """
        asyncio.run(self._serve(ready))

    async def _serve(self, ready: Callable[[], None]) -> None:
        talks = {DASHBOARD: self._dashboard, SCRIPT: self._script, RTDE: self._rtde}
        with ExitStack() as listening:
            for port, talk in talks.items():
                try:
                    server = await asyncio.start_server(
                        self._and_close(talk), self.host, port, family=socket.AF_INET
                    )
                except OSError as error:
                    raise ConfigurationError(
                        f"cannot serve on {self.host} ({error.strerror or error}); stop what "
                        "serves there, or give another --host, such as 127.0.77.2"
                    ) from error
                listening.callback(server.close)
            ready()
            await self._go_on()

    async def _go_on(self) -> None:
        last = time.monotonic()
        while self.running:
            if self._servoing and self._in_step:
                try:
                    await asyncio.wait_for(self._told.wait(), _ANSWER_WITHIN)
                except asyncio.TimeoutError:  # cycles go on without it
                    self._in_step = False
            else:
                await asyncio.sleep(max(0.0, last + CYCLE - time.monotonic()))
            last = time.monotonic()
            self._told.clear()
            self._cycle()

    def _and_close(self, talk: _Talk) -> _Talk:
        async def talk_and_close(reader: StreamReader, writer: StreamWriter) -> None:
            try:
                with suppress(OSError, EOFError):
                    await talk(reader, writer)
            finally:
                self._outputs.pop(writer, None)
                self._in_step = False
                self._told.set()
                writer.close()

        return talk_and_close

    async def _dashboard(self, reader: StreamReader, writer: StreamWriter) -> None:
        writer.write(b"Connected: Universal Robots Dashboard Server\n")
        while line := await reader.readline():
            word = line.strip()
            writer.write(_SAYS.get(word, b"could not understand: '%s'" % word) + b"\n")

    async def _script(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Start the program once it is there as a whole."""
        received = b""
        while more := await reader.read(1 << 16):
            received += more
            if not received.rstrip().endswith(b"\nend"):
                continue
            if _PROGRAM in received:
                self._program, self._executing, self._watchdog = True, False, 0.0
                self._registers["input_int_register_0"] = 0
                self._registers["output_int_register_0"] = _READY
            else:
                print("a program that is not ur_rtde 1.6's was not run", file=sys.stderr)
            received = b""

    async def _rtde(self, reader: StreamReader, writer: StreamWriter) -> None:
        outputs, recipes = list[str](), list[list[str]]()
        while True:
            size, kind = struct.unpack(">Hc", await reader.readexactly(3))
            payload = await reader.readexactly(size - 3)
            if kind == b"U":
                self._take(recipes[payload[0] - 1], payload)
                continue
            answer = b"\1"  # accepted
            if kind == b"v":
                answer = struct.pack(">4I", 5, 12, 2, 1101534)
            elif kind == b"O":
                outputs = _names(payload[8:])
                answer += _types(outputs)
            elif kind == b"I":
                recipes.append(_names(payload))
                answer = bytes([len(recipes)]) + _types(recipes[-1])
            elif kind == b"S":
                self._outputs[writer] = outputs
            elif kind == b"P":
                self._outputs.pop(writer, None)
            writer.write(_packet(kind, answer))

    def _take(self, names: list[str], payload: bytes) -> None:
        """Write a client's inputs to the registers."""
        at = 1
        for name in names:
            form = _FORMATS[_FIELDS[name]]
            self._registers[name] = struct.unpack_from(form, payload, at)[0]
            at += struct.calcsize(form)
            if name == "input_int_register_0":
                self._silent, self._in_step = 0.0, True
                self._told.set()

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
        for client, names in self._outputs.items():
            state = b"\1" + b"".join(_packed(values[n], _FIELDS[n]) for n in names)
            client.write(_packet(b"U", state))

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


def _types(names: list[str]) -> bytes:
    return ",".join(_FIELDS.get(name, "NOT_FOUND") for name in names).encode()


def _packed(value: float | list[float], kind: str) -> bytes:
    return struct.pack(_FORMATS[kind], *(value if isinstance(value, list) else [value]))


def _packet(kind: bytes, payload: bytes) -> bytes:
    return struct.pack(">Hc", 3 + len(payload), kind) + payload
