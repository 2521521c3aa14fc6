"""Coordinates of plans in the affine space that the demonstrations span.

    code(A) = o + sum_l z_l d_l,    z_l in [-1, 1] at the demonstrations

with d the principal directions of the demonstrations' codes. N demonstrations have N - 1
coordinates, so a small network denoises them in seconds, and every generated plan is a mixture of
demonstrations: as smooth as they are, with weights that sum to one. Ours; a latent diffusion model
[Rombach2022] whose autoencoder is a principal component analysis, exact at the demonstrations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.generators.network.codec import Codes

_ROUNDING = 1e-9
"""Directions whose singular value is below this part of the largest are rounding."""

Coordinates = Float[np.ndarray, "n L 1"]
"""z, with a trailing axis in place of the codes' time axis."""


@dataclass(frozen=True, eq=False)
class Span:
    """The affine space of some codes."""

    origin: Float[np.ndarray, "C T"]
    """o, the mean of the codes."""
    directions: Float[np.ndarray, "L C T"]
    """d, orthogonal, each as long as its largest coordinate at a demonstration."""

    @classmethod
    def fit(cls, codes: Codes) -> Self:
        """Find the principal directions of codes, at least one."""
        origin = codes.mean(axis=0)
        left, size, directions = np.linalg.svd(
            (codes - origin).reshape(len(codes), -1), full_matrices=False
        )
        kept = size > _ROUNDING * max(size[0], 1.0)
        kept[0] = True
        largest = np.abs(left * size).max(axis=0)[kept]
        return cls(origin, (largest[:, None] * directions[kept]).reshape(-1, *origin.shape))

    @property
    def shape(self) -> tuple[int, int]:
        """(L, 1), of coordinates."""
        return len(self.directions), 1

    def encode(self, codes: Codes) -> Coordinates:
        """Return the coordinates of codes, projected onto the space."""
        flat = self.directions.reshape(len(self.directions), -1)
        centred = (codes - self.origin).reshape(len(codes), -1)
        length = np.sum(flat**2, axis=1)
        length[length == 0] = 1.0  # all demonstrations are equal
        return (centred @ flat.T / length)[:, :, None]

    def decode(self, coordinates: Coordinates) -> Codes:
        """Return the codes that have these coordinates."""
        codes: Codes = self.origin + np.tensordot(coordinates[:, :, 0], self.directions, axes=1)
        return codes
