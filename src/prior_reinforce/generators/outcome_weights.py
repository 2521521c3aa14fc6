"""How much each demonstration counts for a wished-for outcome: weights that sum to one.

Two schemes, shared by the interpolating generators. Distances are taken after dividing every
outcome component by its demonstrated range, so that components may differ in unit.

Notation (docs/notation.md):
    c  conditions, one per row              (n, k)  in the outcomes' units
    r  outcomes of the demonstrations       (N, k)  in the outcomes' units
    w  weights, rows sum to one             (n, N)  [-]
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial.distance import cdist

Kernel = Literal["thin-plate", "linear"]
"""Of `smooth_weights`."""


def inverse_distance_weights(
    conditions: np.ndarray, outcomes: np.ndarray, *, neighbours: int, power: float
) -> np.ndarray:
    r"""Return Shepard's weights over the nearest demonstrations.

    .. math:: w_i \propto \|c - r_i\|^{-p}, \quad i \in \text{the nearest } m, \quad w_i = 0
        \text{ else}

    All weights are in [0, 1]: a convex combination, which never extrapolates. They are continuous
    in c where m = N; where m < N they jump when the m-th neighbour changes.

    Args:
        conditions: c, shape (n, k).
        outcomes: r, shape (N, k), no two rows equal.
        neighbours: m; all demonstrations where there are fewer.
        power: p > 0.

    Returns:
        w, shape (n, N). At an outcome of a demonstration, exactly that demonstration.

    Source: Shepard, "A two-dimensional interpolation function for irregularly-spaced data",
    ACM National Conference 1968; the paper says only "computed based on distances".
    """
    scale = np.ptp(outcomes, axis=0)
    distances = cdist(conditions / scale, outcomes / scale)
    n, n_demonstrations = distances.shape
    nearest = np.argsort(distances, axis=1, kind="stable")[:, :neighbours]
    rows = np.arange(n)[:, None]
    near = distances[rows, nearest]
    # Relative to the nearest, so that no power over- or underflows; 0/0 is an exact hit.
    with np.errstate(invalid="ignore", divide="ignore"):
        kept = (near[:, :1] / near) ** power
    hit = near[:, 0] == 0
    kept[hit] = 0.0
    kept[hit, 0] = 1.0
    weights = np.zeros((n, n_demonstrations))
    weights[rows, nearest] = kept / kept.sum(axis=1, keepdims=True)
    return weights


def smooth_weights(conditions: np.ndarray, outcomes: np.ndarray, *, kernel: Kernel) -> np.ndarray:
    r"""Return the cardinal weights of a polyharmonic spline with an affine tail.

    The interpolant of values :math:`f_i` at :math:`r_i`,
    :math:`f(c) = \sum_i a_i \varphi(\|c - r_i\|) + b_0 + b^\top c` with
    :math:`\sum_i a_i = 0, \sum_i a_i r_i = 0`, is linear in the values; this returns
    :math:`w_i(c)` of :math:`f(c) = \sum_i w_i(c) f_i`. Weights may be negative: it extrapolates,
    and reproduces every affine dependence of plan on outcome exactly.

    Args:
        conditions: c, shape (n, k).
        outcomes: r, shape (N, k). With N <= k the tail is constant, and the kernel linear, because
            the other one needs an affine tail to be solvable.
        kernel: :math:`\varphi(d)` is d^2 log d (`thin-plate`) or d (`linear`).

    Returns:
        w, shape (n, N); rows sum to one.

    Source: Wendland, "Scattered Data Approximation", 2005, chapter 8 (ours to use it here).
    """
    centre, scale = outcomes.mean(axis=0), np.ptp(outcomes, axis=0)
    known, asked = (outcomes - centre) / scale, (conditions - centre) / scale
    n_known, k = known.shape
    tail = k if n_known > k else 0
    kernel = kernel if tail else "linear"
    tail_known = np.hstack([np.ones((n_known, 1)), known[:, :tail]])
    tail_asked = np.hstack([np.ones((len(asked), 1)), asked[:, :tail]])
    n_tail = tail_known.shape[1]
    system = np.zeros((n_known + n_tail, n_known + n_tail))
    system[:n_known, :n_known] = _polyharmonic(cdist(known, known), kernel)
    system[:n_known, n_known:] = tail_known
    system[n_known:, :n_known] = tail_known.T
    asked_side = np.hstack([_polyharmonic(cdist(asked, known), kernel), tail_asked])
    # The system is symmetric: its inverse applied to the asked side gives the cardinal weights.
    weights: np.ndarray = lu_solve(lu_factor(system), asked_side.T)[:n_known].T
    return weights


def _polyharmonic(distances: np.ndarray, kernel: Kernel) -> np.ndarray:
    if kernel == "linear":
        return distances
    positive = np.where(distances > 0, distances, 1.0)
    return np.asarray(distances**2 * np.log(positive))
