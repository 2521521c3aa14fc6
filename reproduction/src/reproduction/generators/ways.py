"""Diffusion that keeps ways apart: it learns mixtures of demonstrations that move alike (ours).

A network that has seen one demonstration at each outcome tells ways apart by the outcome, and mixes
them in between. With mixtures within each way it sees both ways over the whole region: which one is
generated is then decided by the noise. Chosen on `zoo-sidearm`
(reproduction/docs/decisions-generator.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from prior_reinforce.generators.network.config import DiffusionConfig, PerceptronSize
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.network.network import FittedNetwork
from prior_reinforce.settings import Count, Positive

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn


_SMALLER = PerceptronSize(members=2, width=128)


@dataclass(frozen=True)
class DiffusionWaysConfig(DiffusionConfig):
    """As of `DiffusionGenerator`; plans are always sampled by `mixtures.ddim`."""

    mixtures: Count = 4
    """m: samples are mixtures of a demonstration and the m - 1 that move most like it."""
    training_steps: Annotated[int, msgspec.Meta(ge=0)] = 3000
    """Optimiser steps. 0 is the control: a network that has learned nothing."""
    learning_rate: Positive = 3e-3
    """Peak of the cosine schedule."""
    perceptron: PerceptronSize = _SMALLER
    """Size of the perceptron."""


class DiffusionWays(DiffusionGenerator):
    """Conditional diffusion for demonstrations of several ways."""

    name: ClassVar[str] = "diffusion-ways"
    config_type: ClassVar[type[DiffusionWaysConfig]] = DiffusionWaysConfig
    config: DiffusionWaysConfig

    def _loss(
        self, network: nn.Module, codes: Tensor, conditions: Tensor, rng: torch.Generator
    ) -> Callable[[], Tensor]:
        from prior_reinforce.generators.network.denoiser import loss
        from reproduction.generators.mixtures import mixed, nearest

        alike = nearest(codes, self.config.mixtures)

        def draw(rows: Tensor) -> tuple[Tensor, Tensor]:
            return mixed(codes, conditions, alike[rows], rng)

        return loss(network, codes, conditions, self.config, rng, draw)

    def _codes(self, learned: FittedNetwork, conditions: Tensor) -> Tensor:
        from prior_reinforce.generators.network.denoiser import sample
        from reproduction.generators.mixtures import ddim

        shape, seed = (learned.span or learned.codec).shape, learned.seed
        return sample(learned.network, conditions, shape, self.config, seed=seed, sampler=ddim)
