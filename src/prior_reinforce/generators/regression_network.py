"""The network of U-Net regression, and its training."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import torch
from torch import nn

from prior_reinforce.generators.base import FitProgress
from prior_reinforce.generators.regression_config import UNetRegressionConfig
from prior_reinforce.generators.unet import ConditionalUNet
from prior_reinforce.generators.unet_size import UNetSize

_REPORTS = 200
"""Progress is told about so often in a fit."""


class RegressionNetwork(nn.Module):
    """A `ConditionalUNet` fed with a learned constant instead of a noisy code."""

    def __init__(self, channels: int, length: int, condition_dim: int, size: UNetSize) -> None:
        super().__init__()
        self.unet = ConditionalUNet(channels, condition_dim, size)
        self.input = nn.Parameter(torch.randn(1, channels, length))

    def forward(self, conditions: torch.Tensor) -> torch.Tensor:
        """Codes (B, C, T) for scaled conditions (B, k)."""
        n = len(conditions)
        codes: torch.Tensor = self.unet(self.input.expand(n, -1, -1), torch.zeros(n), conditions)
        return codes


def train(
    codes: torch.Tensor,
    conditions: torch.Tensor,
    config: UNetRegressionConfig,
    seed: int,
    progress: Callable[[FitProgress], None] | None,
) -> RegressionNetwork:
    """Fit a network to codes (N, C, T) of scaled conditions (N, k), on the threads torch has."""
    # Torch's layers draw their initial weights from the global generator: lend it, and put it back.
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = RegressionNetwork(
            codes.shape[1], codes.shape[2], conditions.shape[1], config.network
        )
    optimiser = torch.optim.AdamW(
        network.parameters(),
        lr=config.learning_rate,
        weight_decay=config.weight_decay,
        fused=True,
    )
    started = time.monotonic()
    n_steps = config.training_steps
    for step in range(n_steps):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * 0.5 * (1 + math.cos(math.pi * step / n_steps))
        loss = nn.functional.mse_loss(network(conditions), codes)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        done = step + 1
        if progress is not None and (done == n_steps or done % max(1, n_steps // _REPORTS) == 0):
            left = (time.monotonic() - started) / done * (n_steps - done)
            progress(FitProgress(done, n_steps, loss.item(), left))
    return network.eval().requires_grad_(False)
