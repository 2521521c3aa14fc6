"""Find an undeclared turn in demonstrations: the motion follows the outcome's bearing.

To throw in another direction, people mostly turn the arm about its base, and throw as before. Then
the first joint of each demonstration is the bearing of its outcome plus a constant, seen from the
base: the origin of the outcomes' frame. To push an object that lies there by increments dx and dy,
they head for its goal. Such a turn is taken out before anything is learned, as a declared one is;
the rest is learned. Ours; reproduction/docs/decisions-generator.md gives the evidence.
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
"""Fewest demonstrations that distinguish a turn from chance. This and the following: ours."""
_LEAST_SPREAD = 0.04
"""Least standard deviation of directions, in [rad]."""
_LARGEST_RESIDUAL = 0.2
"""Largest residual of bearings, relative to the standard deviation of directions."""
_SIGNIFICANCE = 0.01
"""No turn is found if an axis away from the origin explains bearings better, at this level of
significance."""


def find_turn(demonstrations: Demonstrations) -> Symmetry | None:
    """Return the turn about the origin that demonstrations show, or None.

    Plans must be of joints or of increments dx and dy, and x and y of outcomes in metres. All
    components but the bearing remain to be learned.
    """
    form, outcomes = demonstrations.outcome_format, demonstrations.outcomes_seen
    is_place = form.names[:2] == ("x", "y") and form.units[:2] == ("m", "m")
    if not is_place or demonstrations.n < _FEWEST:
        return None
    bearing = np.arctan2(outcomes[:, 1], outcomes[:, 0])
    for symmetry, directions in _turns(
        demonstrations.plans, demonstrations.format, form.outcome_dim
    ):
        spread = _spread(directions)
        if spread > _LEAST_SPREAD and _spread(bearing - directions) <= _LARGEST_RESIDUAL * spread:
            if _axis_elsewhere(directions, outcomes[:, :2]):
                return None
            found = symmetry.around(outcomes)
            anchors = Anchors(found, outcomes, demonstrations.outcome_noise)
            return found if anchors.mixed else None
    return None


def _turns(
    plans: Plans, form: PlanFormat, k: int
) -> list[tuple[Symmetry, Float[np.ndarray, " N"]]]:
    """Return the turns that plans may show, each with the direction of every plan, [rad]."""
    if form.increments:
        with suppress(ConfigurationError):  # raised for columns that cannot be turned
            symmetry = declare_symmetry(form, k, about="base", distance="learned")
            turn = symmetry.moves[1]
            if isinstance(turn, TurnIncrements):
                steps = plans[:, :, turn.place]
                heading = np.einsum("nhi,nh->ni", steps, np.square(steps).sum(axis=2))
                return [(symmetry, np.arctan2(heading[:, 1], heading[:, 0]))]
        return []
    if any(kind_of(unit) == "length" for unit in form.units) or "rad" not in form.units:
        return []
    joint = form.units.index("rad")
    # In the first half the arm may still be on its way from one pose to where it throws.
    angle = np.median(plans[:, plans.shape[1] // 2 :, joint], axis=1)
    others = (Learned(),) * (k - 2)
    return [
        (turn_and_scale(TurnJoint(joint, gain), (0.0, 0.0), Learned(), others), gain * angle)
        for gain in (1.0, -1.0)
    ]


def _axis_elsewhere(directions: Float[np.ndarray, " N"], places: Float[np.ndarray, "N 2"]) -> bool:
    """Whether directions are bearings about an axis that is clearly not the origin.

    By an F test of the fitted axis: 2 additional parameters, and N - 3 degrees of freedom.
    """
    from scipy.optimize import least_squares

    size = float(np.linalg.norm(places, axis=1).mean())

    def residuals(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, " N"]:
        x, y = (places / size - axis[:2]).T
        return np.angle(np.exp(1j * (np.arctan2(y, x) - directions - axis[2])))

    constant = float(np.angle(np.exp(1j * residuals(np.zeros(3))).mean()))
    origin = np.array([0.0, 0.0, constant])
    fitted = least_squares(residuals, origin)
    ratio = 2.0 * float(fitted.cost) / float(np.square(residuals(origin)).sum())
    p_value = ratio ** ((len(places) - 3) / 2)
    return bool(p_value < _SIGNIFICANCE and np.linalg.norm(fitted.x[:2]) > NEAR)


def _spread(angles: Float[np.ndarray, " N"]) -> float:
    """Return the standard deviation of angles about their mean direction, in [rad]."""
    mean = np.exp(1j * angles).mean()
    deviations = np.angle(np.exp(1j * angles) / mean)
    return float(np.sqrt(deviations @ deviations / (len(deviations) - 1)))
