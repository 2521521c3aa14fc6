"""The denoising network of a few coordinates: residual layers, modulated by noise level (FiLM).

An ensemble of them learns from different initial weights, and their predictions are averaged: a
network's prediction between six demonstrations is partly chance, which a mean of several reduces
[Lakshminarayanan2017]. No layer normalises: normalisation distorts an almost linear dependence on
the condition, which doubled the error between demonstrations
(reproduction/docs/decisions-generator.md).

Notation:
    E  members    B  batch    L  coordinates    k  outcome
"""

from __future__ import annotations

import math

from jaxtyping import Float, Shaped

from prior_reinforce.generators.network.config import PerceptronSize
from prior_reinforce.generators.network.threads import nn, torch
from prior_reinforce.generators.network.unet import StepEmbedding


class ConditionalPerceptron(nn.Module):
    """Predicts from noisy coordinates, their noise level and a condition."""

    def __init__(self, coordinates: int, condition_dim: int, size: PerceptronSize) -> None:
        """Build it for L coordinates, and conditions of k components."""
        super().__init__()
        width, members = size.width, size.members
        self.members = members
        self.step_embedding = StepEmbedding(size.step_width, nn.SiLU)
        self.first = _Linear(members, coordinates + condition_dim, width)
        self.layers = nn.ModuleList(
            nn.Sequential(_Linear(members, width, width), nn.SiLU(), _Linear(members, width, width))
            for _ in range(size.depth)
        )
        self.film = nn.ModuleList(
            _Linear(members, size.step_width, 2 * width) for _ in range(size.depth)
        )
        self.last = _Linear(members, width, coordinates)

    def forward(
        self,
        noisy: Float[torch.Tensor, "B L 1"],
        steps: Shaped[torch.Tensor, " B"],
        conditions: Float[torch.Tensor, "B k"],
    ) -> Float[torch.Tensor, "*E B L 1"]:
        """Predict for each sample of a batch: by each member in training, else their mean."""
        step = self.step_embedding(steps).expand(self.members, -1, -1)
        given = torch.cat([noisy[:, :, 0], conditions], dim=1)
        x = self.first(given.expand(self.members, -1, -1))
        for layer, film in zip(self.layers, self.film, strict=True):
            scale, shift = film(step).chunk(2, dim=-1)
            x = x + layer(x * (1 + scale) + shift)
        predictions: torch.Tensor = self.last(x)[..., None]
        return predictions if self.training else predictions.mean(dim=0)


class _Linear(nn.Module):
    """A `torch.nn.Linear` for each member, with the same initialisation."""

    def __init__(self, members: int, n_in: int, n_out: int) -> None:
        super().__init__()
        bound = 1 / math.sqrt(n_in)
        self.weight = nn.Parameter(torch.empty(members, n_in, n_out).uniform_(-bound, bound))
        self.bias = nn.Parameter(torch.empty(members, 1, n_out).uniform_(-bound, bound))

    def forward(self, x: Float[torch.Tensor, "E B n_in"]) -> Float[torch.Tensor, "E B n_out"]:
        return torch.baddbmm(self.bias, x, self.weight)
