"""A turn that demonstrations show by themselves: the motion follows the outcome's bearing.

Somebody who throws in another direction mostly turns the arm about its base, and throws as before.
Then the first joint of each demonstration is the bearing of its outcome, give or take a constant,
seen from the base: the origin of the outcomes' frame. Who pushes what lies there with increments dx
and dy heads for where it is to go. Such a turn can be taken out before anything is learned, as a
declared one is; what it does not explain is learned. Ours; on which evidence,
reproduction/docs/decisions-generator.md tells.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry.anchors import Anchors
from prior_reinforce.plans.symmetry.axis import NEAR
from prior_reinforce.plans.symmetry.declared import declare_symmetry
from prior_reinforce.plans.symmetry.moves import Learned, TurnIncrements, TurnJoint
from prior_reinforce.plans.symmetry.symmetry import Symmetry, turn_and_scale
from prior_reinforce.units import kind_of

_FEWEST = 4
"""Demonstrations that tell a turn from chance. This and what follows: ours."""
_APART = 0.04
"""Standard deviation of directions at least, in [rad]."""
_UNEXPLAINED = 0.2
"""What bearings may be off, of the standard deviation of directions."""
_BY_CHANCE = 0.01
"""Where an axis elsewhere explains bearings so much better that it is less probably by chance, and
it is not near the origin, none is found."""


def find_turn(demonstrations: Demonstrations) -> Symmetry | None:
    """Return the turn about the origin that demonstrations show; None where they show none.

    Plans are of joints or of increments dx and dy, and x and y of outcomes in metres. All but the
    bearing is left to be learned.
    """
    form, outcomes = demonstrations.outcome_format, demonstrations.outcomes_seen
    of_places = form.names[:2] == ("x", "y") and form.units[:2] == ("m", "m")
    if not of_places or demonstrations.n < _FEWEST:
        return None
    bearing = np.arctan2(outcomes[:, 1], outcomes[:, 0])
    for symmetry, directions in _turns(
        demonstrations.plans, demonstrations.format, form.outcome_dim
    ):
        apart = _spread(directions)
        if apart > _APART and _spread(bearing - directions) <= _UNEXPLAINED * apart:
            if _axis_elsewhere(directions, outcomes[:, :2]):
                return None
            found = symmetry.around(outcomes)
            anchors = Anchors(found, outcomes, demonstrations.outcome_noise)
            return found if anchors.mixed else None
    return None


def _turns(
    plans: Plans, form: PlanFormat, k: int
) -> list[tuple[Symmetry, Float[np.ndarray, " N"]]]:
    """Turns that plans may show, each with the direction of every plan, [rad]."""
    if form.increments:
        with suppress(ConfigurationError):  # of other columns than can be turned
            symmetry = declare_symmetry(form, k, about="base", distance="learned")
            turn = symmetry.moves[1]
            if isinstance(turn, TurnIncrements):
                steps = plans[:, :, turn.place]
                headed = np.einsum("nhi,nh->ni", steps, np.square(steps).sum(axis=2))
                return [(symmetry, np.arctan2(headed[:, 1], headed[:, 0]))]
        return []
    if any(kind_of(unit) == "length" for unit in form.units) or "rad" not in form.units:
        return []
    joint = form.units.index("rad")
    # In the first half the arm may still be on its way from one pose to where it throws.
    angle = np.median(plans[:, plans.shape[1] // 2 :, joint], axis=1)
    others = (Learned(),) * (k - 2)
    return [
        (turn_and_scale(TurnJoint(joint, way), (0.0, 0.0), Learned(), others), way * angle)
        for way in (1.0, -1.0)  # as the joint counts
    ]


def _axis_elsewhere(directions: Float[np.ndarray, " N"], places: Float[np.ndarray, "N 2"]) -> bool:
    """Whether directions are bearings about an axis that is clearly not the origin.

    By an F test of the axis that is fitted: 2 parameters more, and N - 3 degrees of freedom left.
    """
    from scipy.optimize import least_squares

    size = float(np.linalg.norm(places, axis=1).mean())

    def off(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, " N"]:
        x, y = (places / size - axis[:2]).T
        return np.angle(np.exp(1j * (np.arctan2(y, x) - directions - axis[2])))

    first = float(np.angle(np.exp(1j * off(np.zeros(3))).mean()))
    there = np.array([0.0, 0.0, first])
    fitted = least_squares(off, there)
    ratio = 2.0 * float(fitted.cost) / float(np.square(off(there)).sum())
    by_chance = ratio ** ((len(places) - 3) / 2)
    return bool(by_chance < _BY_CHANCE and np.linalg.norm(fitted.x[:2]) > NEAR)


def _spread(angles: Float[np.ndarray, " N"]) -> float:
    """Standard deviation of angles about their mean direction, in [rad]."""
    mean = np.exp(1j * angles).mean()
    apart = np.angle(np.exp(1j * angles) / mean)
    return float(np.sqrt(apart @ apart / (len(apart) - 1)))
