import numpy as np

from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


def normalisation(outcomes: np.ndarray, units: tuple[str, ...]) -> Normalisation:
    plans = np.random.default_rng(0).normal(size=(len(outcomes), 4, 1))
    format_ = PlanFormat(("j1",), ("rad",), 0.02)
    return Normalisation.of(
        Demonstrations(plans, outcomes, format_, OutcomeFormat(tuple("xyz"[: len(units)]), units))
    )


def test_components_of_one_unit_share_a_scale_by_hand():
    outcomes = np.array([[-3.0, 0.0], [3.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    result = normalisation(outcomes, ("m", "m"))
    np.testing.assert_allclose(result.scale, np.sqrt((18 / 4 + 2 / 4) / 2))
    np.testing.assert_allclose(result.offset, 0.0)


def test_another_unit_has_a_scale_of_its_own():
    outcomes = np.array([[0.0, 0.0, 5.0], [2.0, 0.0, 6.0], [0.0, 2.0, 7.0], [2.0, 2.0, 6.0]])
    result = normalisation(outcomes, ("m", "m", "s"))
    np.testing.assert_allclose(result.scale, [1.0, 1.0, np.sqrt(0.5)])
    np.testing.assert_allclose(result.offset, [1.0, 1.0, 6.0])


def test_undo_undoes():
    result = normalisation(np.array([[0.8, 5.0], [1.0, 9.0], [0.9, 6.0]]), ("m", "s"))
    values = np.random.default_rng(1).normal(size=(4, 2))
    np.testing.assert_allclose(result.undo(result.apply(values)), values)
