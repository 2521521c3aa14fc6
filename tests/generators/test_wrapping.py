"""Wrapped generators are saved, rebuilt and named with what is within."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import GENERATORS, load_generator, make_generator
from prior_reinforce.generators.corrected import Corrected
from prior_reinforce.generators.interpolation import NearestNeighbours
from prior_reinforce.generators.timed import Timed
from prior_reinforce.generators.wrapping import Wrapper
from prior_reinforce.plans.motions import Demonstrations, PlanFormat


def demonstrations() -> Demonstrations:
    s = np.clip((np.arange(60) - np.array([5, 9, 15, 12])[:, None]) / 30, 0, 1)
    plans = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, :, None] * np.array([1.0, -0.4])
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    return Demonstrations(plans, outcomes, PlanFormat(("a", "b"), ("rad",) * 2, 0.02))


def test_two_wraps_are_rebuilt_in_order(tmp_path):
    demos = demonstrations()
    made = Timed(Corrected(NearestNeighbours()), "start").fit(demos, seed=0)
    made.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert isinstance(loaded, Timed)
    assert isinstance(loaded.generator, Corrected)
    assert isinstance(loaded.generator.generator, NearestNeighbours)
    conditions = np.array([[0.9, 0.1]])
    np.testing.assert_array_equal(loaded.generate(conditions), made.generate(conditions))


def test_a_wrapped_generator_keeps_its_name():
    assert GENERATORS.name_of(make_generator("regression")) == "regression"
    assert GENERATORS.name_of(make_generator("auto")) == "auto"


def test_a_generator_is_wrapped_once_in_each_way():
    with pytest.raises(ConfigurationError, match="corrected already"):
        Corrected(Timed(Corrected(NearestNeighbours())))


def test_a_wrapper_without_a_generator_is_refused():
    layer, _ = Timed(NearestNeighbours(), "start").fit(demonstrations(), seed=0).pack()
    with pytest.raises(FileFormatError, match="around another"):
        Timed.unpack_layer(layer)


class Remarking(NearestNeighbours):
    """Has something to say of every fit."""

    name = "remarking"

    def _fit(self, demonstrations, seed, progress):
        super()._fit(demonstrations, seed, progress)
        self.remarks = (f"{demonstrations.n} demonstrations",)


class Plain(Wrapper):
    """A wrapper that says nothing of remarks."""

    name = "plain"

    def _fit(self, demonstrations, seed, progress):
        self.generator.fit(demonstrations, seed=seed, progress=progress)

    def _generate(self, conditions):
        return self.generator.generate(conditions)


def test_remarks_of_what_is_wrapped_are_never_lost():
    wrapped = Plain(Corrected(Remarking()))
    for _ in range(2):
        correction, inner = wrapped.fit(demonstrations(), seed=0).remarks
        assert correction.startswith("correction")
        assert inner == "4 demonstrations"
    timed = Timed(wrapped, "auto").fit(demonstrations(), seed=0)
    assert timed.remarks[0].startswith("timing")
    assert timed.remarks[1:] == (correction, inner)
