"""How well a constant x RBF kernel explains some points, and the kernel that does so best.

The kernel is a exp(-d^2 / (2 l^2)), with alpha_i added to the diagonal: scikit-learn's
`ConstantKernel(a) * RBF(l)` and `alpha`, whose meaning of these words is kept throughout. Several
outputs share one kernel, and their log likelihoods are summed, as there.

The global maximum needs no restarts. With A = diag(alpha) and the eigendecomposition
A^(-1/2) R(l) A^(-1/2) = U diag(s) U' of one length scale's correlation matrix, the likelihood of
every amplitude is a sum over n eigenvalues,

    log p(l, a) = -1/2 sum_i [ q_i / (a s_i + 1) + k log(a s_i + 1) + k log(2 pi alpha_i) ],

where q_i is the squared length of row i of U' A^(-1/2) Y. So a scan over length scales, all
decomposed in one batch, with the amplitude solved for each, sees every basin, and zooming into the
best of them gives the maximum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

_SCAN_POINTS = 64
"""Length scales of the scan, evenly spaced in log l: a step is about 0.25 for data that occur."""
_AMPLITUDE_POINTS = 32
"""Amplitudes tried for each length scale, before Newton's method finds the best."""
_NEWTON_STEPS = 5
"""From within 0.4 of the maximum in log a, four steps reach 1e-10."""
_BASINS = 3
"""Local maxima of the scan that are zoomed into, at most."""
_BASIN_MARGIN = 1.0
"""Log likelihood by which a peak of the scan may lie below the highest and still be tried: within
half a step of a peak the likelihood of a dozen points falls by less than 0.5."""
_ZOOM_POINTS = 17
_ZOOM_ROUNDS = 4
"""Each round divides the bracket by (points - 1) / 2 = 8: 4 rounds end at 1e-4 of a scan step."""


@dataclass(frozen=True)
class KernelFit:
    """A kernel, and how well it explains the points it was fitted to."""

    amplitude: float
    """a, the variance of the prior; scikit-learn's `ConstantKernel` value."""
    length_scale: float
    """l, in the unit of the inputs."""
    log_likelihood: float
    """log p(Y | X, a, l), summed over outputs."""


def rbf_correlation(squared_distances: np.ndarray, length_scale: np.ndarray | float) -> np.ndarray:
    """Return exp(-d^2 / (2 l^2)), broadcasting distances against length scales."""
    return np.asarray(np.exp(-0.5 * squared_distances / np.square(length_scale)))


def log_marginal_likelihood(
    inputs: np.ndarray,
    targets: np.ndarray,
    *,
    amplitude: float,
    length_scale: float,
    jitter: np.ndarray,
) -> float:
    """Return log p(Y | X) under one kernel, summed over outputs.

    Args:
        inputs: X, shape (n, k).
        targets: Y, shape (n, outputs), of zero prior mean.
        amplitude: a, the constant before the RBF.
        length_scale: l, in the inputs' unit.
        jitter: alpha, added to the diagonal, shape (n,), positive.
    """
    squared = cdist(inputs, inputs, "sqeuclidean")
    spectra = _Spectra(squared, targets, jitter, np.array([length_scale]))
    return float(spectra.log_likelihood(np.log([[amplitude]]))[0, 0])


def maximise(
    inputs: np.ndarray,
    targets: np.ndarray,
    *,
    jitter: np.ndarray,
    amplitude_bounds: tuple[float, float],
    length_scale_bounds: tuple[float, float],
) -> KernelFit:
    """Return the kernel of greatest marginal likelihood within the bounds. Deterministic.

    Args:
        inputs: X, shape (n, k).
        targets: Y, shape (n, outputs), of zero prior mean.
        jitter: alpha, added to the diagonal, shape (n,), positive.
        amplitude_bounds: Least and greatest a.
        length_scale_bounds: Least and greatest l, in the inputs' unit.
    """
    squared = cdist(inputs, inputs, "sqeuclidean")
    log_amplitude_bounds = float(np.log(amplitude_bounds[0])), float(np.log(amplitude_bounds[1]))

    def profile(log_lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Best log likelihood and its log amplitude, each of the shape of `log_lengths`."""
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
    return KernelFit(
        amplitude=float(np.clip(np.exp(log_amplitude[winner]), *amplitude_bounds)),
        length_scale=float(np.clip(np.exp(log_length[winner]), *length_scale_bounds)),
        log_likelihood=float(value[winner]),
    )


class _Spectra:
    """Correlation matrices of several length scales, decomposed so that amplitudes are cheap."""

    def __init__(
        self,
        squared_distances: np.ndarray,
        targets: np.ndarray,
        jitter: np.ndarray,
        length_scales: np.ndarray,
    ) -> None:
        """Decompose.

        Args:
            squared_distances: Shape (n, n).
            targets: Y, shape (n, outputs).
            jitter: alpha, shape (n,), positive.
            length_scales: Shape (m,).
        """
        whitening = 1.0 / np.sqrt(jitter)
        correlations = rbf_correlation(squared_distances, length_scales[:, None, None])
        s, U = np.linalg.eigh(whitening[:, None] * correlations * whitening)
        self._s = np.maximum(s, 0.0)[:, None, :]  # (m, 1, n); rounding may go below 0
        projected = np.swapaxes(U, 1, 2) @ (whitening[:, None] * targets)
        self._q = np.sum(np.square(projected), axis=2)[:, None, :]  # (m, 1, n)
        self._outputs = targets.shape[1]
        self._constant = self._outputs * float(np.sum(np.log(2.0 * np.pi * jitter)))

    def log_likelihood(self, log_amplitudes: np.ndarray) -> np.ndarray:
        """Return log p, shape (m, p), for log amplitudes of shape (m or 1, p)."""
        variances = np.exp(log_amplitudes)[:, :, None] * self._s + 1.0
        terms = self._q / variances + self._outputs * np.log(variances)
        return -0.5 * (np.sum(terms, axis=2) + self._constant)

    def best_amplitude(self, bounds: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the greatest log p over the log amplitude within bounds, and where: (m,) each."""
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
            bend = np.sum(u * (q * (1.0 - u) - outputs * d) / d**3, axis=1, keepdims=True)
            move = np.where(bend < 0.0, -slope / np.minimum(bend, -1e-300), step * np.sign(slope))
            log_a = np.clip(log_a + np.clip(move, -step, step), low, high)
        candidates = np.concatenate([start, log_a], axis=1)
        values = self.log_likelihood(candidates)
        best = np.arange(len(values)), np.argmax(values, axis=1)
        return values[best], candidates[best]


def _distinct_log_lengths(
    squared_distances: np.ndarray, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Return the bounds in log l, leaving out short ones that all give the same matrix.

    At an eighth of the least distance the correlation matrix is the identity to 1e-14.
    """
    distances = np.sqrt(squared_distances[np.triu_indices(len(squared_distances), 1)])
    shortest = float(np.clip(np.min(distances, initial=np.inf) / 8.0, *bounds))
    return float(np.log(shortest)), float(np.log(bounds[1]))


def _basins(values: np.ndarray) -> np.ndarray:
    """Return the indices of a scan's highest local maxima, its ends included."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    peaks = peaks[values[peaks] >= values.max() - _BASIN_MARGIN]
    # A plateau is many equal peaks; a stable sort keeps the choice among them deterministic.
    return peaks[np.argsort(-values[peaks], kind="stable")[:_BASINS]]
