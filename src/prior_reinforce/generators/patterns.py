"""Whether demonstrations follow one motion pattern, or several that do not mix.

Plans of one pattern differ by amounts that go with their outcomes; what lies between two of them
reaches what lies between their outcomes. A throw from above and one from below do not mix: half of
each is no throw. Two demonstrations go together if their motions agree in direction, or if one
affine function of the outcome explains all of them, as for pushes to the left and to the right.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timeline import decompose

_AGREE = 0.1
"""Least correlation of two motions of one pattern. Ours: on the zoo's development tasks every
demonstration correlates by 0.33 or more with another of its set, in two manners and with outliers;
a one-way motion and its mirror image correlate by -1. A motion that returns and its mirror image
are not told apart, since a delay of half a period hides the sign."""
_MAX_UNEXPLAINED = 0.3
"""Demonstrations are one pattern if an affine function of the outcome leaves no more than this part
of their variance. Ours: it leaves 0.08 to 0.26 on our own tasks; up to 0.92 in the zoo, where all
motions agree in direction as well."""


def patterns(demonstrations: Demonstrations) -> tuple[tuple[int, ...], ...]:
    """Sort demonstrations into patterns that do not mix, the largest first.

    Returns:
        Numbers of the demonstrations of each pattern; mostly one pattern of all.
    """
    everything = tuple(range(demonstrations.n))
    try:
        decomposition = decompose(demonstrations, "start")
    except InvalidDemonstrationsError:
        return (everything,)
    velocities = np.gradient(decomposition.shapes, axis=1)
    units = np.array(decomposition.timeline.names(demonstrations.format)[1][: velocities.shape[2]])
    for unit in set(units.tolist()):
        pooled = float(np.sqrt(np.mean(velocities[:, :, units == unit] ** 2)))
        velocities[:, :, units == unit] /= pooled or 1.0
    flat = velocities.reshape(demonstrations.n, -1)
    if _explained(flat, demonstrations.outcomes_seen):
        return (everything,)
    unit_vectors = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    from scipy.sparse.csgraph import connected_components

    _, labels = connected_components(unit_vectors @ unit_vectors.T > _AGREE, directed=False)
    found = [tuple(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)]
    return tuple(sorted(found, key=lambda members: (-len(members), members)))


def _explained(motions: Float[np.ndarray, "N F"], outcomes: Float[np.ndarray, "N k"]) -> bool:
    """Whether an affine function of the outcome explains the motions."""
    basis = np.column_stack([np.ones(len(outcomes)), outcomes])
    if len(outcomes) <= basis.shape[1] + 1:  # too few to leave anything
        return True
    centred = motions - motions.mean(axis=0)
    left = motions - basis @ np.linalg.lstsq(basis, motions, rcond=None)[0]
    return bool(np.sum(left**2) <= _MAX_UNEXPLAINED * np.sum(centred**2))
