"""Batches of noise levels; sampling with denoisers that are known exactly, worked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from prior_reinforce.generators import DiffusionConfig
from prior_reinforce.generators.network.config import UNetSize
from prior_reinforce.generators.network.denoiser import draw_batch, loss, sample
from prior_reinforce.generators.network.noise_schedule import NoiseSchedule, mean_shift_levels
from prior_reinforce.generators.network.threads import torch_threads
from prior_reinforce.generators.network.training import build, optimise
from prior_reinforce.generators.network.unet import ConditionalUNet

CONFIG = DiffusionConfig(prediction="sample", margin=1.0, sampling_steps=6)
SCHEDULE = NoiseSchedule.squared_cosine(CONFIG.noise_levels)


def gaussian(spread):
    """The exact denoiser of plans that scatter around the condition: E[x_0 | x_t]."""

    def denoise(noisy, steps, conditions):
        signal = SCHEDULE.signal_at(int(steps[0]))
        gain = math.sqrt(signal) * spread**2 / (signal * spread**2 + 1 - signal)
        mean = conditions[:, :, None]
        return mean + gain * (noisy - math.sqrt(signal) * mean)

    return denoise


def mixture(weights, modes, spread):
    """The exact denoiser of a mixture of Gaussians, whatever the condition."""
    w, m = torch.tensor(weights), torch.tensor(modes)

    def denoise(noisy, steps, conditions):
        signal = SCHEDULE.signal_at(int(steps[0]))
        variance = signal * spread**2 + 1 - signal
        away = noisy[..., None] - math.sqrt(signal) * m
        share = torch.softmax(w.log() - away**2 / (2 * variance), dim=-1)
        gain = math.sqrt(signal) * spread**2 / variance
        return (share * (m + gain * away)).sum(dim=-1)

    return denoise


@pytest.mark.slow
def test_mean_shift_halves_what_is_left_as_worked_by_hand():
    """Opposite draws cancel in a linear denoiser: a known factor of what is left, a level."""
    spread, condition = 0.5, torch.tensor([[0.4], [-0.2]])
    left = -condition[0].item()  # the estimate starts at zero
    for level in mean_shift_levels(CONFIG.noise_levels, CONFIG.sampling_steps):
        signal = SCHEDULE.signal_at(level)
        left *= signal * spread**2 / (signal * spread**2 + 1 - signal)
    codes = sample(gaussian(spread), condition, (1, 3), CONFIG, seed=0)
    assert codes.shape == (2, 1, 3)
    torch.testing.assert_close(codes[0], torch.full((1, 3), 0.4 + left), atol=1e-5, rtol=0)
    torch.testing.assert_close(codes[1] * -2, codes[0], atol=1e-5, rtol=0)


def test_mean_shift_ends_in_a_mode_not_between_two():
    two = mixture([0.35, 0.65], [-0.8, 0.8], 0.05)
    config = DiffusionConfig(prediction="sample", margin=1.0, sampling_steps=12)
    codes = sample(two, torch.zeros(5, 2), (1, 1), config, seed=3)
    torch.testing.assert_close(codes, torch.full((5, 1, 1), 0.8), atol=0.02, rtol=0)


@pytest.mark.slow
@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("sampler", ["mean_shift", "ddpm"])
def test_a_code_depends_on_its_condition_alone(sampler, shared):
    config = DiffusionConfig(prediction="sample", margin=1.0, sampler=sampler, shared_noise=shared)
    conditions = torch.tensor([[0.1], [0.5], [-0.7]])
    together = sample(gaussian(0.01), conditions, (1, 4), config, seed=0)
    alone = sample(gaussian(0.01), conditions[1:2], (1, 4), config, seed=0)
    torch.testing.assert_close(together[1:2], alone, atol=1e-6, rtol=0)
    torch.testing.assert_close(together, conditions[:, :, None].expand(3, 1, 4), atol=0.03, rtol=0)


@pytest.mark.slow
def test_noise_is_shared_or_each_conditions_own():
    """Where plans scatter widely, DDPM ends a draw away from the condition."""
    conditions = torch.linspace(-0.5, 0.5, 400)[:, None]
    scatter = {}
    for shared in (True, False):
        config = DiffusionConfig(
            prediction="sample", margin=4.0, sampler="ddpm", shared_noise=shared
        )
        codes = sample(gaussian(0.2), conditions, (1, 1), config, seed=0)
        scatter[shared] = (codes[:, 0, 0] - conditions[:, 0]).std().item()
        other = sample(gaussian(0.2), conditions, (1, 1), config, seed=1)
        assert not torch.allclose(codes, other)
    assert scatter[True] < 0.01
    assert scatter[False] == pytest.approx(0.2, rel=0.15)


def test_levels_fall_and_reach_low_noise():
    assert mean_shift_levels(100, 6) == (95, 65, 42, 23, 10, 2)
    assert mean_shift_levels(100, 1) == (95,)


@pytest.mark.parametrize(("n", "size"), [(6, 24), (6, 10), (40, 24)])
def test_a_batch_holds_every_demonstration_alike_and_one_noise_level_of_each_stratum(n, size):
    config = replace(CONFIG, batch_size=size, noise_levels=1000, stratified=True)
    rows, levels = draw_batch(n, config, torch.Generator().manual_seed(0))
    counts = np.bincount(rows, minlength=n)
    assert counts.sum() == size
    assert np.ptp(counts) <= 1
    strata = np.sort(levels.numpy()) * size // 1000
    assert np.all(np.abs(strata - np.arange(size)) <= 1)


def test_the_papers_batch_is_one_pass_over_the_demonstrations():
    config = DiffusionConfig.paper()
    rows, levels = draw_batch(6, config, torch.Generator().manual_seed(0))
    assert sorted(rows.tolist()) == [0, 1, 2, 3, 4, 5]
    assert levels.min() >= 0
    assert levels.max() < 100


TINY = UNetSize(
    widths=(16, 32), groups=4, step_width=16, condition_width=32, activation="silu"
)  # fmt: skip
SHOWN = torch.tensor([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 0.0]])
BETWEEN = torch.tensor([[0.5, 0.5], [-0.5, 0.0], [0.0, 0.6], [0.3, -0.7]])


def ramps(conditions):
    """Codes in closed form: a condition's components weigh two motions of two channels."""
    t = torch.linspace(0, 1, 8)
    motions = torch.stack(
        [torch.stack([t, 1 - t]), torch.stack([torch.sin(3 * t), torch.full_like(t, -0.5)])]
    )
    return 0.5 * torch.einsum("nk,kct->nct", conditions, motions)


