"""Make Curling's prior sets: `python -m reproduction.demonstrations.curling`.

As in the paper, the demonstrations are tele-operated. The operator sets the bar behind the stone,
turns it to the direction in which the stone shall go, and pushes in one stroke while tipping the
hand forward; how fast is a matter of feel. Each is executed once, with the disturbances of any
execution, and where that stone stopped is its outcome, near the place that was aimed at or not.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.curling import FRICTION, STONE_RADIUS, STONE_START, Curling
from prior_reinforce.simulation.tasks.inverse_kinematics import NOMINAL, joint_paths
from reproduction.demonstrations import DRAWN, seed_and_aims, warps, write_sets
from reproduction.demonstrations.teleoperation import Teleoperation, record
from reproduction.following import warped

HORIZON = 140
"""Frames, as in the paper."""
GRAVITY = 9.81
BAR_RADIUS = 0.01
"""As in `curling.xml`, in [m]."""
BAR_HEIGHT = 0.015
"""Height of the bar's axis above the table, the middle of the stone's side, in [m]."""
HANDLE = 0.30
"""From the flange to the bar's axis, as in `curling.xml`, in [m]."""
STROKE_TIME = 0.58
"""Duration of a push at tempo 1, in [s]."""
CARRIED_ON = 0.02
"""How far past the middle of the stroke the bar carries a stone, about, in [m]."""
TIPPED_BACK, TIPPED_FORWARD = 0.65, 0.05
"""Tilt of the handle before and after the stroke, the bar behind the hand at first, in [rad].
Tipping the hand lets joint 6 help: at a fixed attitude a push of 1 m/s breaks joint 4's limit."""
AIMED = {
    "A": ((0.79, -0.19), (0.80, 0.18), (1.02, -0.20), (1.03, 0.20), (0.87, -0.03), (0.98, 0.05)),
    "B": ((0.78, 0.03), (0.84, -0.20), (0.83, 0.20), (1.03, -0.14), (1.01, 0.19), (0.92, -0.02)),
}
"""Where the operator aims, (x, y) in [m]."""
SEEDS = {"A": 1, "B": 2}
_STEADY = np.zeros(1)


@dataclass(frozen=True)
class PushVariation:
    """How an operator's pushes differ; standard deviations unless said otherwise; ours."""

    start: tuple[float, float] = (0.10, 0.68)
    """Range of start times, in [s]: a third of the horizon, evenly spread over a set."""
    tempo: float = 0.03
    """Relative difference of a stroke's duration, at the same speed: it gets shorter or longer."""
    gap: tuple[float, float] = (0.015, 0.025)
    """Range of the gap between bar and stone at first, in [m]."""
    aside: float = 0.003
    """How far from its middle the bar meets the stone, in [m]."""
    tilt: float = 0.02
    """Tilt of the handle, through the whole stroke, in [rad]."""
    hand: Teleoperation = field(default_factory=Teleoperation)
    """Tremor, tracker and follower."""


def push(
    heading: float,
    speed: float,
    start: float,
    duration: float,
    gap: float,
    aside: float,
    tilt: float,
    dt: float,
    horizon: int = HORIZON,
    warp: Float[np.ndarray, " w"] = _STEADY,
) -> Float[np.ndarray, "H 6"]:
    """Flange poses that carry the bar through one push, as meant.

    Args:
        heading: Direction of the push from the x axis, in [rad].
        speed: Largest speed of the bar, in [m/s].
        start: When the stroke begins, in [s].
        duration: Of the stroke, in [s].
        gap: Between bar and stone at first, in [m].
        aside: From the stone's middle to the bar's, to the left, in [m].
        tilt: Added to the handle's tilt throughout, in [rad].
        dt: Time between frames, in [s].
        horizon: H, frames.
        warp: Of its pace; see `following.warped`.
    """
    part = np.clip((np.arange(horizon) * dt - start) / duration, 0.0, 1.0)
    part = minimum_jerk(warped(part, warp))
    length = speed * duration / 1.875  # a minimum-jerk stroke's peak is 15/8 of its mean speed
    forward = np.array([np.cos(heading), np.sin(heading), 0.0])
    left = np.array([-np.sin(heading), np.cos(heading), 0.0])
    along = length * part - (STONE_RADIUS + BAR_RADIUS + gap)
    bar = np.append(STONE_START, BAR_HEIGHT) + along[:, None] * forward + aside * left
    angle = (TIPPED_BACK + (TIPPED_FORWARD - TIPPED_BACK) * part + tilt)[:, None]
    down = np.array([0.0, 0.0, -1.0])
    handle = np.cos(angle) * down - np.sin(angle) * forward
    attitudes = np.stack([np.cross(-left, handle), np.tile(-left, (horizon, 1)), handle], axis=-1)
    return np.hstack([bar - HANDLE * handle, to_rotation_vector(attitudes)])


def to_rotation_vector(attitudes: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 3"]:
    """Rotation vectors in [rad] from flange attitudes: undoes `to_matrix`."""
    return Rotation.from_matrix(attitudes @ NOMINAL.T).as_rotvec()


def speed_for(distance: float) -> float:
    """Speed of a push in [m/s] that an operator feels right for a stone to go so far, in [m].

    Half the stroke, then the slide: v STROKE_TIME / 3.75 + CARRIED_ON + v^2 / (2 mu g).
    """
    a, b = 0.5 / (FRICTION * GRAVITY), STROKE_TIME / 3.75
    return float((np.sqrt(b * b + 4 * a * (distance - CARRIED_ON)) - b) / (2 * a))


def make(name: str) -> Demonstrations:
    """Make the prior set `name` (A, B or drawn), the same every time on the same machine."""
    size = PushVariation()
    task = Curling()
    seed, aimed = seed_and_aims(name, SEEDS, AIMED)
    rng, dt = np.random.default_rng(seed), task.format.dt
    recorded = []
    starts = rng.permutation(np.linspace(*size.start, len(aimed)))
    for aim, start, warp in zip(aimed, starts, warps(name, len(aimed)), strict=True):
        way = aim - STONE_START
        meant = push(
            heading=float(np.arctan2(way[1], way[0])),
            speed=speed_for(float(np.linalg.norm(way))),
            start=float(start),
            duration=STROKE_TIME * (1.0 + rng.normal(0.0, size.tempo)),
            gap=rng.uniform(*size.gap),
            aside=rng.normal(0.0, size.aside),
            tilt=rng.normal(0.0, size.tilt),
            dt=dt,
            warp=warp,
        )
        recorded.append(record(meant, dt, size.hand, rng))
    plans = np.round(joint_paths(np.array(recorded), dt), 6)  # as the arm's encoders would
    outcomes = np.array([rollout.outcome for rollout in task.rollout(plans, rng)])
    return Demonstrations(plans, outcomes, task.format)


if __name__ == "__main__":
    write_sets(make, (*AIMED, *DRAWN), "curling", __doc__)
