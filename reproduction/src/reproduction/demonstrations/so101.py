"""Make the prior sets of SO-101 Shot.

    python -m reproduction.demonstrations.so101

As for Basketball Shot: one motion pattern, with differences such as a person's repetitions have,
solved in simulation for the reach and the direction that land the ball near a designed point. The
pattern is the smoothest of 600 throws that were drawn at random (start pose with the scoop upright,
travel of three joints, duration; seed 0) within the servos' speed: slowed by 30 % it still flies.
"""

from __future__ import annotations

import numpy as np
from scipy.special import betainc

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.so101 import SO101Shot
from reproduction.demonstrations import write_sets
from reproduction.demonstrations.basketball import Knobs, ThrowVariation, aim

HORIZON = 75
"""Frames: 1.5 s."""
READY = np.array([0.0, -0.56, -0.54, -0.50, 0.0])
"""Posture before the throw, in [rad]: the arm leans back, the scoop opens upwards."""
SWING = np.array([0.0, 0.76, -0.53, 0.68, 0.0])
"""Travel of each joint in a throw to the middle of the region, in [rad]."""
REACH = 1.5
"""Relative change of the swing with reach, in [1/rad]."""
DURATION = 0.64
"""Of the throw at tempo 1, in [s]: its fastest joint is then at half of the servos' speed."""
DESIGNED = {
    "A": ((0.39, -0.13), (0.40, 0.12), (0.50, -0.12), (0.50, 0.13), (0.43, -0.03), (0.47, 0.03)),
    "B": ((0.40, 0.02), (0.41, -0.14), (0.42, 0.13), (0.51, -0.09), (0.49, 0.13), (0.46, -0.02)),
}
"""Where the six throws of each set are to land, (x, y) in [m]."""
SEEDS = {"A": 1, "B": 2}


def make(name: str) -> Demonstrations:
    """Make the prior set `name` ("A" or "B"), the same every time on the same machine."""
    size = ThrowVariation(start=(0.04, 0.60))
    task = SO101Shot()
    rng = np.random.default_rng(SEEDS[name])
    designed = np.array(DESIGNED[name])
    n, dt = len(designed), task.format.dt
    starts = rng.permutation(np.linspace(*size.start, n))
    tempi = 1.0 + rng.normal(0.0, size.tempo, n)
    amplitudes = 1.0 + rng.normal(0.0, size.amplitude, (n, 5))
    postures = READY + rng.normal(0.0, size.posture, (n, 5)) * (np.arange(5) > 0)

    def plans(knobs: Knobs) -> Plans:
        reach, direction = knobs[:, :1], knobs[:, 1:]
        travel = (1.0 + REACH * reach) * amplitudes * SWING
        part = (np.arange(HORIZON) * dt - starts[:, None]) * tempi[:, None] / DURATION
        course = betainc(3, 3, np.clip(part, 0.0, 1.0))  # minimum jerk
        # Positive is to the right for this joint.
        turned = postures - direction * np.eye(5)[0]
        return turned[:, None] + course[:, :, None] * travel[:, None]

    def land(knobs: Knobs) -> Points:
        return np.array([rollout.outcome for rollout in task.rollout(plans(knobs), None)])

    solved = plans(aim(land, designed))
    outcomes = np.array([rollout.outcome for rollout in task.rollout(solved, rng)])
    return Demonstrations(solved, outcomes, task.format)


if __name__ == "__main__":
    write_sets(make, DESIGNED, "so101", __doc__)
