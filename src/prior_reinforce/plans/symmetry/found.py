"""A turn that demonstrations show by themselves: the first joint follows the outcome's bearing.

Somebody who throws in another direction mostly turns the arm about its base, and throws as before.
Then the first joint of each demonstration is the bearing of its outcome, give or take a constant,
seen from the base: the origin of the outcomes' frame. Such a turn can be taken out before anything
is learned, as a declared one is; what it does not explain is learned. Ours; on which evidence,
reproduction/docs/decisions-generator.md tells.
"""

from __future__ import annotations

import numpy as np

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry.anchors import Anchors
from prior_reinforce.plans.symmetry.moves import Learned, TurnJoint
from prior_reinforce.plans.symmetry.symmetry import Symmetry, turn_and_scale
from prior_reinforce.units import kind_of

_FEWEST = 4
"""Demonstrations that tell a turn from chance. This and what follows: ours."""
_APART = 0.1
"""Range of the first joint at least, in [rad]."""
_UNEXPLAINED = 0.2
"""What bearings may be off, of the first joint's standard deviation."""


def find_turn(demonstrations: Demonstrations) -> Symmetry | None:
    """Return the turn about the base that demonstrations show; None where they show none.

    Plans are of joints, and x and y of outcomes in metres. All but the bearing is left to be
    learned.
    """
    joint, form = _first_joint(demonstrations.format), demonstrations.outcome_format
    of_places = form.names[:2] == ("x", "y") and form.units[:2] == ("m", "m")
    if joint is None or not of_places or demonstrations.n < _FEWEST:
        return None
    turned = np.median(demonstrations.plans[:, :, joint], axis=1)
    bearing = np.arctan2(demonstrations.outcomes_seen[:, 1], demonstrations.outcomes_seen[:, 0])
    off = {way: _spread(bearing - way * turned) for way in (1.0, -1.0)}  # as the joint counts
    way = min(off, key=off.__getitem__)
    if np.ptp(turned) < _APART or off[way] > _UNEXPLAINED * np.std(turned):
        return None
    others = (Learned(),) * (form.outcome_dim - 2)
    symmetry = turn_and_scale(TurnJoint(joint, way), (0.0, 0.0), Learned(), others)
    symmetry = symmetry.around(demonstrations.outcomes_seen)
    anchors = Anchors(symmetry, demonstrations.outcomes_seen, demonstrations.outcome_noise)
    return symmetry if anchors.mixed else None


def _first_joint(form: PlanFormat) -> int | None:
    """Column of the first angle of plans of joints; None where plans hold places or increments."""
    if form.increments or any(kind_of(unit) == "length" for unit in form.units):
        return None
    return next((i for i, unit in enumerate(form.units) if unit == "rad"), None)


def _spread(angles: np.ndarray) -> float:
    """Standard deviation of angles about their mean direction, in [rad]."""
    mean = np.exp(1j * angles).mean()
    apart = np.angle(np.exp(1j * angles) / mean)
    return float(np.sqrt(apart @ apart / (len(apart) - 1)))
