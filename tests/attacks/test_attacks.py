"""Generated attacks by class; `make attack` makes thousands."""

import os
import random
import sys

import pytest

from tests.attacks.classes import written
from tests.attacks.harness import HELD, command, prepare
from tests.attacks.requests import attack as requesting
from tests.attacks.requests import let_in
from tests.attacks.table import ATTACKS, attack

pytestmark = pytest.mark.slow
TOGETHER = 30
"""Most attacks of one test, since processes share tests, not attacks."""
PARTS = [
    pytest.param(name, part, min(TOGETHER, count - part), id=f"{name}, {part}")
    for name, (_, count) in ATTACKS.items()
    for part in range(0, count, TOGETHER)
]


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    return prepare(tmp_path_factory.mktemp("attacks"))


@pytest.mark.parametrize(("name", "part", "count"), PARTS)
def test_nothing_breaks(asked, name, part, count):
    chance = random.Random(part if "CI" in os.environ else None)
    seeds = [chance.randrange(2**32) for _ in range(count)]
    verdicts = {seed: attack(name, seed, asked) for seed in seeds}
    assert {seed: verdict for seed, verdict in verdicts.items() if verdict != HELD} == {}


def test_processes_that_attack_at_once_have_recordings_of_their_own(tmp_path):
    folders = {written.__wrapped__("csv", tmp_path)[0] for _ in range(2)}
    assert len(folders) == 2


def test_the_harness_sees_what_breaks(tmp_path, monkeypatch):
    """A traceback, a status that lies, a refusal of two lines, a forged line."""

    def run(status=0, out="", error=None, write=None, err=""):
        def main(args):
            if write is not None:
                (tmp_path / write).write_text("x")
            print(out, end="")
            print(err, end="", file=sys.stderr)
            if error is not None:
                raise error
            return status

        monkeypatch.setattr("tests.attacks.harness.main", main)
        return command(tmp_path, "status")

    class TypeCheckError(Exception):
        """What checks shapes in the tests only: users get what comes behind it."""

    assert run() == HELD
    assert run(error=TypeCheckError()).startswith("traceback: TypeCheckError")
    assert run(error=KeyError("a")).startswith("traceback: KeyError")
    assert run(status=3) == "status 3"
    assert run(status=2) == "0 lines"
    assert run(status=2, err="no").startswith("no remedy")
    assert run(status=2, err="give less " * 200).startswith("a refusal of")
    assert run(out="\x1b[2J") == "control characters"
    monkeypatch.setattr("tests.attacks.harness.print", print, raising=False)
    assert run(status=0, write="new") == HELD


def test_a_console_that_listens_lets_nobody_in(monkeypatch):
    monkeypatch.setenv("PRIOR_REINFORCE_ARM", "")  # put back afterwards
    assert requesting(60) == []


def test_who_is_let_in_is_noticed():
    ok, kind = b"HTTP/1.1 200 OK\r\ncontent-type: ", b"HTTP/1.1 401 Unauthorized\r\n\r\n"
    assert let_in(ok + b"application/json\r\n\r\n{}")
    assert let_in(kind + ok + b"text/event-stream\r\n\r\n")
    assert let_in(ok + b"text/html\r\nx: style-src 'unsafe-inline'\r\n\r\n")  # a report
    assert not let_in(kind + ok + b"text/javascript\r\n\r\nx")
