"""The schedule against its closed form; the steps against worked values and exact recovery."""

import math

import numpy as np
import pytest
import torch

from prior_reinforce.generators.network.noise_schedule import NoiseSchedule

SCHEDULE = NoiseSchedule.squared_cosine(100)


def test_signal_is_the_closed_form_where_no_beta_is_capped():
    # The product telescopes: abar_t = f(t + 1) / f(0).
    def f(i):
        return math.cos((i / 100 + 0.008) / 1.008 * math.pi / 2) ** 2

    expected = [f(t + 1) / f(0) for t in range(99)]
    np.testing.assert_allclose(SCHEDULE.signal[:99], expected, rtol=1e-12)


def test_only_the_last_beta_is_capped():
    beta = 1 - SCHEDULE.signal[1:] / SCHEDULE.signal[:-1]
    assert float(beta[-1]) == pytest.approx(0.999, abs=1e-12)
    assert float(beta[-2]) < 0.8


def test_ddpm_step_worked_by_hand():
    # abar_1 = 0.5, abar_0 = 0.8: alpha = 0.625, beta = 0.375. With x_1 = 2 and x_0 = 1 the mean is
    # sqrt(.8) .375 / .5 * 1 + sqrt(.625) .2 / .5 * 2 = 0.670820 + 0.632456, the variance
    # .375 * .2 / .5 = 0.15.
    schedule = NoiseSchedule(torch.tensor([0.8, 0.5], dtype=torch.float64))
    noisy, clean, noise = (torch.full((1, 1, 1), value).double() for value in (2.0, 1.0, 1.0))
    stepped = schedule.ddpm_step(noisy, clean, 1, noise)
    assert stepped.item() == pytest.approx(0.670820 + 0.632456 + math.sqrt(0.15), abs=1e-6)
    assert schedule.ddpm_step(noisy, clean, 0, noise).item() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("prediction", ["epsilon", "v", "sample"])
@pytest.mark.parametrize("step", [0, 40, 95])
def test_a_perfect_prediction_gives_back_the_clean_sample(prediction, step):
    rng = torch.Generator().manual_seed(0)
    clean = torch.rand((3, 2, 8), generator=rng, dtype=torch.float64) * 2 - 1
    noise = torch.randn((3, 2, 8), generator=rng, dtype=torch.float64)
    levels = torch.full((3,), step)
    noisy = SCHEDULE.add_noise(clean, noise, levels)
    predicted = SCHEDULE.target(clean, noise, levels, prediction)
    estimate = SCHEDULE.clean_estimate(noisy, predicted, step, prediction)
    torch.testing.assert_close(estimate, clean, atol=1e-9, rtol=0)


def test_ddpm_steps_have_the_marginals_of_the_forward_process():
    # From x_t of the forward process, one exact reverse step has x_{t-1}'s mean and variance.
    rng = torch.Generator().manual_seed(2)
    clean = torch.full((200_000, 1, 1), 0.7, dtype=torch.float64)
    noise, fresh = (torch.randn(clean.shape, generator=rng, dtype=torch.float64) for _ in range(2))
    noisy = SCHEDULE.add_noise(clean, noise, torch.full((len(clean),), 60))
    stepped = SCHEDULE.ddpm_step(noisy, clean, 60, fresh)
    signal = SCHEDULE.signal_at(59)
    assert stepped.mean().item() == pytest.approx(math.sqrt(signal) * 0.7, abs=0.01)
    assert stepped.var().item() == pytest.approx(1 - signal, rel=0.01)


def test_a_prediction_that_does_not_exist_is_never_taken_for_another():
    sample = torch.zeros((1, 1, 1))
    with pytest.raises(AssertionError, match="eps"):
        SCHEDULE.target(sample, sample, torch.tensor([3]), "eps")
    with pytest.raises(AssertionError, match="eps"):
        SCHEDULE.clean_estimate(sample, sample, 3, "eps")
