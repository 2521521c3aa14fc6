"""Annotated shapes are checked while the tests run."""

from contextlib import suppress

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError, jaxtyped

from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.arrays import Plans, Points
from prior_reinforce.environment import Rollout
from prior_reinforce.errors import PriorReinforceError
from prior_reinforce.perception.exact import Exact
from tests.shapes import SELDOM, arrays_only


@jaxtyped(typechecker=arrays_only)
def blended(plans: Plans, weights: Points, note: int = 0) -> Float[np.ndarray, "k H D"]:
    return np.einsum("nHD,nk->kHD", plans, weights) if note == 0 else plans


PLANS, WEIGHTS = np.zeros((3, 40, 7)), np.ones((3, 2))


def test_shapes_that_fit_pass_and_other_types_are_not_looked_at():
    assert blended(PLANS, WEIGHTS).shape == (2, 40, 7)
    assert blended(PLANS, WEIGHTS, 0.0).shape == (2, 40, 7)


@pytest.mark.parametrize(
    ("plans", "weights", "note"),
    [
        (PLANS[0], WEIGHTS, 0),
        (PLANS[:2], WEIGHTS, 0),
        (PLANS, WEIGHTS.astype(int), 0),
        (PLANS, WEIGHTS.tolist(), 0),
        (PLANS, WEIGHTS, 1),
    ],
    ids=["too few axes", "another n", "integers", "a list", "another result"],
)
def test_a_shape_or_kind_that_does_not_fit_is_caught(plans, weights, note):
    with pytest.raises(TypeCheckError):
        blended(plans, weights, note)


def test_the_package_is_checked():
    goal, seen = np.zeros(2), np.zeros(3)
    rollout, rng = Rollout(outcome=goal, valid=True), np.random.default_rng(0)

    def look_often():
        for _ in range(SELDOM):
            with suppress(PriorReinforceError):  # of a call that was not checked
                Exact().perceive(rollout, goal[None], rng)

    with pytest.raises(TypeCheckError):
        look_often()
    with pytest.raises(TypeCheckError):
        Normalisation(goal, seen)


def test_fields_are_held_to_their_shapes_once_they_are_set():
    with pytest.raises(TypeCheckError):
        Rollout(outcome=np.zeros((1, 2)), valid=True)
