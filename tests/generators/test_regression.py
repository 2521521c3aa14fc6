"""U-Net regression: it fits its demonstrations, with the network that diffusion has."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import load_generator
from prior_reinforce.generators.diffusion_config import DiffusionConfig
from prior_reinforce.generators.regression import UNetRegression
from prior_reinforce.generators.regression_config import UNetRegressionConfig
from prior_reinforce.generators.unet import ConditionalUNet
from prior_reinforce.generators.unet_size import UNetSize
from prior_reinforce.plans.motions import Demonstrations, PlanFormat

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


def test_network_and_codec_are_those_of_diffusion():
    """So that a comparison of the two compares diffusion with regression, and nothing else."""
    ours, theirs = UNetRegressionConfig(), DiffusionConfig()
    for setting in ("network", "representation", "frames_per_point", "margin"):
        assert getattr(ours, setting) == getattr(theirs, setting)


@pytest.mark.slow
def test_the_demonstrations_are_fitted_and_the_loss_falls():
    demos = demonstrations()
    losses: list[float] = []
    generator = UNetRegression(SMALL, threads=1).fit(
        demos, seed=0, progress=lambda progress: losses.append(progress.loss)
    )
    assert losses[-1] < 1e-2 * losses[0]
    generated = generator.generate(demos.outcomes_seen)
    assert np.sqrt(np.mean((generated - demos.plans) ** 2)) < 0.02  # [rad] of a swing of 1


@pytest.mark.slow
def test_another_seed_draws_other_initial_weights():
    demos = demonstrations()
    config = replace(SMALL, training_steps=2)
    one = UNetRegression(config, threads=1).fit(demos, seed=0).generate(demos.outcomes_seen)
    other = UNetRegression(config, threads=1).fit(demos, seed=1).generate(demos.outcomes_seen)
    assert np.abs(one - other).max() > 1e-3


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("training_steps", 0),
        ("learning_rate", 0.0),
        ("weight_decay", -1.0),
        ("representation", "spline"),
    ],
)
def test_senseless_settings_are_refused(setting: str, value: float | str):
    with pytest.raises(ConfigurationError, match=setting):
        UNetRegressionConfig(**{setting: value})


def test_plans_are_the_same_on_any_number_of_cores(monkeypatch):
    demos = demonstrations()
    config = replace(SMALL, training_steps=2)
    generator = UNetRegression(config, threads=1).fit(demos, seed=0)
    used: list[int] = []
    forward = ConditionalUNet.forward

    def listen(self, *inputs):
        used.append(torch.get_num_threads())
        return forward(self, *inputs)

    monkeypatch.setattr(ConditionalUNet, "forward", listen)
    all_cores = UNetRegression(config)
    all_cores._fitted = generator._fitted
    all_cores.generate(demos.outcomes_seen)
    assert used == [1]


def test_another_generators_device_is_refused(tmp_path):
    config = replace(SMALL, training_steps=1)
    UNetRegression(config, threads=1).fit(demonstrations(), seed=0).save(tmp_path)
    with pytest.raises(ConfigurationError, match="CPU only"):
        load_generator(tmp_path, device="cuda")
