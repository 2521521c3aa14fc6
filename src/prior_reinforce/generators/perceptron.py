"""The denoising network of a few coordinates: residual layers, steered by the noise level (FiLM).

No layer normalises: normalisation bends what is almost linear in the condition, which doubled the
error between demonstrations (docs/decisions-generator.md).
"""

from __future__ import annotations

from jaxtyping import Float, Shaped

from prior_reinforce.generators.config import PerceptronSize
from prior_reinforce.generators.threads import nn, torch
from prior_reinforce.generators.unet import StepEmbedding


class ConditionalPerceptron(nn.Module):
    """Predicts from noisy coordinates, their noise level and a condition."""

    def __init__(self, coordinates: int, condition_dim: int, size: PerceptronSize) -> None:
        """Build the network.

        Args:
            coordinates: L; as many come out.
            condition_dim: k.
            size: Width and so on.
        """
        super().__init__()
        self.step_embedding = StepEmbedding(size.step_width, nn.SiLU)
        self.first = nn.Linear(coordinates + condition_dim, size.width)
        self.layers = nn.ModuleList(
            nn.Sequential(
                nn.Linear(size.width, size.width), nn.SiLU(), nn.Linear(size.width, size.width)
            )
            for _ in range(size.depth)
        )
        self.film = nn.ModuleList(
            nn.Linear(size.step_width, 2 * size.width) for _ in range(size.depth)
        )
        self.last = nn.Linear(size.width, coordinates)

    def forward(
        self,
        noisy: Float[torch.Tensor, "B L 1"],
        steps: Shaped[torch.Tensor, " B"],
        conditions: Float[torch.Tensor, "B k"],
    ) -> Float[torch.Tensor, "B L 1"]:
        """Predict for each sample of a batch; see `ConditionalUNet.forward`."""
        step = self.step_embedding(steps)
        x = self.first(torch.cat([noisy[:, :, 0], conditions], dim=1))
        for layer, film in zip(self.layers, self.film, strict=True):
            scale, shift = film(step).chunk(2, dim=1)
            x = x + layer(x * (1 + scale) + shift)
        prediction: torch.Tensor = self.last(x)[:, :, None]
        return prediction
