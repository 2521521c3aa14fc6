"""The constant x RBF kernel of greatest marginal likelihood.

The kernel is a exp(-d^2 / (2 l^2)), with alpha_i added to the diagonal: scikit-learn's
`ConstantKernel(a) * RBF(l)` and `alpha`. Several outputs share one kernel, and their log
likelihoods are summed, as in scikit-learn.

The global maximum needs no restarts. With A = diag(alpha) and the eigendecomposition
A^(-1/2) R(l) A^(-1/2) = U diag(s) U' of one length scale's correlation matrix, the likelihood of
every amplitude is a sum over n eigenvalues,

    log p(l, a) = -1/2 sum_i [ q_i / (a s_i + 1) + k log(a s_i + 1) + k log(2 pi alpha_i) ],

where q_i is the squared length of row i of U' A^(-1/2) Y. A scan over length scales, decomposed in
one batch, with the best amplitude of each, finds every basin; zooming into the best of them gives
the maximum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from prior_reinforce.arrays import Points

_SCAN_POINTS = 64
"""Length scales of the scan, evenly spaced in log l: a step is about 0.25 for typical data."""
_AMPLITUDE_POINTS = 32
"""Amplitudes tried for each length scale, before Newton's method finds the best."""
_NEWTON_STEPS = 5
"""From within 0.4 of the maximum in log a, four steps reach 1e-10."""
_BASINS = 3
"""Most local maxima of the scan that are refined."""
_BASIN_MARGIN = 1.0
"""Log likelihood by which a refined peak of the scan may lie below the highest: within half a step
of a peak the likelihood of a dozen points falls by less than 0.5."""
_ZOOM_POINTS = 17
_ZOOM_ROUNDS = 4
"""Each round divides the bracket by (points - 1) / 2 = 8: 4 rounds end at 1e-4 of a scan step."""


Targets = Float[np.ndarray, "n outputs"]
"""Y, of zero prior mean."""
Jitter = Float[np.ndarray, " n"]
"""alpha of each point, positive."""


@dataclass(frozen=True)
class Kernel:
    """a exp(-d^2 / (2 l^2)); a Gaussian process with it and prior mean 0."""

    amplitude: float
    """a, the variance of the prior; scikit-learn's `ConstantKernel` value."""
    length_scale: float
    """l, in the unit of the inputs."""

    def __call__(self, a: Float[np.ndarray, "p k"], b: Points) -> Float[np.ndarray, "p n"]:
        """Return the prior covariance of two sets of points.

        Far apart, compared with the length scale, it is 0: there a prediction returns to the mean.
        """
        return self.amplitude * _correlation(cdist(a, b, "sqeuclidean"), self.length_scale)

    def weights(self, inputs: Points, targets: Targets, jitter: Jitter) -> Targets:
        """Return (K + diag(alpha))^-1 Y; `kernel(x, inputs) @ weights` is the posterior mean."""
        covariance = self(inputs, inputs)
        covariance[np.diag_indices_from(covariance)] += jitter
        return np.asarray(cho_solve(cho_factor(covariance, lower=True), targets))


def maximise(
    inputs: Points,
    targets: Targets,
    *,
    jitter: Jitter,
    amplitude_bounds: tuple[float, float],
    length_scale_bounds: tuple[float, float],
) -> tuple[Kernel, float]:
    """Return the kernel of greatest marginal likelihood within the bounds, and its log likelihood.

    Deterministic.

    Args:
        inputs: X.
        targets: Y; its columns share the kernel.
        jitter: Added to the diagonal.
        amplitude_bounds: Least and greatest a.
        length_scale_bounds: Least and greatest l, in the inputs' unit.
    """
    squared = cdist(inputs, inputs, "sqeuclidean")
    log_amplitude_bounds = float(np.log(amplitude_bounds[0])), float(np.log(amplitude_bounds[1]))

    def profile(
        log_lengths: Float[np.ndarray, "*s"],
    ) -> tuple[Float[np.ndarray, "*s"], Float[np.ndarray, "*s"]]:
        """Best log likelihood and its log amplitude."""
        spectra = _Spectra(squared, targets, jitter, np.exp(log_lengths.ravel()))
        values, log_amplitudes = spectra.best_amplitude(log_amplitude_bounds)
        return values.reshape(log_lengths.shape), log_amplitudes.reshape(log_lengths.shape)

    low, high = _distinct_log_lengths(squared, length_scale_bounds)
    scan = np.linspace(low, high, _SCAN_POINTS)
    values, log_amplitudes = profile(scan)
    basins = _basins(values)
    value, log_length, log_amplitude = values[basins], scan[basins], log_amplitudes[basins]
    half_width = (high - low) / (_SCAN_POINTS - 1)
    rows = np.arange(len(basins))
    for _ in range(_ZOOM_ROUNDS):
        bracket = half_width * np.linspace(-1.0, 1.0, _ZOOM_POINTS)
        candidates = np.clip(log_length[:, None] + bracket, low, high)
        values, log_amplitudes = profile(candidates)
        best = rows, np.argmax(values, axis=1)
        value, log_length, log_amplitude = values[best], candidates[best], log_amplitudes[best]
        half_width *= 2.0 / (_ZOOM_POINTS - 1)
    winner = int(np.argmax(value))
    kernel = Kernel(
        amplitude=float(np.clip(np.exp(log_amplitude[winner]), *amplitude_bounds)),
        length_scale=float(np.clip(np.exp(log_length[winner]), *length_scale_bounds)),
    )
    return kernel, float(value[winner])


