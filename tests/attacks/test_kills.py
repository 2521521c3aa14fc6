"""Kill -9 at random moments of every command that writes: nothing lost, doubled or replayed."""

import random

import pytest

from tests.attacks.kills import COMMANDS, kill

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    from tests.attacks.table import prepare

    return prepare(tmp_path_factory.mktemp("kills"))


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("case", range(2))
def test_a_kill_loses_doubles_and_replays_nothing(asked, tmp_path, name, case):
    kill(name, random.Random(f"{name} {case}"), tmp_path, asked)
