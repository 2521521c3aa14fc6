"""The denoising network: a one-dimensional U-Net over time, modulated by step and condition.

Layout after Chi et al. 2023, "Diffusion Policy", as published in real-stanford/diffusion_policy
(commit 5ba07ac, `conditional_unet1d.py`; its layout only, written anew). The two-layer MLP on the
condition is the paper's addition ("encoded using a two-layer MLP and injected into each U-Net
block"): there the observation is concatenated to the step embedding as it is.
"""

from __future__ import annotations

import math

from jaxtyping import Float, Shaped

from prior_reinforce.generators.network.config import UNetSize
from prior_reinforce.generators.network.threads import nn, torch


class ConditionalUNet(nn.Module):
    """Predicts from a noisy code, its noise level and a condition; any length, see `UNetSize`."""

    def __init__(self, channels: int, condition_dim: int, size: UNetSize) -> None:
        """Build it for codes of C channels, and conditions of k components."""
        super().__init__()
        self.step_embedding = StepEmbedding(size.step_width, type(_activation(size)))
        self.condition_embedding = nn.Sequential(
            nn.Linear(condition_dim, size.condition_width),
            _activation(size),
            nn.Linear(size.condition_width, size.condition_width),
        )
        context = size.step_width + size.condition_width
        w = size.widths

        self.down = nn.ModuleList(
            _Pair(n_in, n_out, context, size)
            for n_in, n_out in zip((channels, *w[:-1]), w, strict=True)
        )
        self.shrink = nn.ModuleList(nn.Conv1d(n, n, 3, stride=2, padding=1) for n in w[:-1])
        self.middle = _Pair(w[-1], w[-1], context, size)
        # The top level's skip is not used, as in the reference: its output goes straight to `head`.
        self.up = nn.ModuleList(
            _Pair(2 * n_in, n_out, context, size)
            for n_in, n_out in zip(w[:0:-1], w[-2::-1], strict=True)
        )
        self.grow = nn.ModuleList(
            nn.ConvTranspose1d(n, n, 4, stride=2, padding=1) for n in w[-2::-1]
        )
        self.head = nn.Sequential(
            _convolution(w[0], w[0], size), nn.Conv1d(w[0], channels, kernel_size=1)
        )

    def forward(
        self,
        noisy: Float[torch.Tensor, "B C T"],
        steps: Shaped[torch.Tensor, " B"],
        conditions: Float[torch.Tensor, "B k"],
    ) -> Float[torch.Tensor, "B C T"]:
        """Predict for each x_t of a batch, its t and its scaled condition."""
        context = torch.cat(
            [self.step_embedding(steps), self.condition_embedding(conditions)], dim=-1
        )
        x = noisy
        skips = []
        for level, pair in enumerate(self.down):
            x = pair(x, context)
            skips.append(x)
            if level < len(self.shrink):
                x = self.shrink[level](x)
        x = self.middle(x, context)
        for pair, grow in zip(self.up, self.grow, strict=True):
            x = grow(pair(torch.cat([x, skips.pop()], dim=1), context))
        prediction: torch.Tensor = self.head(x)
        return prediction


class StepEmbedding(nn.Module):
    """Sines and cosines of the noise level, then a two-layer MLP."""

    def __init__(self, width: int, activation: type[nn.Module]) -> None:
        super().__init__()
        # Frequencies fall geometrically from 1 to 1/10000 (Vaswani et al. 2017, section 3.5).
        exponents = torch.arange(width // 2) / (width // 2 - 1)
        self.register_buffer("frequencies", torch.exp(-math.log(1e4) * exponents), persistent=False)
        self.frequencies: torch.Tensor
        self.mlp = nn.Sequential(
            nn.Linear(width, 4 * width), activation(), nn.Linear(4 * width, width)
        )

    def forward(self, steps: torch.Tensor) -> torch.Tensor:
        """Embed noise levels, shape (B,), as (B, width)."""
        angles = steps[:, None] * self.frequencies
        embedded: torch.Tensor = self.mlp(torch.cat([angles.sin(), angles.cos()], dim=-1))
        return embedded


class _Pair(nn.Module):
    """The two residual blocks of a level."""

    def __init__(self, n_in: int, n_out: int, context: int, size: UNetSize) -> None:
        super().__init__()
        self.first = _ResidualBlock(n_in, n_out, context, size)
        self.second = _ResidualBlock(n_out, n_out, context, size)

    def forward(self, x: torch.Tensor, context: torch.Tensor) -> torch.Tensor:
        output: torch.Tensor = self.second(self.first(x, context), context)
        return output


class _ResidualBlock(nn.Module):
    """Two convolutions; between them the context scales and shifts each channel (FiLM)."""

    def __init__(self, n_in: int, n_out: int, context: int, size: UNetSize) -> None:
        super().__init__()
        self.first = _convolution(n_in, n_out, size)
        self.film = nn.Sequential(_activation(size), nn.Linear(context, 2 * n_out))
        self.second = _convolution(n_out, n_out, size)
        self.residual = nn.Conv1d(n_in, n_out, 1) if n_in != n_out else nn.Identity()

    def forward(self, x: torch.Tensor, context: torch.Tensor) -> torch.Tensor:
        scale, shift = self.film(context)[:, :, None].chunk(2, dim=1)
        y = torch.addcmul(shift, self.first(x), scale)
        output: torch.Tensor = self.second(y) + self.residual(x)
        return output


def _convolution(n_in: int, n_out: int, size: UNetSize) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(n_in, n_out, size.kernel, padding=size.kernel // 2),
        nn.GroupNorm(size.groups, n_out),
        _activation(size),
    )


def _activation(size: UNetSize) -> nn.Module:
    return nn.SiLU() if size.activation == "silu" else nn.Mish()
