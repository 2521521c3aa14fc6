"""The part of codes that is an affine function of the outcome, apart from what a network learns.

    code(A_i) = B^T [1, r_i] + s e_i

The network learns the residuals e. Ours, as in universal kriging. By the normal equations
sum_i e_i = 0 and sum_i e_i r_i^T = 0; where landing is linear in the plan, near enough, the trend
alone then lands at its condition, and every residual moves the landing by nothing. So how a network
mixes demonstrations at a new condition, which six of them hardly decide, only matters to second
order.

Notation:
    r  scaled outcomes       (N, k)     [-]
    B  coefficients          (k+1, C, T)  [-]
    s  largest residual of each channel (C, 1)  [-]; a network sees numbers of order one
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.plans.codec import Codes

_RCOND = 1e-6
"""Directions in which outcomes vary by less than this part of their variation have no slope."""
_NO_RESIDUAL = 1e-9
"""A channel whose residuals are below this, of a range of two, is told by its trend alone."""


@dataclass(frozen=True, eq=False)
class AffineTrend:
    """The affine part of codes, and the scale of what it leaves."""

    coefficients: Float[np.ndarray, "_ C T"]
    """B."""
    scale: Float[np.ndarray, "C 1"]
    """s."""

    @classmethod
    def zero(cls, outcome_dim: int, channels: int, length: int) -> Self:
        """No trend: residuals are the codes."""
        return cls(np.zeros((outcome_dim + 1, channels, length)), np.ones((channels, 1)))

    @classmethod
    def fit(cls, outcomes: Float[np.ndarray, "N k"], codes: Codes) -> Self:
        """Fit by least squares; with N <= k the trend is the mean, as in `smooth_weights`.

        Args:
            outcomes: r.
            codes: Of the demonstrations, (N, C, T).
        """
        n, k = outcomes.shape
        terms = _terms(outcomes)
        if n <= k:
            terms[:, 1:] = 0.0
        solved = np.linalg.lstsq(terms, codes.reshape(n, -1), rcond=_RCOND)[0]
        coefficients = solved.reshape(k + 1, *codes.shape[1:])
        left = np.abs(codes - np.tensordot(terms, coefficients, axes=1)).max(axis=(0, 2))
        scale = np.where(left > _NO_RESIDUAL, left, 1.0)[:, None]
        return cls(coefficients, scale)

    def remove(self, outcomes: Float[np.ndarray, "n k"], codes: Codes) -> Codes:
        """The residuals e of codes, in [-1, 1] for those of the fit."""
        residuals: Codes = (codes - self._at(outcomes)) / self.scale
        return residuals

    def restore(self, outcomes: Float[np.ndarray, "n k"], residuals: Codes) -> Codes:
        """The codes of residuals."""
        codes: Codes = self._at(outcomes) + self.scale * residuals
        return codes

    def _at(self, outcomes: Float[np.ndarray, "n k"]) -> Codes:
        return np.tensordot(_terms(outcomes), self.coefficients, axes=1)


def _terms(outcomes: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n _"]:
    """Each outcome with a 1 before it."""
    return np.concatenate([np.ones((len(outcomes), 1)), outcomes], axis=1)
