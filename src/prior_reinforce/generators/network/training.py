"""The optimiser loop: AdamW, a learning rate that rises and falls, averaged weights, progress.

Diffusion and regression pass the loss of a step. A long training keeps its state in a file, and
resumes from it with identical digits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import write
from prior_reinforce.generators.base import FitProgress, OnProgress
from prior_reinforce.generators.network.config import UNetConfig
from prior_reinforce.generators.network.threads import torch
from prior_reinforce.generators.saving import without_prefix

_REPORTS = 200
"""Progress reports of a fit, approximately."""
_MEMORY = 100
"""Steps over which the reported loss is averaged."""

_SAVED_EVERY = 60.0
"""Least time between two saved states, in [s]. Ours: what a killed training usually loses."""
_SAVING = 0.02
"""Largest share of the time for saving. Ours: the paper's network has a state of 1.1 GB, and a busy
machine took longer to save it each minute than to train."""

Network = TypeVar("Network", bound=torch.nn.Module)


def build(make: Callable[[], Network], seed: int) -> Network:
    """Make a network with weights drawn from a seed.

    Torch's layers draw their initial weights from the global generator, whose state is restored.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make()


def optimise(
    network: Network,
    loss_of_step: Callable[[], torch.Tensor],
    config: UNetConfig,
    progress: OnProgress,
    *,
    betas: tuple[float, float] = (0.9, 0.999),
    decay: Callable[[int], float] | None = None,
    rng: torch.Generator | None = None,
    state: Path | None = None,
) -> Network:
    """Fit a network, on the threads torch has.

    Args:
        network: The network.
        loss_of_step: Runs the network on a batch and returns the loss.
        config: Steps, learning rate and weight decay.
        progress: Called some 200 times.
        betas: Of AdamW.
        decay: How much of their average the averaged weights keep after n steps; no averaging if
            None.
        rng: Random generator of `loss_of_step`, if it draws.
        state: File of this training's state alone: training resumes from it if it exists, and keeps
            it up to date. None: nothing is kept.

    Returns:
        The network, with averaged weights if so, in evaluation mode.

    Raises:
        FileFormatError: The file is not the state of such a training.
    """
    optimiser = torch.optim.AdamW(
        network.parameters(),
        lr=config.learning_rate,
        betas=betas,
        weight_decay=config.weight_decay,
        fused=True,
    )
    average = None
    if decay is not None:
        average = AveragedModel(network, multi_avg_fn=_averaging(decay))
    run = _Run(network, optimiser, average, rng)
    n_steps = config.training_steps
    before, mean_loss = (0, 0.0) if state is None else run.restored(state, n_steps)
    started = time.monotonic()
    due = started + _SAVED_EVERY
    for done in range(before + 1, n_steps + 1):
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * learning_rate_factor(done - 1, config)
        loss = loss_of_step()
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        if average is not None:
            average.update_parameters(network)
        mean_loss += (loss.item() - mean_loss) / min(done, _MEMORY)
        if done == n_steps or done % max(1, n_steps // _REPORTS) == 0:
            left = (time.monotonic() - started) / (done - before) * (n_steps - done)
            progress(FitProgress(done, n_steps, mean_loss, left))
        if state is not None and (now := time.monotonic()) > due:
            run.save(state, done, mean_loss)
            took = time.monotonic() - now
            due = now + took + max(_SAVED_EVERY, took / _SAVING)
    fitted = network if average is None else cast(Network, average.module)
    return fitted.eval().requires_grad_(False)


@dataclass(frozen=True)
class _Run:
    """The state of a training."""

    network: torch.nn.Module
    optimiser: torch.optim.Optimizer
    average: AveragedModel | None
    rng: torch.Generator | None

    def save(self, path: Path, done: int, mean_loss: float) -> None:
        """Write the state, whole or not at all."""
        from safetensors.torch import save

        moments = self.optimiser.state_dict()["state"]
        tensors = {
            **{f"network.{name}": value for name, value in self.network.state_dict().items()},
            **{f"moment.{i}.{key}": v for i, of in moments.items() for key, v in of.items()},
            "progress": torch.tensor([done, mean_loss], dtype=torch.float64),
        }
        if self.average is not None:
            averaged = self.average.state_dict()
            tensors |= {f"average.{name}": value for name, value in averaged.items()}
        if self.rng is not None:
            tensors["rng"] = self.rng.get_state()
        write(path, save({name: value.contiguous() for name, value in tensors.items()}))

    def restored(self, path: Path, n_steps: int) -> tuple[int, float]:
        """Restore a saved state, and return the steps done and the mean loss; 0 without a file.

        FileFormatError if it is damaged, or of another training.
        """
        from safetensors import SafetensorError
        from safetensors.torch import load

        if not path.is_file():
            return 0, 0.0
        try:
            tensors = load(path.read_bytes())
            done, mean_loss = tensors["progress"].tolist()
            if not 0 < done < n_steps:
                raise ValueError(f"{done:g} of {n_steps} steps are done")
            self.network.load_state_dict(without_prefix("network.", tensors))
            moments: dict[int, dict[str, torch.Tensor]] = {}
            for name, value in without_prefix("moment.", tensors).items():
                number, key = name.split(".")
                moments.setdefault(int(number), {})[key] = value
            self.optimiser.load_state_dict({**self.optimiser.state_dict(), "state": moments})
            if self.average is not None:
                self.average.load_state_dict(without_prefix("average.", tensors))
            if self.rng is not None:
                self.rng.set_state(tensors["rng"])
        except (SafetensorError, KeyError, ValueError, RuntimeError) as error:
            raise FileFormatError(
                f"{path} is not the state of this training: {error}; remove it to begin anew"
            ) from error
        return int(done), float(mean_loss)


def _averaging(decay: Callable[[int], float]) -> Callable[..., None]:
    """Return torch's exponential averaging, with a decay that changes from step to step."""

    def average(averaged: Any, current: Any, n: torch.Tensor) -> None:
        step: Any = get_ema_multi_avg_fn(decay(int(n)))  # type: ignore[no-untyped-call]
        step(averaged, current, n)

    return average


def learning_rate_factor(step: int, config: UNetConfig) -> float:
    """Return linear warm-up, then half a cosine down to 0 at the last step; in [0, 1]."""
    if step < config.warmup_steps:
        return step / config.warmup_steps
    span = max(1, config.training_steps - config.warmup_steps)
    return 0.5 * (1 + math.cos(math.pi * (step - config.warmup_steps) / span))
