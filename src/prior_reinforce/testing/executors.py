"""What every executor keeps to. On a real arm it moves: by `reach`, twice, and back."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ClassVar

import numpy as np
import pytest
from jaxtyping import Float

from prior_reinforce.arm.executing.base import Executor
from prior_reinforce.errors import RobotLimitError
from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

_SECONDS = 1.0
"""How long the motion takes that is executed."""
_DT = 0.02


class ExecutorContract:
    """Inherit it, and name the executor: `make = staticmethod(lambda: Slider(SliderConfig("")))`.

    Have room around the arm: it moves by `reach`, there and back, once whole and once stopped.
    """

    make: Callable[[], Executor]
    """Connects to the arm."""
    reach: ClassVar[float | tuple[float, ...]] = 0.05
    """How far it moves, one number or one for each channel, in the channels' units."""
    too_far: ClassVar[float] = 1000.0
    """So many times `reach` in the same second, and the arm refuses."""
    accuracy: ClassVar[float] = 1e-3
    """How near to the last frame it comes to rest, in the channels' units."""

    @pytest.fixture
    def executor(self) -> Iterator[Executor]:
        """The arm, connected."""
        executor = self.make()
        yield executor
        executor.close()

    def test_it_describes_its_channels(self, executor: Executor) -> None:
        arm = executor.describe()
        d = len(arm.columns)
        assert d == len(set(arm.columns)) > 0, f"columns differ from each other: {arm.columns}"
        assert len(arm.units) == d, f"{d} columns have {d} units, not {arm.units}"
        assert 0 < arm.rate < np.inf, f"rate is set points a second, not {arm.rate}"
        for said in (arm.checked, arm.unchecked):
            words = isinstance(said, tuple) and all(isinstance(what, str) for what in said)
            assert words, f"checked and unchecked are tuples of texts, not {said!r}"
        assert executor.describe() == arm, "describe says the same each time"

    def test_nothing_moves_when_it_is_asked_or_checks(self, executor: Executor) -> None:
        before = self._where(executor)
        executor.describe()
        executor.check(self._plan(executor))
        moved = np.abs(self._where(executor) - before)
        assert np.all(moved <= self.accuracy), f"where, describe or check moved the arm by {moved}"

    def test_a_motion_that_is_too_fast_is_refused(self, executor: Executor) -> None:
        with pytest.raises(RobotLimitError):
            executor.check(self._plan(executor, self.too_far))

    def test_a_plan_is_executed_once_and_measured(self, executor: Executor) -> None:
        for there in (1.0, -1.0):
            plan = self._plan(executor, there)
            kept = plan.actions.copy()
            executor.check(plan)
            path = executor.run(plan)
            assert not path.fault, f"the arm did not come to the plan's end: {path.fault}"
            assert path.moved, "moved is True after a motion"
            shape = (len(path.t), kept.shape[1])
            assert path.q.shape == shape, f"q has a row a time: {shape}, not {path.q.shape}"
            assert np.all(np.isfinite(path.q)), "what was measured is finite"
            assert np.all(np.diff(path.t) > 0), "times of what was measured grow"
            assert np.array_equal(plan.actions, kept), "run leaves the plan as it was"
            off = np.abs(self._where(executor) - kept[-1])
            assert np.all(off <= self.accuracy), f"the arm rests {off} off the plan's last frame"

    def test_a_stop_brings_it_to_rest_with_a_fault(self, executor: Executor) -> None:
        """From a signal's handler, as `stop` is called; an arm done sooner is not judged."""
        start, plan = self._where(executor), self._plan(executor)
        with _in_the_middle(executor.stop) as came:
            path = executor.run(plan)
        if not came:
            pytest.skip("the motion was over before it could be stopped")
        assert path.fault, "run returns a fault where it was stopped"
        here = self._where(executor)
        still = np.abs(self._where(executor) - here)
        assert np.all(still <= self.accuracy), "run returns when the arm is at rest"
        low, high = np.minimum(start, plan.actions[-1]), np.maximum(start, plan.actions[-1])
        within = np.all((here >= low - self.accuracy) & (here <= high + self.accuracy))
        assert within, f"stopped between {start} and {plan.actions[-1]}, it stands at {here}"

    def _where(self, executor: Executor) -> Float[np.ndarray, " d"]:
        """Where the arm is, checked."""
        q, columns = executor.where(), executor.describe().columns
        assert np.shape(q) == (len(columns),), f"where has a number for each of {columns}, not {q}"
        assert np.all(np.isfinite(q)), f"where is finite, not {q}"
        return np.array(q, dtype=np.float64)

    def _plan(self, executor: Executor, times: float = 1.0) -> Plan:
        """A motion from where the arm stands, by `times` its reach, from rest to rest."""
        arm, start = executor.describe(), self._where(executor)
        share = minimum_jerk(np.linspace(0, 1, round(_SECONDS / _DT) + 1))
        course = np.outer(share, times * np.asarray(self.reach))
        return Plan(start + course, PlanFormat(arm.columns, arm.units, _DT))


@contextmanager
def _in_the_middle(call: Callable[[], None]) -> Iterator[list[bool]]:
    """Call from a signal's handler, a third of the motion's time from now; whether it came."""
    came: list[bool] = []

    def handle(*_: object) -> None:
        came.append(True)
        call()

    before = signal.signal(signal.SIGALRM, handle)
    signal.setitimer(signal.ITIMER_REAL, _SECONDS / 3)
    try:
        yield came
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
