"""Estimate the vertical axis that demonstrations are turned about, to check the declared one.

Demonstrations cannot say whether a symmetry holds, since people need not use it. Where they do, the
hand's path is the same for every bearing, seen from the axis. So the estimate is the axis about
which hand paths, each turned by the difference of bearings, differ least, over all pairs. Ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans, Point, Points
from prior_reinforce.plans.interpolation import interp_columns
from prior_reinforce.plans.kinematics import Chain, tool_tip
from prior_reinforce.plans.speeds import mean_frame
from prior_reinforce.plans.symmetry.charts import Polar
from prior_reinforce.plans.symmetry.moves import TurnIncrements, TurnPath, TurnPoses
from prior_reinforce.plans.symmetry.symmetry import Symmetry

Paths = Float[np.ndarray, "N W 2"]
_HALF_WINDOW = 1 / 6
"""Share of a plan before and after its middle that is compared (ours): approaches differ freely."""
_BASE_PRIOR = 1e-3
"""Penalty on an axis as far from the base as the outcomes, as a share of the unturned paths'
difference (ours): where any axis fits, as with a shift, the base is chosen."""
_LEAST_BEARING_RANGE = 0.1
"""Least range of the demonstrations' bearings, in [rad], that identifies an axis (ours)."""
NEAR = 0.1
"""Two axes closer than this share of the reach count as the same (ours)."""
_ENOUGH, _CLEARLY_WORSE = 5, 3.0
"""So many demonstrations tell two axes apart, where one leaves so many times more residual (ours).
Of every two to four of V1's, turned about its own axis, none differ more than unturned, and about a
place 43 cm ahead all do; six leave 1.04 times what they leave about the best, and 4.7 or more about
a wrong one (curling 1.01, and 5.3 about the base)."""


@dataclass(frozen=True)
class Axis:
    """The axis of a turn that fits the demonstrations best, in the outcomes' units."""

    found: tuple[float, float]
    """(x, y) of the axis about which hand paths differ least."""
    offset: float
    """Distance of the found axis from the declared one."""
    reach: float
    """Mean distance of the outcomes from the declared axis."""
    residual: float
    """Mean squared difference of hand paths turned about the declared axis, over unturned ones."""
    least_residual: float
    """The same about the found axis."""
    n: int
    """Number of demonstrations."""

    @property
    def doubted(self) -> bool:
        """Whether the declared axis is probably wrong."""
        clearly = self.n >= _ENOUGH and self.residual > _CLEARLY_WORSE * self.least_residual
        return self.offset > NEAR * self.reach and (self.residual > 1.0 or clearly)

    def __str__(self) -> str:
        """In one line, for a person."""
        x, y = self.found
        said = (
            f"{self.n} demonstrations look turned about ({x:.2f}, {y:.2f}), {self.offset:.2f} m "
            f"from the declared axis; turning about that one leaves {self.residual:.0%} of what "
            "they differ by"
        )
        if self.doubted:
            return f"WARNING: {said}: is the axis right? see [symmetry] object"
        few = "; so few tell it roughly" if self.n < _ENOUGH else ""
        return f"axis: {said}{few}"


def hand_paths(
    symmetry: Symmetry,
    plans: Plans,
    chain: Chain | None = None,
    joints: Sequence[int] = (),
    tip: Sequence[float] = (0.0,) * 3,
) -> Float[np.ndarray, "N H 2"] | None:
    """Return the hand's paths seen from above, [m]; None where plans do not determine them.

    The symmetry's turn names the columns of poses or increments. For plans of joints, `chain` is
    the arm and `joints` are its columns (None takes the turn's own); `tip` is the hand in the
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
    """Estimate the axis of a turn from hand paths; None where bearings hardly differ.

    Outcomes (N, k) are in the paths' unit; `declared` is the chart with the axis that was declared.
    """
    from scipy.optimize import minimize

    bearings = declared.to(outcomes)[:, 1]
    if np.ptp(bearings) < _LEAST_BEARING_RANGE:
        return None
    half = max(2, round(_HALF_WINDOW * paths.shape[1]))
    windows = np.stack([_window(path, half) for path in paths])
    places, centre = outcomes[:, :2], np.array(declared.centre)
    mean = places.mean(axis=0)

    def cost(axis: Point) -> float:
        prior = _BASE_PRIOR * float(axis @ axis) / float(mean @ mean)
        return _residual(windows, places, axis) + prior

    options = {"xatol": 1e-3, "fatol": 1e-5, "maxiter": 120}
    simplex = 0.1 * float(np.linalg.norm(mean)) * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    solutions = [
        minimize(
            cost,
            share * mean,
            method="Nelder-Mead",
            options={**options, "initial_simplex": share * mean + simplex},
        )
        for share in (0.0, 0.4, -0.3)
    ]
    best = min(solutions, key=lambda solution: float(solution.fun)).x
    return Axis(
        found=(float(best[0]), float(best[1])),
        offset=float(np.linalg.norm(best - centre)),
        reach=float(np.linalg.norm(places - centre, axis=1).mean()),
        residual=_residual(windows, places, centre),
        least_residual=_residual(windows, places, best),
        n=len(places),
    )


def _window(path: Float[np.ndarray, "H 2"], half: int) -> Float[np.ndarray, "W 2"]:
    """Cut a window around the path's mean frame, which does not depend on its bearing."""
    centre = mean_frame(np.square(np.diff(path, axis=0)).sum(axis=1), first=0.5)
    return interp_columns(centre + np.arange(-half, half + 1), np.arange(len(path)), path)


def _residual(windows: Paths, places: Points, axis: Point) -> float:
    """Mean squared difference of paths turned about an axis onto each other, over unturned ones."""
    x, y = (places - axis).T
    bearing = np.arctan2(y, x)
    angle = bearing[None] - bearing[:, None]  # from i to j
    cos, sin = np.cos(angle)[:, :, None], np.sin(angle)[:, :, None]
    px, py = np.moveaxis(windows - axis, 2, 0)[:, :, None]
    turned = np.stack([cos * px - sin * py, sin * px + cos * py], axis=-1) + axis
    unturned = np.square(windows[:, None] - windows[None]).sum()
    return float(np.square(turned - windows[None]).sum() / max(unturned, 1e-12))
