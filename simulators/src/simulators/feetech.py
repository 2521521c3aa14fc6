"""A line of Feetech STS servos as its client sees it: packets in, packets out.

Protocol and registers: the maker's memory table for the STS/SMS series, as LeRobot 0.4.4 has it
(`lerobot/motors/feetech/tables.py`), and the maker's Python SDK (feetech-servo-sdk 1.0.0). A packet
is FF FF, identity, length, instruction or error, parameters, checksum. Of the instructions, those
that LeRobot sends are answered: ping, read, write, sync read, sync write.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

MODEL, FIRMWARE = (3, 777), (0, 3, 10)
"""Address and value of the model's number (STS3215); address and version of its firmware."""
BROADCAST = 254
_PING, _READ, _WRITE, _SYNC_READ, _SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
MIN_LIMIT, MAX_LIMIT, P_COEFFICIENT, HOMING_OFFSET = 9, 11, 21, 31
TORQUE_ENABLE, GOAL_POSITION, PRESENT_POSITION = 40, 42, 56
"""Addresses; positions are two bytes, bit 15 is their sign."""
_SIZE = 128


class Servo:
    """The memory of one servo."""

    def __init__(self, lowest: int, highest: int) -> None:
        """As a calibration left it.

        Args:
            lowest: Least position that it takes as a goal, in steps (4096 a turn).
            highest: Greatest.
        """
        self.memory = bytearray(_SIZE)
        self.memory[FIRMWARE[0] : FIRMWARE[0] + 2] = FIRMWARE[1:]
        for address, value in ((MODEL), (MIN_LIMIT, lowest), (MAX_LIMIT, highest)):
            self.write_word(address, value)
        self.memory[P_COEFFICIENT] = 32  # as from the factory

    def word(self, address: int) -> int:
        """The two bytes from an address, the lower one first; bit 15 is the sign."""
        value = int.from_bytes(self.memory[address : address + 2], "little")
        return -(value & 0x7FFF) if value & 0x8000 else value

    def write_word(self, address: int, value: int) -> None:
        """Write what `word` reads."""
        raw = abs(value) | (0x8000 if value < 0 else 0)
        self.memory[address : address + 2] = raw.to_bytes(2, "little")

    @property
    def goal(self) -> int:
        """Where it goes, in steps, within its limits."""
        return min(max(self.word(GOAL_POSITION), self.word(MIN_LIMIT)), self.word(MAX_LIMIT))


class ServoBus:
    """What a line of servos answers."""

    def __init__(
        self,
        servos: Mapping[int, Servo],
        *,
        before_read: Callable[[], None] = lambda: None,
        after_goals: Callable[[], None] = lambda: None,
    ) -> None:
        """Connect servos.

        Args:
            servos: By identity.
            before_read: Called before positions are read of all servos.
            after_goals: Called after goals were written to all servos.
        """
        self._servos = servos
        self._before_read, self._after_goals = before_read, after_goals
        self._received = b""

    def answer(self, received: bytes) -> bytes:
        """What the line sends back; what is no whole packet yet waits for the rest."""
        self._received += received
        answers = b""
        while (start := self._received.find(b"\xff\xff")) >= 0:
            packet = self._received[start:]
            if len(packet) < 4 or len(packet) < packet[3] + 4:
                break
            packet, self._received = packet[: packet[3] + 4], packet[packet[3] + 4 :]
            # A packet that was damaged on its way is not answered.
            if packet[3] >= 2 and _checksum(packet[2:-1]) == packet[-1]:
                answers += self._obey(packet[2], packet[4], packet[5:-1])
        return answers

    def _obey(self, identity: int, instruction: int, given: bytes) -> bytes:
        if instruction == _SYNC_READ and len(given) > 2:
            if given[0] == PRESENT_POSITION:
                self._before_read()
            return b"".join(self._read(i, given[0], given[1]) for i in given[2:])
        if instruction == _SYNC_WRITE and len(given) > 2:
            address, size = given[0], given[1]
            for at in range(2, len(given), size + 1):
                self._write(given[at], address, given[at + 1 : at + 1 + size])
            if address == GOAL_POSITION:
                self._after_goals()
            return b""
        if instruction == _PING:
            here = self._servos if identity == BROADCAST else [identity]
            return b"".join(_packet(i, b"") for i in here if i in self._servos)
        if instruction == _READ and len(given) == 2:
            return self._read(identity, given[0], given[1])
        if instruction == _WRITE and given:
            return self._write(identity, given[0], given[1:])
        return b""

    def _read(self, identity: int, address: int, size: int) -> bytes:
        if identity not in self._servos:
            return b""
        return _packet(identity, bytes(self._servos[identity].memory[address : address + size]))

    def _write(self, identity: int, address: int, values: bytes) -> bytes:
        if identity not in self._servos or address + len(values) > _SIZE:
            return b""
        self._servos[identity].memory[address : address + len(values)] = values
        return _packet(identity, b"")


def _packet(identity: int, parameters: bytes) -> bytes:
    """A status packet without an error."""
    body = bytes([identity, len(parameters) + 2, 0]) + parameters
    return b"\xff\xff" + body + bytes([_checksum(body)])


def _checksum(body: bytes) -> int:
    return ~sum(body) & 0xFF
