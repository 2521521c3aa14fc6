"""From a condition to a code: three ways to run a trained denoiser, each a function.

The adapter needs the same plan for the same condition, and near plans for near conditions. So
nothing is drawn while sampling: what noise there is comes from the fit's seed and is shared by all
conditions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    denoiser = _Denoiser(network, conditions, shape, config, schedule)
    return _SAMPLERS[config.sampler](denoiser, torch.Generator().manual_seed(seed))


@dataclass(frozen=True)
class _Denoiser:
    """A trained network with the conditions it is asked about."""

    network: ConditionalUNet
    conditions: torch.Tensor
    """Shape (n, k)."""
    shape: tuple[int, int]
    """(C, T) of a code."""
    config: DiffusionConfig
    schedule: NoiseSchedule

    def mean(self) -> torch.Tensor:
        """The mean of all latents, which is zero, for each condition; shape (n, C, T)."""
        return torch.zeros((len(self.conditions), *self.shape), device=self.conditions.device)

    def noise(self, count: int, rng: torch.Generator) -> torch.Tensor:
        """Draws that all conditions share; shape (count, C, T)."""
        return torch.randn((count, *self.shape), generator=rng).to(self.conditions.device)

    def clean(self, noisy: torch.Tensor, level: int) -> torch.Tensor:
        """The network's estimate of x_0, clipped to the demonstrated range and its margin.

        Args:
            noisy: Codes, shape (n * copies, C, T), a condition's copies one after another.
            level: Of the noise in all of them.
        """
        conditions = self.conditions.repeat_interleave(len(noisy) // len(self.conditions), dim=0)
        levels = torch.full((len(noisy),), level, device=noisy.device)
        predicted = self.network(noisy, levels, conditions)
        bound = 1 + self.config.margin
        estimate = self.schedule.clean_estimate(noisy, predicted, level, self.config.prediction)
        return estimate.clamp(-bound, bound)


def _mean_shift(denoiser: _Denoiser, rng: torch.Generator) -> torch.Tensor:
    """Climb to a mode of what was learned: annealed mean shift.

    An estimate x_0 is noised, at a few falling levels, with the same K draws for every condition,
    and replaced by the mean of the K clean estimates. The mean over noise of E[x_0 | x_t] is a
    mean-shift step at the scale of that noise [Comaniciu2002], so the estimate starts at the mean
    of all plans for the condition and ends at a mode. Ours; DDIM from x_T = 0 shows the network
    inputs with less noise than it was trained on, and has two to three times the error
    (docs/decisions-generator.md).
    """
    config, schedule = denoiser.config, denoiser.schedule
    draws = config.noise_draws
    half = denoiser.noise(draws // 2, rng)
    # Opposite draws cancel what is odd in the noise.
    x = denoiser.mean()
    noise = torch.cat([half, -half]).repeat(len(x), 1, 1)
    for level in mean_shift_levels(config.noise_levels, config.sampling_steps):
        levels = torch.full((len(noise),), level, device=x.device)
        noisy = schedule.add_noise(x.repeat_interleave(draws, dim=0), noise, levels)
        x = denoiser.clean(noisy, level).view(len(x), draws, *denoiser.shape).mean(dim=1)
    return x


def _ddim(denoiser: _Denoiser, rng: torch.Generator) -> torch.Tensor:
    """DDIM [Song2021] from x_T = 0, the mean of the latents."""
    del rng
    config = denoiser.config
    steps = inference_steps(config.noise_levels, config.sampling_steps)
    x = denoiser.mean()
    for step, next_step in zip(steps, (*steps[1:], -1), strict=True):
        x = denoiser.schedule.ddim_step(x, denoiser.clean(x, step), step, next_step)
    return x


def _ddpm(denoiser: _Denoiser, rng: torch.Generator) -> torch.Tensor:
    """DDPM [Ho2020] over all levels, as the paper samples; one noise path for all conditions."""
    x = denoiser.mean() + denoiser.noise(1, rng)
    for step in range(denoiser.config.noise_levels - 1, -1, -1):
        clean = denoiser.clean(x, step)
        x = denoiser.schedule.ddpm_step(x, clean, step, denoiser.noise(1, rng))
    return x


_SAMPLERS: dict[str, Callable[[_Denoiser, torch.Generator], torch.Tensor]] = {
    "mean_shift": _mean_shift,
    "ddim": _ddim,
    "ddpm": _ddpm,
}
