"""Every adapter of the registry keeps the contract."""

from functools import partial

import msgspec
import numpy as np
import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.adapters.base import Adapter, Expectation
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.testing import AdapterContract, synthetic_demonstrations
from tests.testing.members import members


class TestAdapters(AdapterContract):
    @pytest.fixture(autouse=True, params=members(ADAPTERS))
    def choose(self, request):
        self.make = partial(make_adapter, request.param)


class OfReadings(Adapter):
    """One that takes readings and no numbers, as docs/extending.md says."""

    def _start(self, demonstrations):
        self._moved = np.zeros(demonstrations.outcome_dim)

    def _propose(self, goal_seen):
        return goal_seen - self._moved

    def _observe_reading(self, condition, goal, reading):
        if reading.has_number:
            self._moved = goal + reading.error_seen - condition


class TestOfReadings(AdapterContract):
    make = OfReadings


class OfNothing(Adapter):
    def _start(self, demonstrations):
        pass

    def _propose(self, goal_seen):
        return goal_seen


def test_one_that_takes_in_nothing_is_told_what_to_write():
    adapter = OfNothing()
    outcomes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    plans = np.random.default_rng(0).normal(size=(3, 4, 1))
    adapter.start(Demonstrations(plans, outcomes, PlanFormat(("j1",), ("rad",), 0.02)))
    with pytest.raises(NotImplementedError, match="OfNothing takes in no trials: write _observe"):
        adapter.observe([0.5, 0.5], [0.5, 0.5], Reading.measured([0.0, 0.0]))


class Expecting(OfReadings):
    """An adapter of one's own that expects arrays, or nothing."""

    gives = None

    def _expect(self, condition, goal, tolerance):
        return self.gives


def test_an_adapter_of_ones_own_may_expect_arrays_and_must_expect_something():
    adapter = Expecting()
    adapter.start(synthetic_demonstrations())
    goal = np.array([1.0, 0.1])
    adapter.gives = Expectation(np.float64(0.5), error=np.zeros(2), sd=np.ones(2))
    written = msgspec.json.encode(adapter.expect(goal, goal, 0.05))
    assert msgspec.json.decode(written, type=Expectation) == adapter.gives
    adapter.gives = None
    with pytest.raises(ConfigurationError, match="must return an Expectation"):
        adapter.expect(goal, goal, 0.05)
