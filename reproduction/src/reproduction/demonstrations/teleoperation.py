"""How a tele-operated motion differs from the one that was meant: hand, tracker and follower.

The paper's operators led the arm with a hand-held virtual-reality controller. A hand trembles
slowly and turns while it does, the tracker reports at its own rate and resolution, and the arm
follows what was reported through a low-pass filter. All three are modelled on pose paths; the
figures are ours, of the order that such trackers and hands have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.plans.interpolation import minimum_jerk
from reproduction.following import follow

_Poses = Float[np.ndarray, "H 6"]


@dataclass(frozen=True)
class Teleoperation:
    """The chain from hand to recorded pose."""

    tremor: float = 0.0008
    """Standard deviation of the hand's drift along each axis, in [m]."""
    tremor_angle: float = 0.002
    """Standard deviation of the hand's turning about each axis, in [rad]."""
    tremor_band: tuple[float, float] = (0.3, 1.5)
    """Frequencies of the drift, in [Hz]; the fast tremor of a hand is filtered away."""
    resolution: float = 0.0002
    """Step of the tracker's positions, in [m]."""
    resolution_angle: float = 0.0005
    """Step of the tracker's angles, in [rad]."""
    bandwidth: float = 6.0
    """Bandwidth of the follower, a critically damped filter of second order, in [Hz]."""


def record(meant: _Poses, dt: float, hand: Teleoperation, rng: np.random.Generator) -> _Poses:
    """Pose path that is recorded when an operator means another one.

    Args:
        meant: Pose path: position in [m], rotation vector in [rad].
        dt: Time between frames, which is the tracker's period too, in [s].
        hand: The chain.
        rng: Of the tremor.
    """
    amplitude = np.repeat([hand.tremor, hand.tremor_angle], 3)
    step = np.repeat([hand.resolution, hand.resolution_angle], 3)
    times = np.arange(len(meant)) * dt
    shaken = meant + amplitude * _tremor(times, hand.tremor_band, rng) * _engaged(times)
    return follow(np.round(shaken / step) * step, dt, hand.bandwidth)


def _engaged(times: Float[np.ndarray, " H"]) -> Float[np.ndarray, "H 1"]:
    """How far the hand leads the arm: nothing, then all within 0.2 s, and back.

    The arm stands still before the operator takes hold of it and after letting go.
    """
    ease, still = 0.2, 0.1
    rising = np.clip(times / ease, 0.0, 1.0)
    falling = np.clip((times[-1] - still - times) / ease, 0.0, 1.0)
    return (minimum_jerk(rising) * minimum_jerk(falling))[:, None]


def _tremor(
    times: Float[np.ndarray, " H"], band: tuple[float, float], rng: np.random.Generator
) -> _Poses:
    """Slow random drifts of unit variance: sums of four sines each."""
    n_sines = 4
    frequencies = rng.uniform(*band, (n_sines, 6))
    phases = rng.uniform(0.0, 2 * np.pi, (n_sines, 6))
    waves = np.sin(2 * np.pi * frequencies * times[:, None, None] + phases)
    return waves.sum(axis=1) * np.sqrt(2.0 / n_sines)
