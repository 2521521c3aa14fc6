"""About which vertical axis demonstrations look turned: a check of the one that is declared.

Whether a symmetry holds, demonstrations cannot say: people need not use it. Where it does, the hand
goes the same way for every bearing, seen from the axis. So the axis is found about which hand
paths, each turned by the difference of bearings, differ least, over all pairs. Ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans, Point, Points
from prior_reinforce.plans.interpolation import interp_columns
from prior_reinforce.plans.kinematics import Chain, tool_tip
from prior_reinforce.plans.symmetry.charts import Polar
from prior_reinforce.plans.symmetry.moves import TurnIncrements, TurnPath, TurnPoses
from prior_reinforce.plans.symmetry.symmetry import Symmetry

Paths = Float[np.ndarray, "N W 2"]
_AROUND = 1 / 6
"""Share of a plan before and after its middle that is compared (ours): approaches differ freely."""
_TOWARDS_BASE = 1e-3
"""Cost of an axis as far away as the outcomes, in shares of what paths differ by (ours): where any
axis will do, as with a shift, it is the base."""
_APART = 0.1
"""Bearings of two demonstrations at least, in [rad], to tell an axis by (ours)."""
NEAR = 0.1
"""How far from an axis another counts as the same, as a share of the reach (ours)."""
_TOLD_BY, _BETTER = 5, 3.0
"""So many demonstrations tell two axes apart, where one leaves so many times less (ours). Of every
two to four of V1's, turned about its own axis, none differ more than unturned, and about a place
43 cm ahead all do; six leave 1.04 times what they leave about the best, and 4.7 or more about a
wrong one (curling 1.01, and 5.3 about the base)."""


@dataclass(frozen=True)
class Axis:
    """What demonstrations say of the axis of a turn, in the outcomes' units."""

    found: tuple[float, float]
    """(x, y) about which they look most alike."""
    off: float
    """How far that is from the declared one."""
    reach: float
    """Mean distance of the outcomes from the declared one."""
    left: float
    """What hand paths differ by when turned about the declared one, as a share of what they differ
    by unturned (mean squares)."""
    least: float
    """The same about the one that was found."""
    n: int
    """Number of demonstrations."""

    @property
    def doubted(self) -> bool:
        """Whether the declared axis is probably not the one."""
        clearly = self.n >= _TOLD_BY and self.left > _BETTER * self.least
        return self.off > NEAR * self.reach and (self.left > 1.0 or clearly)

    def __str__(self) -> str:
        """In one line, for a person."""
        x, y = self.found
        said = (
            f"{self.n} demonstrations look turned about ({x:.2f}, {y:.2f}), {self.off:.2f} m from "
            f"the declared axis; turning about that one leaves {self.left:.0%} of what they "
            "differ by"
        )
        if self.doubted:
            return f"WARNING: {said}: is the axis right? see [symmetry] object"
        few = "; so few tell it roughly" if self.n < _TOLD_BY else ""
        return f"axis: {said}{few}"


def hand_paths(
    symmetry: Symmetry,
    plans: Plans,
    chain: Chain | None = None,
    joints: Sequence[int] = (),
    tip: Sequence[float] = (0.0,) * 3,
) -> Float[np.ndarray, "N H 2"] | None:
    """Return where the hand goes, seen from above, [m]; None where plans do not say it.

    The symmetry's turn names the columns of poses or increments; the chain is the arm, where plans
    are of its joints, in these columns (None takes the turn's own), and `tip` the hand in its
    flange's frame, [m].
    """
    for move in symmetry.moves:
        if isinstance(move, TurnPoses):
            return plans[:, :, move.place]
        if isinstance(move, TurnIncrements):
            return np.cumsum(plans[:, :, move.place], axis=1) + move.start
        if isinstance(move, TurnPath) and chain is None:
            chain, joints = move.chain, move.columns
    if chain is None or not joints:
        return None
    return tool_tip(chain, plans[:, :, list(joints)], tip)[..., :2]


def find_axis(paths: Float[np.ndarray, "N H 2"], outcomes: Points, declared: Polar) -> Axis | None:
    """Return what hand paths say of the axis of a turn; None where bearings hardly differ.

    Outcomes (N, k) are in the paths' unit; `declared` is the chart with the axis that was declared.
    """
    from scipy.optimize import minimize

    bearings = declared.to(outcomes)[:, 1]
    if np.ptp(bearings) < _APART:
        return None
    half = max(2, round(_AROUND * paths.shape[1]))
    window = np.stack([_around(path, half) for path in paths])
    place, centre = outcomes[:, :2], np.array(declared.centre)
    far = place.mean(axis=0)

    def cost(axis: Point) -> float:
        return _left(window, place, axis) + _TOWARDS_BASE * float(axis @ axis) / float(far @ far)

    options = {"xatol": 1e-3, "fatol": 1e-5, "maxiter": 120}
    corners = 0.1 * float(np.linalg.norm(far)) * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    tries = [
        minimize(
            cost,
            share * far,
            method="Nelder-Mead",
            options={**options, "initial_simplex": share * far + corners},
        )
        for share in (0.0, 0.4, -0.3)
    ]
    best = min(tries, key=lambda solution: float(solution.fun)).x
    return Axis(
        found=(float(best[0]), float(best[1])),
        off=float(np.linalg.norm(best - centre)),
        reach=float(np.linalg.norm(place - centre, axis=1).mean()),
        left=_left(window, place, centre),
        least=_left(window, place, best),
        n=len(place),
    )


def _around(path: Float[np.ndarray, "H 2"], half: int) -> Float[np.ndarray, "W 2"]:
    """Frames around the mean frame by squared speed, which is the same from every side."""
    frames, energy = np.arange(len(path)), np.square(np.diff(path, axis=0)).sum(axis=1)
    centre = (frames[:-1] + 0.5) @ energy / max(energy.sum(), 1e-12)
    at = centre + np.arange(-half, half + 1)
    return interp_columns(at, frames, path)


def _left(window: Paths, place: Points, axis: Point) -> float:
    """Mean square of what paths differ by, turned onto each other about an axis, over unturned."""
    x, y = (place - axis).T
    bearing = np.arctan2(y, x)
    angle = bearing[None] - bearing[:, None]  # from i to j
    cos, sin = np.cos(angle)[:, :, None], np.sin(angle)[:, :, None]
    px, py = np.moveaxis(window - axis, 2, 0)[:, :, None]
    turned = np.stack([cos * px - sin * py, sin * px + cos * py], axis=-1) + axis
    apart = np.square(turned - window[None]).sum()
    return float(apart / max(np.square(window[:, None] - window[None]).sum(), 1e-12))
