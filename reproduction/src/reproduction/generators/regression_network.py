"""The network of U-Net regression; apart, as it needs torch when it is imported."""

from __future__ import annotations

from jaxtyping import Float

from prior_reinforce.generators.network.config import UNetSize
from prior_reinforce.generators.network.threads import nn, torch
from prior_reinforce.generators.network.unet import ConditionalUNet


class RegressionNetwork(nn.Module):
    """A `ConditionalUNet` fed with a learned constant instead of a noisy code."""

    def __init__(self, channels: int, length: int, condition_dim: int, size: UNetSize) -> None:
        super().__init__()
        self.unet = ConditionalUNet(channels, condition_dim, size)
        self.input = nn.Parameter(torch.randn(1, channels, length))

    def forward(self, conditions: Float[torch.Tensor, "B k"]) -> Float[torch.Tensor, "B C T"]:
        """Predict codes for scaled conditions."""
        n = len(conditions)
        steps = torch.zeros(n, device=conditions.device)
        codes: torch.Tensor = self.unet(self.input.expand(n, -1, -1), steps, conditions)
        return codes
