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

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from prior_reinforce.generators.base import OnProgress
from prior_reinforce.generators.config import UNetRegressionConfig
from prior_reinforce.generators.network import Learned, NetworkGenerator

if TYPE_CHECKING:
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

    def _train(
        self,
        network: nn.Module,
        codes: Tensor,
        conditions: Tensor,
        seed: int,
        progress: OnProgress,
        state: Path | None,
    ) -> nn.Module:
        """Fit to all demonstrations at every step; the seed has drawn the initial weights."""
        from torch.nn.functional import mse_loss

        from prior_reinforce.generators.training import optimise

        return optimise(
            network,
            lambda: mse_loss(network(conditions), codes),
            self.config,
            progress,
            state=state,
        )

    def _codes(self, learned: Learned, conditions: Tensor) -> Tensor:
        codes: Tensor = learned.network(conditions)
        return codes
