"""U-Net regression: the diffusion generator's network without diffusion, the paper's "UNet".

    theta, x = argmin mean_i |U_theta(x, 0, r_i) - code(A_i)|^2,    A(c) = decode(U_theta(x, 0, c))

One forward pass maps an outcome to a plan. The network, the codec and the scaling of conditions are
those of `diffusion`; where that one feeds a noisy code, this feeds a constant x that is learned
with the weights. (Fed with zeros, convolutions know time only from the padding at the ends.)

Notation:
    x      learned input   (C, T)     [-]
    codes  coded plans     (N, C, T)  [-], in [-1, 1]
    r, c   outcomes seen, conditions, scaled  (., k)  [-]
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, get_args

import numpy as np
import torch
from torch import nn
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.coded_network import CodedNetwork, as_tensor
from prior_reinforce.generators.conditions import ConditionScale
from prior_reinforce.generators.representation import Representation
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.generators.start_time import StartTimeCodec
from prior_reinforce.generators.threads import torch_threads
from prior_reinforce.generators.unet import ConditionalUNet, UNetSize
from prior_reinforce.motions import Demonstrations

_REPORTS = 200
"""Progress is told about so often in a fit."""
_CPU = torch.device("cpu")


@dataclass(frozen=True)
class UNetRegressionConfig:
    """Everything that decides what `UNetRegression` learns; docs/baselines.md tells what was tried.

    Network and representation default to the diffusion generator's, so that the two differ in
    nothing but diffusion.
    """

    representation: Representation = "splines"
    """Code plans by spline control points where they fit, or by raw frames."""
    frames_per_point: int = 4
    """Frames for each spline control point."""
    start_times: bool = True
    """Predict when the motion starts as a number of its own, as the diffusion generator does."""
    margin: float = 0.05
    """How far plans may leave the demonstrated range of a dimension, as a fraction of it."""
    network: UNetSize = field(
        default_factory=lambda: UNetSize(
            widths=(64, 128, 128), step_width=64, condition_width=64, activation="silu"
        )
    )
    """Size of the U-Net."""
    training_steps: int = 800
    """Optimiser steps, each on all demonstrations."""
    learning_rate: float = 3e-3
    """Peak of the cosine schedule, which starts there and ends at 0."""
    weight_decay: float = 2.0
    """Of AdamW. Large, because a network that meets six demonstrations to a milliradian ripples
    between them: with next to none the error at new goals was three times as large."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if self.representation not in get_args(Representation):
            raise ConfigurationError(
                f"representation must be one of {get_args(Representation)}, "
                f"got {self.representation!r}"
            )
        for name in ("frames_per_point", "training_steps"):
            if getattr(self, name) < 1:
                raise ConfigurationError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not self.learning_rate > 0:
            raise ConfigurationError(f"learning_rate must be positive, got {self.learning_rate}")
        for name in ("margin", "weight_decay"):
            if not getattr(self, name) >= 0:
                raise ConfigurationError(f"{name} must not be negative, got {getattr(self, name)}")

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """Rebuild the settings from `dataclasses.asdict`, which JSON turned tuples of to lists."""
        network = dict(values["network"])
        network["widths"] = tuple(network["widths"])
        return cls(**{**values, "network": UNetSize(**network)})


class UNetRegression(Generator):
    """Supervised regression of plans on outcomes by a U-Net (paper, "UNet")."""

    name: ClassVar[str] = "regression"

    def __init__(
        self, config: UNetRegressionConfig | None = None, *, threads: int | None = None
    ) -> None:
        """Choose settings.

        Args:
            config: All settings; the defaults when None.
            threads: Cores to train on; all when None. The last digits depend on it. Plans are
                generated on one core, so that a model means the same ones on any number.
        """
        self.config = config or UNetRegressionConfig()
        self._threads = threads
        self._fitted: CodedNetwork[_Network] | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Learn from all demonstrations; the seed draws initial weights. See `Generator.fit`."""
        codec, codes = StartTimeCodec.fit(
            demonstrations,
            start_times=self.config.start_times,
            representation=self.config.representation,
            frames_per_point=self.config.frames_per_point,
            length_multiple=self.config.network.length_multiple,
            margin=self.config.margin,
        )
        scale = ConditionScale.fit(demonstrations.outcomes_seen)
        with torch_threads(self._threads):
            network = _train(
                as_tensor(codes, _CPU),
                as_tensor(scale.scale(demonstrations.outcomes_seen), _CPU),
                self.config,
                seed,
                progress,
            )
        self._fitted = CodedNetwork(codec, scale, network, _CPU)
        return self

    @property
    def codec(self) -> StartTimeCodec:
        """How plans are coded, decided by `fit`."""
        return self._require().codec

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """One forward pass for each condition; see `Generator.generate`."""
        fitted = self._require()
        return fitted.generate(conditions, fitted.network)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        fitted = self._require()
        write_model(
            folder,
            self.name,
            {"config": asdict(self.config), "codec": fitted.codec.settings()},
            fitted.tensors(),
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(UNetRegressionConfig.from_json(saved.settings["config"]))
            size = generator.config.network
            generator._fitted = CodedNetwork.restore(
                saved.settings["codec"],
                saved.tensors,
                lambda codec, k: _Network(codec.channels, codec.length, k, size),
                _CPU,
            )
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        return generator

    def _require(self) -> CodedNetwork[_Network]:
        if self._fitted is None:
            raise NotFittedError("this UNetRegression has learned nothing yet; call fit first")
        return self._fitted


class _Network(nn.Module):
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


def _train(
    codes: torch.Tensor,
    conditions: torch.Tensor,
    config: UNetRegressionConfig,
    seed: int,
    progress: Callable[[FitProgress], None] | None,
) -> _Network:
    # Torch's layers draw their initial weights from the global generator: lend it, and put it back.
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = _Network(codes.shape[1], codes.shape[2], conditions.shape[1], config.network)
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
