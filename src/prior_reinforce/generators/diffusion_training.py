"""Training of the denoising network on a handful of codes."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable

import torch

from prior_reinforce.generators.base import FitProgress
from prior_reinforce.generators.diffusion_config import DiffusionConfig
from prior_reinforce.generators.noise_schedule import NoiseSchedule
from prior_reinforce.generators.unet import ConditionalUNet

# Diffusion Policy's optimiser (real-stanford/diffusion_policy, commit 5ba07ac).
_BETAS = (0.95, 0.999)
_EPS = 1e-8
_REPORTS = 200
"""Progress is told about so often in a fit."""


def train(
    codes: torch.Tensor,
    conditions: torch.Tensor,
    config: DiffusionConfig,
    *,
    seed: int,
    progress: Callable[[FitProgress], None] | None = None,
) -> ConditionalUNet:
    """Fit a network to all codes.

    Args:
        codes: x_0 of the demonstrations, shape (N, C, T), on the device to train on.
        conditions: Scaled outcomes, shape (N, k), on the same device.
        config: Network, optimiser and so on.
        seed: Of initial weights, noise and noise levels.
        progress: Called some 200 times.

    Returns:
        The network with exponentially averaged weights, in evaluation mode.
    """
    device = codes.device
    # Torch's layers draw their initial weights from the global generator: lend it, and put it back.
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = ConditionalUNet(codes.shape[1], conditions.shape[1], config.network).to(device)
    averaged = copy.deepcopy(network)
    rng = torch.Generator().manual_seed(seed)
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    optimiser = torch.optim.AdamW(
        network.parameters(),
        lr=config.learning_rate,
        betas=_BETAS,
        eps=_EPS,
        weight_decay=config.weight_decay,
        fused=True,
    )
    started = time.monotonic()
    mean_loss = 0.0
    for step in range(config.training_steps):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * learning_rate_factor(step, config)
        rows, levels = draw_batch(len(codes), config, rng)
        noise = torch.randn((len(rows), *codes.shape[1:]), generator=rng).to(device)
        rows, levels = rows.to(device), levels.to(device)
        clean = codes[rows]
        noisy = schedule.add_noise(clean, noise, levels)
        target = schedule.target(clean, noise, levels, config.prediction)
        loss = torch.nn.functional.mse_loss(network(noisy, levels, conditions[rows]), target)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        _average(
            averaged, network, decay=min(1 - (1 + step) ** -config.ema_power, config.ema_limit)
        )
        if progress is not None:
            done = step + 1
            mean_loss += (loss.item() - mean_loss) / min(done, 100)
            if (
                done == config.training_steps
                or done % max(1, config.training_steps // _REPORTS) == 0
            ):
                left = (time.monotonic() - started) / done * (config.training_steps - done)
                progress(FitProgress(done, config.training_steps, mean_loss, left))
    return averaged.eval().requires_grad_(False)


def learning_rate_factor(step: int, config: DiffusionConfig) -> float:
    """Linear warm-up, then half a cosine down to 0 at the last step; in [0, 1]."""
    if step < config.warmup_steps:
        return step / config.warmup_steps
    span = max(1, config.training_steps - config.warmup_steps)
    return 0.5 * (1 + math.cos(math.pi * (step - config.warmup_steps) / span))


def draw_batch(
    n: int, config: DiffusionConfig, rng: torch.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw which demonstrations and which noise levels make a batch.

    Args:
        n: N, demonstrations there are.
        config: Batch size and how it is filled.
        rng: Source of both.

    Returns:
        Rows (B,) in 0 ... N-1, each as often as any other to within one; levels (B,) in 0 ... T-1.
    """
    size = config.batch_size if config.fill_batch else min(config.batch_size, n)
    passes = math.ceil(size / n)
    rows = torch.cat([torch.randperm(n, generator=rng) for _ in range(passes)])[:size]
    if not config.stratified:
        return rows, torch.randint(config.noise_levels, (size,), generator=rng)
    strata = torch.randperm(size, generator=rng)
    position = (strata + torch.rand(size, generator=rng)) / size
    return rows, (position * config.noise_levels).long().clamp(max=config.noise_levels - 1)


@torch.no_grad()
def _average(averaged: ConditionalUNet, network: ConditionalUNet, decay: float) -> None:
    torch._foreach_lerp_(list(averaged.parameters()), list(network.parameters()), 1 - decay)
