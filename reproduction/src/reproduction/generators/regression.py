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

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from prior_reinforce.generators.network.config import UNetConfig
from prior_reinforce.generators.network.network import FittedNetwork, NetworkGenerator
from prior_reinforce.settings import NonNegative, Positive

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn

    from reproduction.generators.regression_network import RegressionNetwork


@dataclass(frozen=True)
class UNetRegressionConfig(UNetConfig):
    """Everything that decides what `UNetRegression` learns (reproduction/docs/baselines.md).

    Network and representation default to the diffusion generator's, so that the two differ in
    nothing but diffusion.
    """

    training_steps: Annotated[int, msgspec.Meta(ge=0)] = 800
    """Optimiser steps, each on all demonstrations."""
    learning_rate: Positive = 3e-3
    """Peak of the cosine schedule, which ends at 0."""
    weight_decay: NonNegative = 2.0
    """Of AdamW. Large, because a network that meets six demonstrations to a milliradian ripples
    between them: with next to none the error at new goals was three times as large."""


class UNetRegression(NetworkGenerator):
    """Supervised regression of plans on outcomes by a U-Net (paper, "UNet")."""

    name: ClassVar[str] = "regression"
    config_type: ClassVar[type[UNetRegressionConfig]] = UNetRegressionConfig
    config: UNetRegressionConfig

    def _build(self, channels: int, length: int, outcome_dim: int) -> RegressionNetwork:
        from reproduction.generators.regression_network import RegressionNetwork

        return RegressionNetwork(channels, length, outcome_dim, self.config.network)

    def _loss(
        self, network: nn.Module, codes: Tensor, conditions: Tensor, rng: torch.Generator
    ) -> Callable[[], Tensor]:
        """Of all demonstrations at every step: nothing is drawn but the initial weights."""
        from torch.nn.functional import mse_loss

        return lambda: mse_loss(network(conditions), codes)

    def _codes(self, learned: FittedNetwork, conditions: Tensor) -> Tensor:
        codes: Tensor = learned.network(conditions)
        return codes
