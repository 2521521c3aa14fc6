"""The bus of Feetech's servos, against packets worked by hand from the maker's description."""

import pytest

from simulators.feetech import (
    GOAL_POSITION,
    PRESENT_POSITION,
    Servo,
    ServoBus,
)

PING = bytes.fromhex("ffff 01 02 01 fb")
"""To servo 1; the checksum is the complement of 01 + 02 + 01."""


@pytest.fixture
def servos():
    return {1: Servo(1000, 3000), 2: Servo(0, 4095)}


def test_a_ping_is_answered_by_the_servo_it_is_for(servos):
    assert ServoBus(servos).answer(PING) == bytes.fromhex("ffff 01 02 00 fc")
    assert ServoBus(servos).answer(bytes.fromhex("ffff 07 02 01 f5")) == b""


def test_a_packet_may_come_in_pieces_behind_noise(servos):
    bus = ServoBus(servos)
    assert bus.answer(b"\x00\x17" + PING[:3]) == b""
    assert bus.answer(PING[3:]) == bytes.fromhex("ffff 01 02 00 fc")


def test_a_damaged_packet_is_not_answered_and_the_next_one_is(servos):
    bus = ServoBus(servos)
    assert bus.answer(PING[:-1] + b"\x00") == b""
    assert bus.answer(PING) != b""


def test_the_model_is_read_as_two_bytes_the_lower_first(servos):
    read = bytes.fromhex("ffff 02 04 02 03 02 f2")  # two bytes from address 3
    assert ServoBus(servos).answer(read) == bytes.fromhex("ffff 02 04 00 09 03 ed")  # 777


def test_goals_of_all_servos_come_in_one_packet_that_nobody_answers(servos):
    told = []
    bus = ServoBus(servos, after_goals=lambda: told.append(servos[2].goal))
    write = bytes.fromhex("ffff fe 0a 83 2a 02 01 0008 02 ff0f")
    write += bytes([~sum(write[2:]) & 0xFF])
    assert bus.answer(write) == b""
    assert servos[1].word(GOAL_POSITION) == 2048
    assert told == [4095]


def test_positions_of_all_servos_are_answered_one_after_another(servos):
    read = []
    bus = ServoBus(servos, before_read=lambda: read.append(1))
    servos[1].write_word(PRESENT_POSITION, 2047)
    servos[2].write_word(PRESENT_POSITION, -1)
    ask = bytes.fromhex("ffff fe 06 82 38 02 01 02")
    ask += bytes([~sum(ask[2:]) & 0xFF])
    assert bus.answer(ask) == bytes.fromhex("ffff 01 04 00 ff07 f4  ffff 02 04 00 0180 78")
    assert read == [1]


def test_a_servo_goes_no_further_than_its_limits(servos):
    servos[1].write_word(GOAL_POSITION, 3500)
    assert servos[1].goal == 3000
    servos[1].write_word(GOAL_POSITION, -5)
    assert servos[1].goal == 1000


def test_a_write_is_acknowledged_and_beyond_the_memory_is_not(servos):
    bus = ServoBus(servos)
    assert bus.answer(bytes.fromhex("ffff 01 04 03 28 01 ce")) == bytes.fromhex("ffff 01 02 00 fc")
    assert servos[1].memory[40] == 1
    assert bus.answer(bytes.fromhex("ffff 01 05 03 7f 01 01 75")) == b""
