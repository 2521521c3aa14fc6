"""Make the prior sets of Basketball Shot V1.

    python -m reproduction.demonstrations.basketball

As in the paper, the demonstrations are found in simulation and spread over the reachable region.
All are one motion pattern, with differences such as a person's repetitions have: when it starts,
how fast it goes, how far each joint swings, and the posture it swings in. Each is solved, in
simulation, for the reach and the direction that land the ball near its designed point; then it is
executed once, with the disturbances of any execution, and where that ball landed is its outcome.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import betainc

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.basketball import BasketballShot
from prior_reinforce.simulation.tasks.basketball_fr3 import BasketballFR3
from reproduction.demonstrations import DRAWN, seed_and_aims, warps, write_sets
from reproduction.following import warped

HORIZON = 140
"""Frames, as in the paper."""
READY = np.array([0.0, -1.098, 0.0, -0.598, 0.0, 2.775, np.pi / 4])
"""Posture before the throw, in [rad]: the arm leans back, the spoon is level on top."""
SWING = np.array([0.0, 0.62, 0.0, -0.605, 0.0, -0.82, 0.0])
"""Travel of each joint in a throw to the middle of the region, in [rad]."""
LEAN = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
"""How the posture goes with reach, in [rad/rad]: a longer throw leans in; the spoon stays level."""
SWING_PER_REACH = 0.6
"""Relative change of the swing with reach, in [1/rad]: a longer throw also swings further."""
DURATION = 1.05
"""Duration of the throw at tempo 1, in [s]."""
DESIGNED = {
    "A": ((0.92, -0.27), (0.92, 0.26), (1.18, -0.27), (1.19, 0.27), (1.00, -0.04), (1.11, 0.06)),
    "B": ((0.91, 0.03), (0.97, -0.28), (0.95, 0.27), (1.20, -0.20), (1.17, 0.27), (1.07, -0.03)),
}
"""Where the six throws of each set are to land, (x, y) in [m]."""
Knobs = Float[np.ndarray, "n 2"]
"""Reach and direction of each throw, in [rad]."""
SEEDS = {"A": 1, "B": 2}
_STEADY = np.zeros(1)


@dataclass(frozen=True)
class ThrowVariation:
    """How repetitions of the throw differ; standard deviations unless said otherwise; ours."""

    start: tuple[float, float] = (0.04, 0.60)
    """Range of start times, in [s]: a third of the horizon, evenly spread over a set."""
    tempo: float = 0.015
    """Relative difference of duration."""
    amplitude: float = 0.015
    """Relative difference of every throwing joint's travel."""
    posture: float = 0.02
    """Offset of every joint but the first through the whole throw, in [rad]."""


def throw(
    start: float,
    tempo: float,
    travel: Float[np.ndarray, "7"],
    posture: Float[np.ndarray, "7"],
    dt: float,
    warp: Float[np.ndarray, " w"] = _STEADY,
) -> Float[np.ndarray, "H 7"]:
    """One throw as a plan: from rest to rest along a quintic (minimum-jerk) time course.

    Args:
        start: When the throw begins, in [s].
        tempo: Its speed relative to `DURATION`.
        travel: Travel of each joint, in [rad].
        posture: Joint positions before the throw, in [rad].
        dt: Time between frames, in [s].
        warp: Of its pace; see `following.warped`.

    Returns:
        Plan of `HORIZON` frames, in [rad].
    """
    part = np.clip((np.arange(HORIZON) * dt - start) * tempo / DURATION, 0.0, 1.0)
    return posture + travel * betainc(3, 3, warped(part, warp))[:, None]


def make(name: str, task: BasketballShot | None = None) -> Demonstrations:
    """Make the prior set `name` (A, B or drawn) of V1, or of another task, the same every time."""
    size = ThrowVariation()
    task = task or BasketballShot()
    seed, designed = seed_and_aims(name, SEEDS, DESIGNED)
    rng = np.random.default_rng(seed)
    n, dt = len(designed), task.format.dt
    starts = rng.permutation(np.linspace(*size.start, n))
    tempi = 1.0 + rng.normal(0.0, size.tempo, n)
    amplitudes = 1.0 + rng.normal(0.0, size.amplitude, (n, 7))
    postures = READY + rng.normal(0.0, size.posture, (n, 7)) * (np.arange(7) > 0)

    def plans(knobs: Knobs) -> Plans:
        reach, direction = knobs[:, :1], knobs[:, 1:]
        base = reach * LEAN + direction * np.eye(7)[0]
        travel = (1.0 + SWING_PER_REACH * reach) * amplitudes * SWING
        return np.stack(
            [
                throw(start, tempo, swing, posture, dt, warp)
                for start, tempo, swing, posture, warp in zip(
                    starts, tempi, travel, postures + base, warps(name, n), strict=True
                )
            ]
        )

    def land(knobs: Knobs) -> Points:
        return np.array([rollout.outcome for rollout in task.rollout(plans(knobs), None)])

    knobs = aim(land, designed)
    solved = plans(knobs)
    outcomes = np.array([rollout.outcome for rollout in task.rollout(solved, rng)])
    return Demonstrations(solved, outcomes, task.format)


def aim(land: Callable[[Knobs], Points], targets: Points, tolerance: float = 4e-3) -> Knobs:
    """Newton's method on reach and direction, all throws at once, differences of 0.03 rad."""
    knobs = np.column_stack([np.zeros(len(targets)), np.arctan2(targets[:, 1], targets[:, 0])])
    for _ in range(12):
        miss = land(knobs) - targets
        if np.linalg.norm(miss, axis=1).max() < tolerance:
            return knobs
        slopes = np.stack(
            [(land(knobs + step) - targets - miss) / 0.03 for step in 0.03 * np.eye(2)], axis=-1
        )
        knobs = knobs - np.clip(np.linalg.solve(slopes, miss[..., None])[..., 0], -0.1, 0.1)
    raise RuntimeError(f"no throw lands within {tolerance} m of {targets.tolist()}")


if __name__ == "__main__":
    write_sets(make, (*DESIGNED, *DRAWN), "basketball", __doc__)
    on_fr3 = BasketballFR3()
    write_sets(lambda name: make(name, task=on_fr3), DESIGNED, "basketball_fr3", __doc__)
