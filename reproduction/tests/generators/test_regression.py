"""U-Net regression: it fits its demonstrations, with the network that diffusion has."""

import numpy as np
import pytest

from prior_reinforce.generators.network.config import DiffusionConfig, UNetSize
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.generators.regression import UNetRegression, UNetRegressionConfig

SMALL = UNetRegressionConfig(
    network=UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=16),
    training_steps=200,
    learning_rate=1e-2,
    weight_decay=1e-2,
)
FORMAT = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.02)


def demonstrations() -> Demonstrations:
    """Four swings that begin at one time and reach as far as their outcome says."""
    outcomes = np.array([[0.9, -0.2], [0.9, 0.2], [1.2, -0.2], [1.2, 0.2]])
    s = np.clip((np.arange(64) / 64 - 0.2) / 0.6, 0, 1)
    path = 10 * s**3 - 15 * s**4 + 6 * s**5
    plans = np.stack([np.stack([x * path, y + 0 * path], axis=1) for x, y in outcomes])
    return Demonstrations(plans, outcomes, FORMAT)


@pytest.mark.slow
def test_the_demonstrations_are_fitted_and_the_loss_falls():
    demos = demonstrations()
    losses: list[float] = []
    generator = UNetRegression(SMALL).fit(
        demos, seed=0, progress=lambda progress: losses.append(progress.loss)
    )
    assert losses[-1] < 0.1 * losses[0]  # a running mean over 100 steps
    generated = generator.generate(demos.outcomes_seen)
    assert np.sqrt(np.mean((generated - demos.plans) ** 2)) < 0.02  # [rad] of a swing of 1


def test_regression_differs_from_diffusion_in_nothing_but_diffusion():
    """Network and codec are the same, so that a comparison of the two is one of methods."""
    ours, theirs = UNetRegressionConfig(), DiffusionConfig()
    for setting in ("network", "representation", "frames_per_point", "margin"):
        assert getattr(ours, setting) == getattr(theirs, setting)
