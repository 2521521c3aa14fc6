"""Dynamic movement primitives against their equation, and against the demonstrations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.interpolation import (
    SmoothInterpolation,
    SmoothInterpolationConfig,
)
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.generators import dmp
from reproduction.generators.dmp import (
    DynamicMovementPrimitives,
    DynamicMovementPrimitivesConfig,
    _Response,
)

pytest.importorskip("movement_primitives")

DT = 0.0125  # [s]
FRAMES = np.arange(140)
FORMAT = PlanFormat(("joint1", "joint2"), ("rad", "rad"), DT)
OUTCOMES = np.array([[0.9, -0.2], [0.9, 0.3], [1.2, -0.3], [1.2, 0.2], [1.0, 0.0], [1.1, 0.05]])


def throw(start: float, duration: float, travel: float) -> np.ndarray:
    """Minimum-jerk swing of two joints from rest to rest; times in [s], shape (H, 2)."""
    s = np.clip((FRAMES * DT - start) / duration, 0, 1)
    path = 10 * s**3 - 15 * s**4 + 6 * s**5
    return np.stack([travel * path - 0.5, 1.5 - 0.8 * path + 0.3 * np.sin(np.pi * s) ** 3], axis=1)


def demonstrations(plans: np.ndarray) -> Demonstrations:
    return Demonstrations(plans, OUTCOMES[: len(plans)], FORMAT)


def family(starts: np.ndarray, durations: np.ndarray, travels: np.ndarray) -> Demonstrations:
    throws = zip(starts, durations, travels, strict=True)
    return demonstrations(np.stack([throw(*values) for values in throws]))


def test_the_goal_term_is_the_critically_damped_spring_of_the_equation():
    """Start 0, goal 1, no forcing: 1 - (1 + 12.5 u) exp(-12.5 u), as alpha = 25 = 4 beta."""
    phases = np.linspace(0, 1, 50)
    expected = 1 - (1 + 12.5 * phases) * np.exp(-12.5 * phases)
    np.testing.assert_allclose(_Response(5)(phases)[:, 1], expected, atol=1e-6)


def test_a_forcing_weight_acts_as_the_equation_says():
    """The response to each weight against SciPy's integration of tau^2 yddot = ... + z psi."""
    n, alpha, alpha_z = 6, 25.0, -np.log(0.01)
    centres = np.exp(-alpha_z * np.arange(n) / (n - 1))
    widths = -np.log(0.8) / np.diff(centres) ** 2
    widths = np.append(widths, widths[-1])

    def slope(u: float, state: np.ndarray) -> np.ndarray:
        z = np.exp(-alpha_z * u)
        psi = np.exp(-widths * (z - centres) ** 2)
        y, yd = state[:n], state[n:]
        return np.concatenate([yd, alpha * (alpha / 4 * -y - yd) + z * psi / psi.sum()])

    phases = np.linspace(0, 1, 30)
    expected = solve_ivp(slope, (0, 1), np.zeros(2 * n), t_eval=phases, rtol=1e-9, atol=1e-12)
    got = _Response(n)(phases)[:, 2:]
    # The library evaluates the forcing one of its 1000 steps late.
    np.testing.assert_allclose(got, expected.y[:n].T, atol=0.02 * np.abs(expected.y[:n]).max())


@pytest.mark.parametrize("segmented", [True, False])
def test_demonstrations_come_back_at_their_outcomes(segmented: bool):
    starts = np.array([0.1, 0.3, 0.5, 0.2, 0.4, 0.6])
    demos = family(starts, np.full(6, 1.0), np.linspace(0.8, 1.2, 6))
    config = DynamicMovementPrimitivesConfig(segmented=segmented)
    generated = DynamicMovementPrimitives(config).fit(demos, seed=0).generate(demos.outcomes_seen)
    np.testing.assert_allclose(generated, demos.plans, atol=2e-3)  # [rad] of a swing of 1


def test_a_plan_that_ends_in_mid_swing_comes_back():
    plans = np.stack([throw(0.3, 3.0, travel) for travel in np.linspace(0.8, 1.2, 6)])
    assert np.abs(np.diff(plans[:, -2:, 0], axis=1)).min() / DT > 0.3  # [rad/s]: no rest
    demos = demonstrations(plans)
    generated = DynamicMovementPrimitives().fit(demos, seed=0).generate(demos.outcomes_seen)
    np.testing.assert_allclose(generated, plans, atol=2e-3)


def test_onset_and_duration_are_interpolated_where_segmented():
    """Onsets and durations that depend affinely on the outcome: so do those of a new goal."""
    x, y = OUTCOMES.T
    starts, durations = 0.3 + y, 0.6 + 0.3 * x
    demos = family(starts, durations, np.ones(6))
    goal = np.array([[1.05, 0.1]])
    generated = DynamicMovementPrimitives().fit(demos, seed=0).generate(goal)[0]
    np.testing.assert_allclose(generated, throw(0.4, 0.915, 1.0), atol=3e-3)


def test_unsegmented_primitives_of_one_duration_mix_motions_and_nothing_else():
    """The equation is linear: interpolating weights is interpolating motions."""
    demos = family(
        np.array([0.1, 0.3, 0.5, 0.2, 0.4, 0.6]), np.full(6, 1.0), np.linspace(0.8, 1.2, 6)
    )
    goals = np.random.default_rng(0).uniform([0.9, -0.3], [1.2, 0.3], size=(5, 2))
    config = DynamicMovementPrimitivesConfig(segmented=False)
    primitives = DynamicMovementPrimitives(config).fit(demos, seed=0).generate(goals)
    mixture = (
        SmoothInterpolation(SmoothInterpolationConfig(kernel="thin-plate"))
        .fit(demos, seed=0)
        .generate(goals)
    )
    np.testing.assert_allclose(primitives, mixture, atol=2e-3)


@pytest.mark.parametrize(("setting", "value"), [("frames_per_weight", 0.5), ("ridge", 0.0)])
def test_senseless_settings_are_refused(setting: str, value: float):
    with pytest.raises(ConfigurationError, match=setting):
        DynamicMovementPrimitivesConfig(**{setting: value})


def test_weights_are_fitted_once_and_not_for_every_plan(monkeypatch: pytest.MonkeyPatch):
    demos = family(np.linspace(0.1, 0.4, 6), np.full(6, 0.9), np.linspace(0.8, 1.1, 6))
    fitted, smooth_weights = [], dmp.smooth_weights

    def counted(*arguments, **settings):
        fitted.append(1)
        return smooth_weights(*arguments, **settings)

    monkeypatch.setattr(dmp, "smooth_weights", counted)
    made = DynamicMovementPrimitives().fit(demos, seed=0)
    made.generate(demos.outcomes_seen)
    made.generate(demos.outcomes_seen)
    assert len(fitted) == 1
