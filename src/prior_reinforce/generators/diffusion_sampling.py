"""From a condition to a code: three ways to run a trained denoiser, each a function.

The adapter needs the same plan for the same condition, and near plans for near conditions. So
nothing is drawn while sampling: what noise there is comes from the fit's seed and is shared by all
conditions.
"""

from __future__ import annotations

import torch

from prior_reinforce.generators.diffusion_config import DiffusionConfig
from prior_reinforce.generators.noise_schedule import (
    NoiseSchedule,
    inference_steps,
    mean_shift_levels,
)
from prior_reinforce.generators.unet import ConditionalUNet


@torch.no_grad()
def sample(
    network: ConditionalUNet,
    conditions: torch.Tensor,
    shape: tuple[int, int],
    config: DiffusionConfig,
    *,
    seed: int,
) -> torch.Tensor:
    """Return one code for each condition.

    Args:
        network: Trained by `train` with the same config.
        conditions: Scaled conditions, shape (n, k), on the network's device.
        shape: (C, T) of a code.
        config: Sampler and its settings.
        seed: Of the shared noise.

    Returns:
        Codes, shape (n, C, T).
    """
    run = {"mean_shift": _mean_shift, "ddim": _ddim, "ddpm": _ddpm}[config.sampler]
    return run(network, conditions, shape, config, torch.Generator().manual_seed(seed))


def _mean_shift(
    network: ConditionalUNet,
    conditions: torch.Tensor,
    shape: tuple[int, int],
    config: DiffusionConfig,
    rng: torch.Generator,
) -> torch.Tensor:
    """Climb to a mode of what was learned: annealed mean shift.

    An estimate x_0 is noised, at a few falling levels, with the same K draws for every condition,
    and replaced by the mean of the K clean estimates. The mean over noise of E[x_0 | x_t] is a
    mean-shift step at the scale of that noise [Comaniciu2002], so the estimate starts at the mean
    of all plans for the condition and ends at a mode. Ours; DDIM from x_T = 0 shows the network
    inputs with less noise than it was trained on, and has two to three times the error
    (docs/decisions-generator.md).
    """
    n, draws = len(conditions), config.noise_draws
    half = torch.randn((draws // 2, *shape), generator=rng)
    # Opposite draws cancel what is odd in the noise.
    noise = torch.cat([half, -half]).to(conditions.device).repeat(n, 1, 1)
    repeated = conditions.repeat_interleave(draws, dim=0)
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    x = torch.zeros((n, *shape), device=conditions.device)
    for level in mean_shift_levels(config.noise_levels, config.sampling_steps):
        levels = torch.full((n * draws,), level, device=conditions.device)
        noisy = schedule.add_noise(x.repeat_interleave(draws, dim=0), noise, levels)
        clean = _clean(network, noisy, level, repeated, schedule, config)
        x = clean.view(n, draws, *shape).mean(dim=1)
    return x


def _ddim(
    network: ConditionalUNet,
    conditions: torch.Tensor,
    shape: tuple[int, int],
    config: DiffusionConfig,
    rng: torch.Generator,
) -> torch.Tensor:
    """DDIM [Song2021] from x_T = 0, the mean of the latents."""
    del rng
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    steps = inference_steps(config.noise_levels, config.sampling_steps)
    x = torch.zeros((len(conditions), *shape), device=conditions.device)
    for step, next_step in zip(steps, (*steps[1:], -1), strict=True):
        clean = _clean(network, x, step, conditions, schedule, config)
        x = schedule.ddim_step(x, clean, step, next_step)
    return x


def _ddpm(
    network: ConditionalUNet,
    conditions: torch.Tensor,
    shape: tuple[int, int],
    config: DiffusionConfig,
    rng: torch.Generator,
) -> torch.Tensor:
    """DDPM [Ho2020] over all levels, as the paper samples; one noise path for all conditions."""
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    latent = torch.randn((1, *shape), generator=rng)
    x = latent.to(conditions.device).expand(len(conditions), -1, -1)
    for step in range(config.noise_levels - 1, -1, -1):
        clean = _clean(network, x, step, conditions, schedule, config)
        noise = torch.randn((1, *shape), generator=rng).to(conditions.device)
        x = schedule.ddpm_step(x, clean, step, noise)
    return x


def _clean(
    network: ConditionalUNet,
    noisy: torch.Tensor,
    step: int,
    conditions: torch.Tensor,
    schedule: NoiseSchedule,
    config: DiffusionConfig,
) -> torch.Tensor:
    """The network's estimate of x_0, clipped to the demonstrated range and its margin."""
    steps = torch.full((len(noisy),), step, device=noisy.device)
    predicted = network(noisy, steps, conditions)
    bound = 1 + config.margin
    return schedule.clean_estimate(noisy, predicted, step, config.prediction).clamp(-bound, bound)
