"""Generated attacks by class, and some on the way to the arm; `make attack` makes thousands."""

import random
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.attacks import execution
from tests.attacks.classes import CLASSES
from tests.attacks.harness import HELD, command
from tests.attacks.table import attack, prepare

pytestmark = pytest.mark.slow
EACH = {"recordings": 320, "files": 60}
"""Attacks of each class, 84 where nothing is said: there are twenty kinds of recordings."""


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    return prepare(tmp_path_factory.mktemp("attacks"))


@pytest.mark.parametrize("name", CLASSES)
def test_nothing_breaks(asked, name):
    @settings(
        max_examples=EACH.get(name, 84),
        deadline=None,
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )
    @given(st.integers(0, 2**32))
    def attacked(seed):
        assert attack(name, seed, asked) == HELD

    attacked()


@pytest.mark.parametrize("case", range(150))
def test_nothing_moves_that_may_not(asked, tmp_path, case):
    assert execution.attack(random.Random(f"execution {case}"), tmp_path, asked) == HELD


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