class _Spectra:
    """Eigendecompositions of the correlation matrices of several length scales."""

    def __init__(
        self,
        squared_distances: Float[np.ndarray, "n n"],
        targets: Targets,
        jitter: Jitter,
        length_scales: Float[np.ndarray, " m"],
    ) -> None:
        whitening = 1.0 / np.sqrt(jitter)
        correlations = _correlation(squared_distances, length_scales[:, None, None])
        s, U = np.linalg.eigh(whitening[:, None] * correlations * whitening)
        self._s = np.maximum(s, 0.0)[:, None, :]  # (m, 1, n); rounding may go below 0
        projected = np.swapaxes(U, 1, 2) @ (whitening[:, None] * targets)
        self._q = np.sum(np.square(projected), axis=2)[:, None, :]  # (m, 1, n)
        self._outputs = targets.shape[1]
        self._constant = self._outputs * float(np.sum(np.log(2.0 * np.pi * jitter)))

    def log_likelihood(self, log_amplitudes: Float[np.ndarray, "_ p"]) -> Float[np.ndarray, "m p"]:
        """Return log p for log amplitudes of each length scale, or one row for all."""
        variances = np.exp(log_amplitudes)[:, :, None] * self._s + 1.0
        terms = self._q / variances + self._outputs * np.log(variances)
        return -0.5 * (np.sum(terms, axis=2) + self._constant)

    def best_amplitude(
        self, bounds: tuple[float, float]
    ) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Return the greatest log p over the log amplitude within bounds, and where."""
        grid = np.linspace(*bounds, _AMPLITUDE_POINTS)[None, :]
        start = grid[0, np.argmax(self.log_likelihood(grid), axis=1)][:, None]
        step = (bounds[1] - bounds[0]) / (_AMPLITUDE_POINTS - 1)
        low, high = np.maximum(start - step, bounds[0]), np.minimum(start + step, bounds[1])
        s, q, outputs = self._s[:, 0], self._q[:, 0], self._outputs
        log_a = start
        for _ in range(_NEWTON_STEPS):
            u = np.exp(log_a) * s
            d = u + 1.0
            slope = np.sum(u * (q - outputs * d) / d**2, axis=1, keepdims=True)
            curvature = np.sum(u * (q * (1.0 - u) - outputs * d) / d**3, axis=1, keepdims=True)
            newton = -slope / np.minimum(curvature, -1e-300)
            move = np.where(curvature < 0.0, newton, step * np.sign(slope))
            log_a = np.clip(log_a + np.clip(move, -step, step), low, high)
        candidates = np.concatenate([start, log_a], axis=1)
        values = self.log_likelihood(candidates)
        best = np.arange(len(values)), np.argmax(values, axis=1)
        return values[best], candidates[best]


def _correlation(
    squared_distances: Float[np.ndarray, "*s"], length_scale: Float[np.ndarray, "*l"] | float
) -> Float[np.ndarray, "..."]:
    """Return exp(-d^2 / (2 l^2)), broadcasting distances against length scales."""
    return np.asarray(np.exp(-0.5 * squared_distances / np.square(length_scale)))


def _distinct_log_lengths(
    squared_distances: Float[np.ndarray, "n n"], bounds: tuple[float, float]
) -> tuple[float, float]:
    """Return the bounds in log l, without short length scales that all give the same matrix.

    At an eighth of the least distance the correlation matrix is the identity to 1e-14.
    """
    distances = np.sqrt(squared_distances[np.triu_indices(len(squared_distances), 1)])
    shortest = float(np.clip(np.min(distances, initial=np.inf) / 8.0, *bounds))
    return float(np.log(shortest)), float(np.log(bounds[1]))


def _basins(values: Float[np.ndarray, " m"]) -> Int[np.ndarray, " b"]:
    """Return the indices of a scan's highest local maxima, its ends included."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    peaks = peaks[values[peaks] >= values.max() - _BASIN_MARGIN]
    # A plateau is many equal peaks; a stable sort keeps the choice among them deterministic.
    return peaks[np.argsort(-values[peaks], kind="stable")[:_BASINS]]
