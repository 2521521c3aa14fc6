"""The network of U-Net regression, and how it is trained."""

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from prior_reinforce.generators.network import training
from prior_reinforce.generators.network.config import UNetSize
from prior_reinforce.testing import synthetic_demonstrations
from reproduction.generators.regression import UNetRegression, UNetRegressionConfig
from reproduction.generators.regression_network import RegressionNetwork

TINY = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=8)


def test_regression_knows_time_from_its_learned_input():
    """Two networks that differ in that input alone give different codes; the batch is alike."""
    torch.manual_seed(0)
    regression = RegressionNetwork(3, 8, 2, TINY).eval()
    conditions = torch.tensor([[0.1, 0.2], [0.1, 0.2], [-0.5, 0.4]])
    with torch.no_grad():
        codes = regression(conditions)
        regression.input += torch.randn(regression.input.shape)
        assert not torch.allclose(regression(conditions), codes, atol=1e-3)
    assert codes.shape == (3, 3, 8)
    torch.testing.assert_close(codes[0], codes[1])


def test_a_killed_fit_goes_on_where_it_was_and_keeps_no_state_of_a_random_generator(
    tmp_path, monkeypatch
):
    """Nothing is drawn while it is trained; whatever else networks share is tested with theirs."""
    monkeypatch.setattr(training, "_SAVED_EVERY", 0.0)
    monkeypatch.setattr(training, "_SAVING", np.inf)
    demos, steps = synthetic_demonstrations(3), []

    def fit(**how):
        made = UNetRegression(UNetRegressionConfig(network=TINY, training_steps=2), states=tmp_path)
        return made.fit(demos, seed=0, **how)

    def kill(progress):
        steps.append(progress.step)
        if len(steps) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(progress=kill)
    (kept,) = tmp_path.iterdir()
    assert "rng" not in load_file(kept)
    again = fit(progress=lambda p: steps.append(p.step)).generate(demos.outcomes_seen)
    assert steps == [1, 2, 2]
    np.testing.assert_array_equal(again, fit().generate(demos.outcomes_seen))
