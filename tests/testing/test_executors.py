"""Executors keep the contract, and one that does not is told so in a sentence."""

import pytest

from prior_reinforce.arm.executing.base import MeasuredPath
from prior_reinforce.testing import ExecutorContract
from tests.arm.executing.toy_arm import ToyArm, ToyConfig


class TestToy(ExecutorContract):
    @pytest.fixture(autouse=True)
    def choose(self, tmp_path):
        self.make = lambda: ToyArm(ToyConfig(str(tmp_path), fastest=10.0, seconds=1.0))


class Restless(ToyArm):
    """Moves when it is asked where it is."""

    def where(self):
        q = super().where()
        (self.folder / "pose").write_text(f"{q[0] + 0.1} {q[1]}")
        return q


class Deaf(ToyArm):
    """Ends its motions as if nobody had asked it to stop."""

    def run(self, plan):
        path = super().run(plan)
        return MeasuredPath(path.t, path.q)


class Elsewhere(ToyArm):
    """Comes to rest short of the plan's end."""

    def run(self, plan):
        path = super().run(plan)
        (self.folder / "pose").write_text("0.01 0.01")
        return path


@pytest.mark.parametrize(
    ("kind", "test", "said"),
    [
        (Restless, "test_nothing_moves_when_it_is_asked_or_checks", "check moved the arm by"),
        (Deaf, "test_a_stop_brings_it_to_rest_with_a_fault", "a fault where it was stopped"),
        (Elsewhere, "test_a_plan_is_executed_once_and_measured", "off the plan's last frame"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(kind, test, said, tmp_path):
    suite = ExecutorContract()
    with pytest.raises(AssertionError, match=said):
        getattr(suite, test)(kind(ToyConfig(str(tmp_path), seconds=1.0)))
