"""Make Fishing's prior sets: `python -m reproduction.demonstrations.fishing`.

As in the paper, the demonstrations are tele-operated. The operator faces the magnet, raises the rod
behind, and casts forward and down so that the hook swings out ahead of the rod's tip; to cast
further, the hand stands and ends further out. Each is executed once, with the disturbances of any
execution, and where the hook first touched the table is its outcome.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.fishing import Fishing
from reproduction.demonstrations import DRAWN, seed_and_aims, warps, write_sets
from reproduction.demonstrations.teleoperation import Teleoperation, record
from reproduction.following import warped

HORIZON = 140
"""Frames, as in the paper."""
READY = np.array([0.42, 0.42, 0.085])
RAISED = np.array([0.39, 0.44, -0.165])
CAST = np.array([0.42, 0.30, 0.735])
"""Hand before the cast, at its highest, and after it: distance from the base axis and height of the
flange in [m], and its tilt in [rad], under which the rod rises by 45 degrees less the tilt."""
FURTHER = np.array([0.10, 0.10, 0.20])
"""How much further out those three are at reach 1 than at reach 0, in [m]."""
RAISE_TIME, CAST_TIME = 0.65, 0.90
"""Durations of the two strokes at tempo 1, in [s]."""
NEAR, FAR = 0.832, 0.997
"""Where casts of reach 0 and 1 land, from the base axis, about; the operator's feel, in [m]."""
AIMED = {
    "A": (
        (0.79, -0.20), (0.80, -0.02), (0.79, 0.19), (0.88, -0.11),
        (0.89, 0.12), (0.97, -0.20), (0.98, 0.03), (0.96, 0.20),
    ),
    "B": (
        (0.78, -0.14), (0.79, 0.10), (0.87, 0.20), (0.86, -0.21),
        (0.88, 0.01), (0.97, -0.12), (0.98, 0.11), (0.94, 0.21),
    ),
}  # fmt: skip
"""Where the operator aims, (x, y) in [m]."""
SEEDS = {"A": 1, "B": 2}


@dataclass(frozen=True)
class CastVariation:
    """How an operator's casts differ; standard deviations unless said otherwise; ours."""

    start: tuple[float, float] = (0.10, 1.03)
    """Range of start times, in [s]: a third of the horizon, evenly spread over a set."""
    tempo: float = 0.015
    """Relative difference of each stroke's duration."""
    place: float = 0.008
    """Place of the hand along each direction, before, at the top and after, in [m]."""
    tilt: float = 0.03
    """Tilt of the hand, before, at the top and after, in [rad]."""
    hand: Teleoperation = field(default_factory=Teleoperation)
    """Tremor, tracker and follower."""


def cast(
    azimuth: float,
    hand: Float[np.ndarray, "3 3"],
    start: float,
    durations: Float[np.ndarray, "2"],
    dt: float,
    warp: Float[np.ndarray, " w"],
) -> Float[np.ndarray, "H 6"]:
    """Flange poses of one cast, as meant, `HORIZON` frames.

    Args:
        azimuth: Direction of the cast about the base axis, in [rad].
        hand: Distance, height, tilt before, at the top and after the cast.
        start: When the hand begins to rise, in [s].
        durations: Of raising and of casting, in [s].
        dt: Time between frames, in [s].
        warp: Of the pace of both; see `following.warped`.
    """
    times = np.arange(HORIZON) * dt - start
    raised, thrown = (
        minimum_jerk(warped(np.clip(part, 0.0, 1.0), warp))[:, None]
        for part in (times / durations[0], (times - durations[0]) / durations[1])
    )
    distance, height, tilt = (
        hand[0] + raised * (hand[1] - hand[0]) + thrown * (hand[2] - hand[1])
    ).T
    attitude = Rotation.from_rotvec([0.0, 0.0, azimuth]) * Rotation.from_rotvec(
        tilt[:, None] * np.array([0.0, 1.0, 0.0])
    )
    return np.column_stack(
        [distance * np.cos(azimuth), distance * np.sin(azimuth), height, attitude.as_rotvec()]
    )


def make(name: str) -> Demonstrations:
    """Make the prior set `name` (A, B or drawn), the same every time on the same machine."""
    size = CastVariation()
    task = Fishing()
    seed, aimed = seed_and_aims(name, SEEDS, AIMED)
    rng, dt = np.random.default_rng(seed), task.format.dt
    plans = []
    starts = rng.permutation(np.linspace(*size.start, len(aimed)))
    for aim, start, warp in zip(aimed, starts, warps(name, len(aimed)), strict=True):
        reach = (np.hypot(*aim) - NEAR) / (FAR - NEAR)
        hand = np.stack([READY, RAISED, CAST])
        hand[:, 0] += reach * FURTHER
        hand += rng.normal(0.0, [size.place, size.place, size.tilt], (3, 3))
        durations = np.array([RAISE_TIME, CAST_TIME]) * (1.0 + rng.normal(0.0, size.tempo, 2))
        meant = cast(float(np.arctan2(aim[1], aim[0])), hand, float(start), durations, dt, warp)
        plans.append(record(meant, dt, size.hand, rng))
    outcomes = [rollout.outcome for rollout in task.rollout(np.array(plans), rng)]
    return Demonstrations(np.array(plans), np.array(outcomes), task.format)


if __name__ == "__main__":
    write_sets(make, (*AIMED, *DRAWN), "fishing", __doc__)
