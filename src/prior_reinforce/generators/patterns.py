"""Whether demonstrations follow one motion pattern, or several that do not mix.

Plans of one pattern differ by amounts that go with their outcomes; what lies between two of them
reaches what lies between their outcomes. A throw from above and one from below do not mix: half of
each is no throw. Two demonstrations go together if their motions agree in direction, aligned or at
some delay, or if one affine function of the outcome explains all of them, as for pushes to the left
and to the right. Those that agree are parted all the same where each half tells its own left-out
motions far better than all tell them together, as for forehand and backhand.
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

_AGREE = 0.1
"""Least correlation of two motions of one pattern. Ours: on the zoo's development tasks every
demonstration correlates by 0.33 or more with another of its set, in two manners and with outliers;
a one-way motion and its mirror image correlate by -1. A motion that returns and its mirror image
are not told apart, since a delay of half a period hides the sign."""
_AGREE_LATER = 0.5
"""Least correlation at the delay at which two motions agree best. Ours: six throws, three of them
mirrored, are not aligned where mirrored ones drive one away from its like (5 of 60 random sets
were taken for three patterns); an outlier of another style has 0.34 at most on `zoo-curl`. None of
242 sets of the zoo and of our own tasks is sorted otherwise for it."""
_MAX_UNEXPLAINED = 0.3
"""Demonstrations are one pattern if an affine function of the outcome leaves no more than this part
of their variance. Ours: it leaves 0.08 to 0.26 on our own tasks; up to 0.92 in the zoo, where all
motions agree in direction as well."""

_TOLD_APART = 0.35
"""Demonstrations are of two ways if, left out one by one, they are missed in their own half by less
than this part of the squared error that all leave. Ours: 0.01 to 0.26 on 13 of 14 sets of
`zoo.SEVERAL_WAYS`, seeds from 100 on; of the zoo's development tasks, sets of eight or more below
it gain by being parted (reproduction/docs/decisions-generator.md)."""
_FEWEST_BY_PLACE, _FEWEST_BY_DIRECTION = 3, 4
"""Demonstrations of a half, halved by where they move or by the direction they move in: with fewer,
what they tell of a left-out one is nothing. Ours: three that moved in another direction were mostly
a manner, of which the rest learned no better alone (reproduction/docs/decisions-generator.md)."""

_Motions = Float[np.ndarray, "N F"]
"""Channels over a common phase, in a row each; every unit counts alike."""


def patterns(demonstrations: Demonstrations) -> tuple[tuple[int, ...], ...]:
    """Sort demonstrations into patterns that do not mix, by their numbers, the largest first."""
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

    agree = unit_vectors @ unit_vectors.T > _AGREE
    if not agree.all():  # else no delay has anything to add, and all are long to scan
        agree |= best_correlations(flat.reshape(velocities.shape)) > _AGREE_LATER
    _, labels = connected_components(agree, directed=False)
    motions = motion_vectors(demonstrations)
    found = [
        tuple(way.tolist())
        for label in np.unique(labels)
        for way in _ways(np.flatnonzero(labels == label), motions, unit_vectors, outcomes)
    ]
    return tuple(sorted(found, key=lambda members: (-len(members), members)))


def motion_vectors(demonstrations: Demonstrations) -> _Motions:
    """Return how demonstrations move, on a phase that starts where their motions do.

    InvalidDemonstrationsError if none of them moves.
    """
    decomposition = decompose(demonstrations, "start")
    shapes = decomposition.shapes
    return _pooled(shapes, decomposition.units, shapes.mean(axis=0))


def _pooled(
    values: Float[np.ndarray, "N T D"], units: Sequence[str], mean: float | np.ndarray = 0.0
) -> _Motions:
    """Flatten channels, each unit divided by its root mean square about a mean."""
    scaled = values.copy()
    for unit in set(units):
        of_unit = np.array(units) == unit
        size = float(np.sqrt(np.mean((values - mean)[:, :, of_unit] ** 2)))
        scaled[:, :, of_unit] /= size or 1.0
    return scaled.reshape(len(values), -1)


def _ways(
    members: Int[np.ndarray, " n"],
    motions: _Motions,
    directions: _Motions,
    outcomes: Float[np.ndarray, "N k"],
) -> list[Int[np.ndarray, " _"]]:
    """Halve demonstrations by where they move or by how, as long as the halves are told apart."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(members) < 2 * _FEWEST_BY_PLACE:
        return [members]
    apart, halves = float("inf"), [members]
    for vectors, fewest in ((motions, _FEWEST_BY_PLACE), (directions, _FEWEST_BY_DIRECTION)):
        labels = fcluster(linkage(vectors[members], "ward"), 2, "maxclust")
        halving = [members[labels == label] for label in (1, 2)]
        missed = sum(_left_out(motions[half], outcomes[half]) for half in halving)
        # An affine law of the outcome fits fewer exactly, whatever they are.
        enough = max(fewest, outcomes.shape[1] + 1)
        if min(map(len, halving)) >= enough and missed < apart:
            apart, halves = missed, halving
    if not apart < _TOLD_APART * _left_out(motions[members], outcomes[members]):
        return [members]
    return [way for half in halves for way in _ways(half, motions, directions, outcomes)]


def _left_out(motions: _Motions, outcomes: Float[np.ndarray, "N k"]) -> float:
    """Squared error of motions that are interpolated from the others; inf where that cannot be."""
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
    if len(outcomes) <= basis.shape[1] + 1:  # too few to leave anything
        return True
    centred = motions - motions.mean(axis=0)
    left = motions - basis @ np.linalg.lstsq(basis, motions, rcond=None)[0]
    return bool(np.sum(left**2) <= _MAX_UNEXPLAINED * np.sum(centred**2))
