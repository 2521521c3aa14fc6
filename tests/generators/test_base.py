"""What the base classes do for every generator, and for those that wrap another."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.generators.base import ConditionScale, Generator, Wrapper
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.timing.timed import Timed
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


class Constant(Generator):
    """The mean plan, whatever is asked for; remarks on demonstrations that start apart."""

    name = "constant"

    def _fit(self, demonstrations, seed, progress):
        self.plan = demonstrations.plans.mean(axis=0)
        if np.ptp(demonstrations.plans[:, 0, 0]):
            self.remarks = ("demonstrations start apart",)

    def _generate(self, conditions):
        return np.repeat(self.plan[None], len(conditions), axis=0)


class Kept(Constant):
    name = "kept"

    def state(self):
        return {}, {"plan": self.plan}

    @classmethod
    def from_state(cls, settings, tensors):
        kept = cls()
        kept.plan = tensors["plan"]
        return kept


def test_fit_and_generate_are_enough_to_be_used(throws):
    demos = throws(3, 20)
    generator = Constant().fit(demos, seed=0)
    assert generator.generate([[0.9, 0.1]]).shape == (1, 20, 3)


def test_before_fit_nothing_is_generated_or_saved(tmp_path):
    for use in (lambda: Kept().generate([[0.9, 0.1]]), lambda: Kept().save(tmp_path / "model")):
        with pytest.raises(NotFittedError, match="Kept has learned nothing"):
            use()
    assert not (tmp_path / "model").exists()


def test_remarks_are_of_the_last_fit_and_kept_on_disk(throws, tmp_path):
    demos = throws(3, 20)
    apart = demos.plans.copy()
    apart[0] += 0.1
    generator = Kept().fit(demos.with_plans(apart), seed=0)
    assert generator.remarks == ("demonstrations start apart",)
    generator.save(tmp_path)
    assert Kept.load(tmp_path).remarks == generator.remarks
    assert generator.fit(demos, seed=0).remarks == ()


def test_without_a_state_saving_says_what_is_missing(throws, tmp_path):
    with pytest.raises(ConfigurationError, match=r"a Constant cannot be saved; give the class"):
        Constant().fit(throws(3, 20), seed=0).save(tmp_path)


def test_a_bug_of_ones_own_is_not_called_a_damaged_file(throws, tmp_path):
    class Misspelt(Kept):
        @classmethod
        def from_state(cls, settings, tensors):
            return cls.made_of(tensors["plan"])

    Misspelt().fit(throws(3, 20), seed=0).save(tmp_path)
    with pytest.raises(AttributeError, match="made_of"):
        Misspelt.load(tmp_path)


def test_the_cpu_is_the_only_device_unless_a_member_says_otherwise():
    assert Constant().to("cpu")
    with pytest.raises(ConfigurationError, match="CPU only"):
        Constant().to("cuda")


def test_scaled_conditions_span_minus_one_to_one_in_every_unit():
    outcomes = np.array([[0.8, 20.0], [1.2, 35.0], [1.0, 5.0]])
    scaled = ConditionScale.fit(outcomes).scale(outcomes)
    np.testing.assert_allclose(scaled, [[-1, 0], [1, 1], [0, -1]], atol=1e-12)


class OneRemark(Generator):
    name = "remarking"

    def _fit(self, demonstrations, seed, progress):
        self.remarks = ("joint3 is held",)

    def _generate(self, conditions): ...


def test_what_a_fit_remarks_is_logged(caplog):
    demos = Demonstrations(np.eye(2)[:, :, None], [[0.1], [0.2]], PlanFormat(["a"], ["rad"], 0.1))
    generator = OneRemark()
    assert repr(generator) == "OneRemark(not fitted)"
    with caplog.at_level("INFO", logger="prior_reinforce"):
        generator.fit(demos, seed=0)
    assert caplog.messages == ["remarking: joint3 is held"]
    assert repr(generator) == "OneRemark(fitted)"


def demonstrations() -> Demonstrations:
    s = np.clip((np.arange(60) - np.array([5, 9, 15, 12])[:, None]) / 30, 0, 1)
    plans = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, :, None] * np.array([1.0, -0.4])
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    return Demonstrations(plans, outcomes, PlanFormat(("a", "b"), ("rad",) * 2, 0.02))


def test_a_wrapped_generator_keeps_its_name():
    assert GENERATORS.name_of(make_generator("diffusion")) == "diffusion"
    assert GENERATORS.name_of(make_generator("auto")) == "auto"


def test_a_generator_is_wrapped_once_in_each_way():
    with pytest.raises(ConfigurationError, match="timed already"):
        Timed(Plain(Timed(SmoothInterpolation())))


def test_a_wrapper_without_a_generator_is_refused():
    layer, _ = Timed(SmoothInterpolation(), "start").fit(demonstrations(), seed=0).pack()
    with pytest.raises(FileFormatError, match="around another"):
        Timed.unpack_layer(layer)


class Remarking(SmoothInterpolation):
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
    wrapped = Plain(Remarking())
    for _ in range(2):
        assert wrapped.fit(demonstrations(), seed=0).remarks == ("4 demonstrations",)
    timed = Timed(wrapped, "auto").fit(demonstrations(), seed=0)
    assert timed.remarks[0].startswith("timing")
    assert timed.remarks[1:] == ("4 demonstrations",)
