"""Prediction of a Gaussian process with zero prior mean: linear algebra only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from prior_reinforce.adapters.marginal_likelihood import rbf_correlation


@dataclass(frozen=True, eq=False)
class GPPosterior:
    """Posterior mean a r(x)' (a R + diag(alpha))^-1 Y of a constant x RBF kernel.

    Far from all inputs, compared with the length scale, it returns to the prior mean, 0.
    """

    inputs: np.ndarray
    """X, shape (n, k)."""
    weights: np.ndarray
    """(a R + diag(alpha))^-1 Y, shape (n, outputs)."""
    amplitude: float
    """a, the constant before the RBF."""
    length_scale: float
    """l, in the inputs' unit."""

    @classmethod
    def condition_on(
        cls,
        inputs: np.ndarray,
        targets: np.ndarray,
        *,
        amplitude: float,
        length_scale: float,
        jitter: np.ndarray,
    ) -> GPPosterior:
        """Return the posterior given points.

        Args:
            inputs: X, shape (n, k).
            targets: Y, shape (n, outputs), of zero prior mean.
            amplitude: a, the constant before the RBF.
            length_scale: l, in the inputs' unit.
            jitter: alpha, added to the diagonal, shape (n,), positive.
        """
        squared = cdist(inputs, inputs, "sqeuclidean")
        covariance = amplitude * rbf_correlation(squared, length_scale)
        covariance[np.diag_indices_from(covariance)] += jitter
        weights = cho_solve(cho_factor(covariance, lower=True), targets)
        return cls(inputs, weights, amplitude, length_scale)

    def mean(self, points: np.ndarray) -> np.ndarray:
        """Return the posterior mean, shape (n, outputs), at points, shape (n, k)."""
        squared = cdist(points, self.inputs, "sqeuclidean")
        return self.amplitude * rbf_correlation(squared, self.length_scale) @ self.weights
