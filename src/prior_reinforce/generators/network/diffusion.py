"""Diffusion models of plans, conditioned on the outcome (paper, Stage 1).

A network denoises plans (`denoiser`), given the desired outcome. A generated plan is a function of
the condition, as the adapter needs it. There are two forms:

- `diffusion`: a small network denoises coordinates in the demonstrations' span (`span`), and learns
  timing separately from shape (`Timed`). Ours: it learns six demonstrations in half a minute.
- `diffusion-paper`: a U-Net denoises whole plans, frame by frame, as in the paper.

Either is a network alone: with `training_steps=0`, the control, it hits nothing.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

from prior_reinforce.generators.network.config import DiffusionConfig, Sampler
from prior_reinforce.generators.network.network import FittedNetwork, NetworkGenerator

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn

_BETAS = (0.95, 0.999)
"""Diffusion Policy's optimiser (real-stanford/diffusion_policy, commit 5ba07ac)."""


class DiffusionGenerator(NetworkGenerator):
    """Conditional diffusion over whole plans (paper, Stage 1)."""

    name: ClassVar[str] = "diffusion"
    config_type: ClassVar[type[DiffusionConfig]] = DiffusionConfig
    config: DiffusionConfig

    def sampled(
        self,
        *,
        sampler: Sampler | None = None,
        shared_noise: bool | None = None,
        seed: int | None = None,
    ) -> DiffusionGenerator:
        """Return a generator with the same network and another sampling; it needs no training.

        Args:
            sampler: Replaces the one of the settings.
            shared_noise: Replaces that of the settings.
            seed: Of the noise, instead of the fit's. With a new one for every trial and
                `shared_noise=False`, plans are sampled anew each time, as in the paper without an
                adapter.

        Raises:
            NotFittedError: It is not fitted.
        """
        self._fitted_to()
        other = copy.copy(self)
        assert self._learned is not None
        other.config = replace(
            self.config,
            sampler=self.config.sampler if sampler is None else sampler,
            shared_noise=self.config.shared_noise if shared_noise is None else shared_noise,
        )
        if seed is not None:
            other._learned = replace(self._learned, seed=seed)
        return other

    @property
    def _in_span(self) -> bool:
        return self.config.coordinates == "span"

    def _build(self, channels: int, length: int, outcome_dim: int) -> nn.Module:
        from prior_reinforce.generators.network.perceptron import ConditionalPerceptron
        from prior_reinforce.generators.network.unet import ConditionalUNet

        if self._in_span:
            return ConditionalPerceptron(channels, outcome_dim, self.config.perceptron)
        return ConditionalUNet(channels, outcome_dim, self.config.network)

    def _loss(
        self, network: nn.Module, codes: Tensor, conditions: Tensor, rng: torch.Generator
    ) -> Callable[[], Tensor]:
        from prior_reinforce.generators.network.denoiser import loss

        return loss(network, codes, conditions, self.config, rng)

    def _optimiser(self, rng: torch.Generator) -> Mapping[str, Any]:
        return {"betas": _BETAS, "decay": self.config.decay, "rng": rng}

    def _codes(self, learned: FittedNetwork, conditions: Tensor) -> Tensor:
        from prior_reinforce.generators.network.denoiser import sample

        shape = (learned.span or learned.codec).shape
        return sample(learned.network, conditions, shape, self.config, seed=learned.seed)
