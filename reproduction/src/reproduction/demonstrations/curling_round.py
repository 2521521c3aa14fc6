"""Make the prior sets of `curling-round`: the bar goes round the stone, to its left or its right.

    python -m reproduction.demonstrations.curling_round

The hand begins beyond the stone and has to get behind it before it can push. Some go round by the
left, some by the right, in no order; half-way between the two the bar sweeps the stone away. Ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.curling import STONE_START, CurlingRound
from prior_reinforce.simulation.tasks.inverse_kinematics import joint_paths
from reproduction.demonstrations import write_sets
from reproduction.demonstrations.curling import (
    STROKE_TIME,
    PushVariation,
    push,
    speed_for,
)
from reproduction.demonstrations.teleoperation import record

HORIZON = 320
"""Frames: 4 s."""
BEYOND, ASIDE = 0.15, 0.165
"""How far ahead of the push's start the bar begins, and how far aside it passes the stone, in [m]:
4 cm more than the half widths of bar and stone. Farther ahead, the arm is nearly stretched."""
ROUND_TIME = 2.4
"""Of the way round at tempo 1, in [s]."""
SEEDS = {"A": 2, "B": 12}
"""Ours: the first two from 1 on whose outcomes span four fifths of the region."""
N = 12


def way_round(times: Float[np.ndarray, " H"], side: float) -> Float[np.ndarray, "H 2"]:
    """Where the bar is beside the push's start on its way round, (x, y) in [m].

    Args:
        times: Since the way began, as parts of `ROUND_TIME`.
        side: 1 by the left, -1 by the right.
    """
    ahead = BEYOND * (1.0 - minimum_jerk((times - 0.25) / 0.5))
    aside = minimum_jerk(times / 0.4) - minimum_jerk((times - 0.6) / 0.4)
    return np.column_stack([ahead, side * ASIDE * aside])


def make(name: str) -> Demonstrations:
    """Make the prior set `name` ("A" or "B"), the same every time on the same machine."""
    size = replace(PushVariation(), gap=(0.045, 0.055), start=(0.05, 0.45))
    task, rng = CurlingRound(), np.random.default_rng(SEEDS[name])
    dt = task.format.dt
    low, high = task.region
    grid = (np.indices((4, 3)).reshape(2, -1).T + rng.uniform(0.15, 0.85, (N, 2))) / (4, 3)
    aimed = rng.permutation(low + grid * (high - low))
    starts = rng.permutation(np.linspace(*size.start, N))
    sides = rng.permutation(np.repeat([-1.0, 1.0], N // 2))
    recorded = []
    for aim, start, side in zip(aimed, starts, sides, strict=True):
        way, tempo = aim - STONE_START, 1.0 + rng.normal(0.0, size.tempo)
        meant = push(
            heading=float(np.arctan2(way[1], way[0])),
            speed=speed_for(float(np.linalg.norm(way))),
            start=float(start) + ROUND_TIME * tempo,
            duration=STROKE_TIME * (1.0 + rng.normal(0.0, size.tempo)),
            gap=rng.uniform(*size.gap),
            aside=rng.normal(0.0, size.aside),
            tilt=rng.normal(0.0, size.tilt),
            dt=dt,
            horizon=HORIZON,
        )
        meant[:, :2] += way_round((np.arange(HORIZON) * dt - start) / ROUND_TIME / tempo, side)
        recorded.append(record(meant, dt, size.hand, rng))
    plans = np.round(joint_paths(np.array(recorded), dt), 6)
    outcomes = np.array([rollout.outcome for rollout in task.rollout(plans, rng)])
    return Demonstrations(plans, outcomes, task.format)


if __name__ == "__main__":
    write_sets(make, SEEDS, "curling_round", __doc__)
