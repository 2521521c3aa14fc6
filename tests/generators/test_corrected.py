"""Corrected at its demonstrations, whatever the generator within leaves there."""

import numpy as np

from prior_reinforce.generators.corrected import Corrected
from prior_reinforce.generators.interpolation import NearestNeighbours, SmoothInterpolation
from prior_reinforce.plans.motions import Demonstrations, PlanFormat

OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2], [0.9, 0.0]])


class Off(NearestNeighbours):
    """Off by a smooth motion that depends on the condition."""

    name = "off"

    def _generate(self, conditions):
        plans = super()._generate(conditions)
        bump = np.sin(np.linspace(0, np.pi, plans.shape[1]))[:, None]
        return plans + 0.002 * bump * (1 + conditions.sum(axis=1))[:, None, None]


def demonstrations(noise=None) -> Demonstrations:
    rng = np.random.default_rng(0)
    plans = np.cumsum(rng.normal(size=(5, 30, 2)), axis=1) * 0.05
    extra = {} if noise is None else {"outcome_noise": np.full((5, 2), noise)}
    return Demonstrations(plans, OUTCOMES, PlanFormat(("a", "b"), ("rad",) * 2, 0.02), **extra)


def test_demonstrations_come_back():
    demos = demonstrations()
    assert np.abs(Off().fit(demos, seed=0).generate(OUTCOMES) - demos.plans).max() > 1e-3
    exact = Corrected(Off()).fit(demos, seed=0)
    np.testing.assert_allclose(exact.generate(OUTCOMES), demos.plans, atol=1e-12)


def test_what_is_off_by_an_affine_function_is_right_everywhere():
    demos = demonstrations()
    conditions = np.array([[0.86, 0.07], [0.95, -0.05]])
    right = NearestNeighbours().fit(demos, seed=0).generate(conditions)
    exact = Corrected(Off()).fit(demos, seed=0).generate(conditions)
    np.testing.assert_allclose(exact, right, atol=1e-12)


def test_between_demonstrations_it_deviates_from_the_spline_as_the_generator_within_does():
    """What a generator does is its deviation from the spline through its own plans."""
    demos = demonstrations()
    within = Curved().fit(demos, seed=0)
    corrected = Corrected(Curved()).fit(demos, seed=0)
    spline = SmoothInterpolation().fit(demos, seed=0)
    of_its_own_plans = SmoothInterpolation().fit(
        demos.with_plans(within.generate(OUTCOMES)), seed=0
    )
    conditions = np.array([[0.86, 0.07], [0.95, -0.05], [0.9, 0.15]])
    deviation = within.generate(conditions) - of_its_own_plans.generate(conditions)
    assert np.abs(deviation).max() > 5e-3
    np.testing.assert_allclose(
        corrected.generate(conditions) - spline.generate(conditions), deviation, atol=1e-12
    )


def test_a_number_a_plan_need_not_come_out_as_one():
    """A primitive's number may drift over a plan; what it misses by does then, too."""
    demos = demonstrations()
    numbered = demos.with_plans(
        np.concatenate([demos.plans, np.repeat(OUTCOMES[:, :1, None], 30, axis=1)], axis=2),
        PlanFormat(("a", "b", "n"), ("rad",) * 3, 0.02, per_plan=("n",)),
    )

    class Drifting(NearestNeighbours):
        def _generate(self, conditions):
            return super()._generate(conditions) + np.linspace(0, 1e-3, 30)[:, None]

    exact = Corrected(Drifting()).fit(numbered, seed=0)
    np.testing.assert_allclose(exact.generate(OUTCOMES), numbered.plans, atol=1e-12)


class Curved(NearestNeighbours):
    """Off by what no affine function of the condition tells."""

    name = "curved"

    def _generate(self, conditions):
        return super()._generate(conditions) + 0.01 * np.sin(40 * conditions[:, :1, None])


def test_what_was_seen_coarsely_is_corrected_in_part():
    """Two plans of nearly one outcome must not make the field steep."""
    left = {}
    for noise in (0.0, 0.03):
        demos = demonstrations(noise=noise)
        corrected = Corrected(Curved()).fit(demos, seed=0)
        left[noise] = np.abs(corrected.generate(OUTCOMES) - demos.plans).max()
    assert left[0.0] < 1e-12
    assert left[0.03] > 1e-3
