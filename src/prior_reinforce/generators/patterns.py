"""Cluster demonstrations into motion patterns that do not mix.

Plans of one pattern vary with their outcomes, and a mixture of two reaches an outcome between
theirs. A throw from above and one from below do not mix: half of each is no throw. Two
demonstrations belong together if their motions correlate, aligned or at some delay, or if one
affine function of the outcome explains all of them, as for pushes to the left and to the right. A
cluster is split if each half predicts its own left-out motions far better than the whole does, as
for forehand and backhand.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arrays import check_spread
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators.timing.registration import best_correlations
from prior_reinforce.generators.timing.timeline import decompose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import left_out_errors

_LEAST_CORRELATION = 0.1
"""Least correlation of two motions of one pattern. Ours: on the zoo's development tasks every
demonstration correlates by 0.33 or more with another of its set, in two manners and with outliers;
a one-way motion and its mirror image correlate by -1. A motion that returns and its mirror image
are not distinguished, since a delay of half a period hides the sign."""
_LEAST_DELAYED = 0.5
"""Least correlation at the best delay of two motions. Ours: six throws, three of them mirrored, are
not aligned if mirrored ones drive one away from the others (5 of 60 random sets were taken for
three patterns); an outlier of another style has 0.34 at most on `zoo-curl`. It changes the patterns
of none of 242 sets of the zoo and of our own tasks."""
_MAX_UNEXPLAINED = 0.3
"""Demonstrations are one pattern if an affine function of the outcome leaves no more than this part
of their variance. Ours: it leaves 0.08 to 0.26 on our own tasks; up to 0.92 in the zoo, where all
motions agree in direction as well."""

_LARGEST_SPLIT_ERROR = 0.35
"""A cluster is split if the squared leave-one-out errors within its halves are less than this part
of those of the whole. Ours: 0.01 to 0.26 on 13 of 14 sets of `zoo.SEVERAL_WAYS`, seeds from 100 on;
of the zoo's development tasks, sets of eight or more below it gain by being split
(reproduction/docs/decisions-generator.md)."""
_FEWEST_BY_PLACE, _FEWEST_BY_DIRECTION = 3, 4
"""Fewest demonstrations of a half, split by place or by direction of motion: fewer predict nothing
of a left-out one. Ours: three that moved in another direction were mostly a manner, without which
the rest learned no better (reproduction/docs/decisions-generator.md)."""

_Motions = Float[np.ndarray, "N F"]
"""Channels over a common phase, one row for each demonstration, scaled by unit."""


def patterns(demonstrations: Demonstrations) -> tuple[tuple[int, ...], ...]:
    """Return the numbers of the demonstrations of each pattern, the largest pattern first."""
    everything = tuple(range(demonstrations.n))
    try:
        decomposition = decompose(demonstrations, "start")
    except InvalidDemonstrationsError:
        return (everything,)
    shapes, units = decomposition.shapes, decomposition.units
    velocities = np.gradient(shapes, axis=1)
    flat = _pooled(velocities, units)
    outcomes = demonstrations.outcomes_seen
    if _explained(flat, outcomes):
        return (everything,)
    unit_vectors = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    from scipy.sparse.csgraph import connected_components

    similar = unit_vectors @ unit_vectors.T > _LEAST_CORRELATION
    if not similar.all():  # else the long scan of delays adds nothing
        similar |= best_correlations(flat.reshape(velocities.shape)) > _LEAST_DELAYED
    _, labels = connected_components(similar, directed=False)
    motions = motion_vectors(demonstrations)
    found = [
        tuple(cluster.tolist())
        for label in np.unique(labels)
        for cluster in _split(np.flatnonzero(labels == label), motions, unit_vectors, outcomes)
    ]
    return tuple(sorted(found, key=lambda members: (-len(members), members)))


def motion_vectors(demonstrations: Demonstrations) -> _Motions:
    """Return the motions of demonstrations on their common phase, a row each.

    InvalidDemonstrationsError if none of them moves.
    """
    decomposition = decompose(demonstrations, "start")
    shapes = decomposition.shapes
    return _pooled(shapes, decomposition.units, shapes.mean(axis=0))


def _pooled(
    values: Float[np.ndarray, "N T D"], units: Sequence[str], mean: float | np.ndarray = 0.0
) -> _Motions:
    """Flatten channels, those of each unit divided by their root mean square about a mean."""
    scaled = values.copy()
    for unit in set(units):
        of_unit = np.array(units) == unit
        size = float(np.sqrt(np.mean((values - mean)[:, :, of_unit] ** 2)))
        scaled[:, :, of_unit] /= size or 1.0
    return scaled.reshape(len(values), -1)


def _split(
    members: Int[np.ndarray, " n"],
    motions: _Motions,
    directions: _Motions,
    outcomes: Float[np.ndarray, "N k"],
) -> list[Int[np.ndarray, " _"]]:
    """Split a cluster by place or direction of motion, as long as its halves predict better."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(members) < 2 * _FEWEST_BY_PLACE:
        return [members]
    least, halves = float("inf"), [members]
    for vectors, fewest in ((motions, _FEWEST_BY_PLACE), (directions, _FEWEST_BY_DIRECTION)):
        labels = fcluster(linkage(vectors[members], "ward"), 2, "maxclust")
        candidates = [members[labels == label] for label in (1, 2)]
        error = sum(_leave_one_out_error(motions[half], outcomes[half]) for half in candidates)
        # An affine function of the outcome fits k + 1 or fewer exactly.
        enough = max(fewest, outcomes.shape[1] + 1)
        if min(map(len, candidates)) >= enough and error < least:
            least, halves = error, candidates
    whole = _leave_one_out_error(motions[members], outcomes[members])
    if not least < _LARGEST_SPLIT_ERROR * whole:
        return [members]
    return [part for half in halves for part in _split(half, motions, directions, outcomes)]


def _leave_one_out_error(motions: _Motions, outcomes: Float[np.ndarray, "N k"]) -> float:
    """Return the squared leave-one-out error of motions; inf if the others do not determine it."""
    if len(motions) < 2:
        return float("inf")
    try:
        for i in range(len(motions)):
            check_spread(np.delete(outcomes, i, axis=0))
    except InvalidDemonstrationsError:
        return float("inf")
    return float(np.sum(left_out_errors(outcomes, motions) ** 2))


def _explained(motions: _Motions, outcomes: Float[np.ndarray, "N k"]) -> bool:
    """Whether an affine function of the outcome explains the motions."""
    basis = np.column_stack([np.ones(len(outcomes)), outcomes])
    if len(outcomes) <= basis.shape[1] + 1:  # too few for a residual
        return True
    centred = motions - motions.mean(axis=0)
    residuals = motions - basis @ np.linalg.lstsq(basis, motions, rcond=None)[0]
    return bool(np.sum(residuals**2) <= _MAX_UNEXPLAINED * np.sum(centred**2))
