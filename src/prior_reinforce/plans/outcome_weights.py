"""Weights of the demonstrations for a desired outcome; they sum to one.

Shared by the interpolating generators and the Bayesian adapter, whose prior mixes the errors of
outcomes as plans are mixed. Distances are taken after dividing every outcome component by its
demonstrated range, so that components may differ in unit.

Notation (docs/notation.md):
    c  conditions                       in the outcomes' units
    r  outcomes of the demonstrations   in the outcomes' units
    w  weights, rows sum to one         [-]
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import SAME_OUTCOME

Kernel = Literal["auto", "cubic", "thin-plate", "linear"]
"""Kernel of `smooth_weights`: the radial function is d^3, d^2 log d, or d. `auto` is the first, or
the last if the first amplifies random differences between demonstrations (`amplification`)."""
_LARGEST_AMPLIFICATION = 1.0
"""Ours: a mixture then varies by chance no more than one demonstration does. Outcomes on a grid
stay below it, most that nobody spread do not; reproduction/docs/decisions-generator.md."""
_REPEATED = 1e-6
"""Least smoothing of repeated outcomes, so that their plans are averaged. Ours: far below any other
smoothing."""
_MEASURED = 0.01
"""Noise below this part of the demonstrated range counts as none: the outcome was measured. Ours:
3 mm of 30 cm, several times the error of a camera or a tape."""
_SMOOTHING = 100.0
"""Smoothing of an outcome whose noise equals the demonstrated range. Ours, see
reproduction/docs/decisions-generator.md."""


def smooth_weights(
    outcomes: Float[np.ndarray, "N k"],
    *,
    kernel: Kernel = "auto",
    noise: Float[np.ndarray, "N k"] | None = None,
) -> SmoothWeights:
    r"""Return the cardinal weights of a polyharmonic spline with an affine tail.

    The interpolant of values :math:`f_i` at :math:`r_i`,
    :math:`f(c) = \sum_i a_i \varphi(\|c - r_i\|) + b_0 + b^\top c` with
    :math:`\sum_i a_i = 0, \sum_i a_i r_i = 0`, is linear in the values; these are the
    :math:`w_i(c)` of :math:`f(c) = \sum_i w_i(c) f_i`. Weights may be negative: it extrapolates,
    and reproduces every affine dependence of plan on outcome exactly.

    Args:
        outcomes: r. With N <= k the tail is constant, and the kernel linear, because the others
            need an affine tail to be solvable.
        kernel: Which :math:`\varphi`.
        noise: Standard deviation of each outcome. Uncertain demonstrations are smoothed: their
            weight at their own outcome is below one. Those of the same outcome are averaged.

    Source: Wendland, "Scattered Data Approximation", 2005, chapter 8 (ours to use it here).
    """
    if kernel != "auto":
        return SmoothWeights(outcomes, kernel, noise)
    cubic = SmoothWeights(outcomes, "cubic", noise)
    if amplification(cubic, outcomes) <= _LARGEST_AMPLIFICATION:
        return cubic
    return SmoothWeights(outcomes, "linear", noise)


class SmoothWeights:
    """A fitted spline: conditions c to weights w."""

    def __init__(
        self,
        outcomes: Float[np.ndarray, "N k"],
        kernel: Kernel,
        noise: Float[np.ndarray, "N k"] | None,
    ) -> None:
        """Fit it; see `smooth_weights`."""
        from scipy.interpolate import RBFInterpolator

        n, k = outcomes.shape
        self.kernel: Kernel = kernel if n > k else "linear"
        self._scale, self._n = np.ptp(outcomes, axis=0), n
        smoothing = np.zeros(n)
        if noise is not None:
            relative = np.where(noise > _MEASURED * self._scale, noise / self._scale, 0.0)
            smoothing = _SMOOTHING * np.mean(relative**2, axis=1)
        distances = np.abs(outcomes[:, None] - outcomes[None])
        same = np.all(distances <= SAME_OUTCOME * self._scale, axis=2)
        repeated = same.sum(axis=1) > 1
        self._spline = RBFInterpolator(
            outcomes[same.argmax(axis=1)] / self._scale,
            np.eye(n),  # interpolates unit vectors, so that its values are the weights
            kernel="thin_plate_spline" if self.kernel == "thin-plate" else self.kernel,
            degree=1 if n > k else 0,
            smoothing=np.where(repeated, np.maximum(smoothing, _REPEATED), smoothing),
        )

    def __call__(self, conditions: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n N"]:
        """Return w: one row for each condition, one column for each demonstration."""
        weights = self._spline(conditions / self._scale)
        return np.asarray(weights).reshape(len(conditions), self._n)


def amplification(weights: SmoothWeights, outcomes: Float[np.ndarray, "N k"]) -> float:
    r"""Return the mean of :math:`\sum_i w_i(c)^2` half-way between any two outcomes.

    It is the variance of random differences (posture, tempo) in a mixture, relative to their
    variance in one demonstration. Where two outcomes lie close together, the spline takes the
    difference of their motions for a slope, and weights grow far beyond one.
    """
    i, j = np.triu_indices(len(outcomes), k=1)
    halfway = 0.5 * (outcomes[i] + outcomes[j])
    return float(np.mean(np.sum(weights(halfway) ** 2, axis=1)))


def left_out_errors(
    outcomes: Float[np.ndarray, "N k"], values: Float[np.ndarray, "N F"]
) -> Float[np.ndarray, "N F"]:
    r"""Return the leave-one-out errors of a linear spline through values f.

    One inverse gives all of them: :math:`(M^{-1} f)_i / (M^{-1})_{ii}`, where M is the matrix of
    the spline of all values. Exceptions are the ends of a component's range, by which distances are
    divided: without one of these the spline is fitted anew.

    Source: Rippa, "An algorithm for selecting a good value for the parameter c in radial basis
    function interpolation", 1999.
    """
    n, k = outcomes.shape
    extent = np.ptp(outcomes, axis=0)
    scaled = (outcomes - outcomes.mean(axis=0)) / extent
    distances = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    # The tail is affine if enough others are left, as in `smooth_weights`.
    tail = np.column_stack([np.ones(n), scaled]) if n - 1 > k else np.ones((n, 1))
    zeros = np.zeros((tail.shape[1], tail.shape[1]))
    matrix = np.block([[_REPEATED * np.eye(n) - distances, tail], [tail.T, zeros]])
    inverse = np.linalg.inv(matrix)[:n, :n]
    errors = inverse @ values / np.diag(inverse)[:, None]
    for i in range(n):
        others = np.delete(np.arange(n), i)
        if np.any(np.ptp(outcomes[others], axis=0) < extent):
            weights = smooth_weights(outcomes[others], kernel="linear")(outcomes[i : i + 1])
            errors[i] = values[i] - weights[0] @ values[others]
    return np.asarray(errors)
