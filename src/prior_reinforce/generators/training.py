"""The one optimiser loop: AdamW, a learning rate that rises and falls, averaged weights, progress.

Diffusion and regression hand in what a step's loss is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, TypeVar, cast

from torch.optim.lr_scheduler import LambdaLR
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from prior_reinforce.generators.base import FitProgress, Report
from prior_reinforce.generators.config import UNetConfig
from prior_reinforce.generators.threads import torch

_REPORTS = 200
"""Progress is told about so often in a fit."""
_MEMORY = 100
"""Steps over which the reported loss is averaged."""

Network = TypeVar("Network", bound=torch.nn.Module)


def build(make: Callable[[], Network], seed: int) -> Network:
    """Make a network with weights drawn from a seed.

    Torch's layers draw their initial weights from the global generator: lend it, and put it back.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make()


def optimise(
    network: Network,
    loss_of_step: Callable[[], torch.Tensor],
    config: UNetConfig,
    progress: Report,
    *,
    betas: tuple[float, float] = (0.9, 0.999),
    decay: Callable[[int], float] | None = None,
) -> Network:
    """Fit a network, on the threads torch has.

    Args:
        network: What is fitted.
        loss_of_step: Runs the network on a batch and returns the loss.
        config: Steps, learning rate and weight decay.
        progress: Called some 200 times.
        betas: Of AdamW.
        decay: How much of their average the averaged weights keep after n steps; no averaging if
            None.

    Returns:
        The network, with averaged weights if so, in evaluation mode.
    """
    optimiser = torch.optim.AdamW(
        network.parameters(),
        lr=config.learning_rate,
        betas=betas,
        weight_decay=config.weight_decay,
        fused=True,
    )
    schedule = LambdaLR(optimiser, lambda step: learning_rate_factor(step, config))
    average = None
    if decay is not None:
        average = AveragedModel(network, multi_avg_fn=_averaging(decay))
    started, mean_loss, n_steps = time.monotonic(), 0.0, config.training_steps
    for done in range(1, n_steps + 1):
        loss = loss_of_step()
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        schedule.step()
        if average is not None:
            average.update_parameters(network)
        mean_loss += (loss.item() - mean_loss) / min(done, _MEMORY)
        if done == n_steps or done % max(1, n_steps // _REPORTS) == 0:
            left = (time.monotonic() - started) / done * (n_steps - done)
            progress(FitProgress(done, n_steps, mean_loss, left))
    fitted = network if average is None else cast(Network, average.module)
    return fitted.eval().requires_grad_(False)


def _averaging(decay: Callable[[int], float]) -> Callable[..., None]:
    """Torch's exponential averaging, with a decay that changes from step to step."""

    def average(averaged: Any, current: Any, n: torch.Tensor) -> None:
        step: Any = get_ema_multi_avg_fn(decay(int(n)))  # type: ignore[no-untyped-call]
        step(averaged, current, n)

    return average


def learning_rate_factor(step: int, config: UNetConfig) -> float:
    """Linear warm-up, then half a cosine down to 0 at the last step; in [0, 1]."""
    if step < config.warmup_steps:
        return step / config.warmup_steps
    span = max(1, config.training_steps - config.warmup_steps)
    return 0.5 * (1 + math.cos(math.pi * (step - config.warmup_steps) / span))
