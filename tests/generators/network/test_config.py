"""Settings: what is out of range is named, by whoever makes them."""

from dataclasses import asdict

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.network.config import DiffusionConfig, UNetSize
from prior_reinforce.registry import build


@pytest.mark.parametrize(
    "wrong",
    [{"widths": ()}, {"widths": (64, 100)}, {"widths": (0,)}, {"kernel": 4}, {"kernel": 0},
     {"groups": 0}, {"step_width": 2}, {"step_width": 9}, {"condition_width": 0},
     {"activation": "relu"}],
)  # fmt: skip
def test_sizes_that_do_not_fit_are_named(wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        UNetSize(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [{"training_steps": -1}, {"sampling_steps": 101}, {"learning_rate": 0.0}, {"ema_limit": 1.0},
     {"margin": -0.1}, {"warmup_steps": -1}, {"noise_draws": 3}, {"prediction": "eps"},
     {"sampler": "dpm"}, {"representation": "spline"},
     {"margin": float("nan")}, {"training_steps": 2.5}],
)  # fmt: skip
def test_settings_out_of_range_are_named(wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        DiffusionConfig(**wrong)


@pytest.mark.parametrize("config", [DiffusionConfig.paper(), DiffusionConfig()])
def test_settings_survive_json(config):
    assert build(type(config), asdict(config)) == config
