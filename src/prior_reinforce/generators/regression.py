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
from typing import TYPE_CHECKING, ClassVar

from prior_reinforce.generators.config import UNetRegressionConfig
from prior_reinforce.generators.network import Learned, NetworkGenerator

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn

    from prior_reinforce.generators.unet import RegressionNetwork


class UNetRegression(NetworkGenerator):
    """Supervised regression of plans on outcomes by a U-Net (paper, "UNet")."""

    name: ClassVar[str] = "regression"
    config_type: ClassVar[type[UNetRegressionConfig]] = UNetRegressionConfig
    config: UNetRegressionConfig

    def _build(self, channels: int, length: int, outcome_dim: int) -> RegressionNetwork:
        from prior_reinforce.generators.unet import RegressionNetwork

        return RegressionNetwork(channels, length, outcome_dim, self.config.network)

    def _loss(
        self, network: nn.Module, codes: Tensor, conditions: Tensor, rng: torch.Generator
    ) -> Callable[[], Tensor]:
        """Of all demonstrations at every step: nothing is drawn but the initial weights."""
        from torch.nn.functional import mse_loss

        return lambda: mse_loss(network(conditions), codes)

    def _codes(self, learned: Learned, conditions: Tensor) -> Tensor:
        codes: Tensor = learned.network(conditions)
        return codes