@pytest.mark.slow
@pytest.mark.parametrize("prediction", ["epsilon", "v", "sample"])
def test_the_network_itself_learns_codes_and_what_lies_between_them(prediction):
    """Nothing in closed form helps here; untrained it is off by more than the codes are large."""
    errors = {}
    for steps in (0, 150):
        config = DiffusionConfig(
            coordinates="time", prediction=prediction, network=TINY, training_steps=steps,
            learning_rate=5e-3, warmup_steps=10, ema_limit=0.95,
        )  # fmt: skip
        network = build(lambda: ConditionalUNet(2, 2, TINY), seed=0)
        of_step = loss(network, ramps(SHOWN), SHOWN, config, torch.Generator().manual_seed(0))
        how = {"betas": (0.95, 0.999), "decay": config.decay}
        with torch_threads(1):
            network = optimise(network, of_step, config, lambda progress: None, **how)
        errors[steps] = [
            (sample(network, c, (2, 8), config, seed=0) - ramps(c)).square().mean().sqrt().item()
            for c in (SHOWN, BETWEEN)
        ]
    size = ramps(SHOWN).square().mean().sqrt()  # 0.38
    assert min(errors[0]) > size
    assert errors[150][0] < 0.1 * size
    assert errors[150][1] < (0.4 if prediction == "sample" else 0.2) * size
