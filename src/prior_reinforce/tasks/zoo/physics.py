"""What the zoo's tasks are computed from: arms, releases, flight and sliding.

All are of one execution; lengths in [m], times in [s], angles in [rad], z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

GRAVITY = 9.81
"""In [m/s^2]."""
_PLANES = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}
_PER_FRAME = 8
"""How finely a release is looked for; it is then interpolated. Ours."""

Place = Float[np.ndarray, "3"]
"""A position in [m], or a velocity in [m/s]."""
Places = Float[np.ndarray, "*t 3"]


@dataclass(frozen=True)
class Arm:
    """A serial arm: each joint turns about an axis of its own frame, and bears a link."""

    axes: str
    """`x`, `y` or `z` for each joint from the base; positive about y leans z towards x."""
    links: tuple[tuple[float, float, float], ...]
    """From each joint to the next, the last to the hand, in the turned frame, in [m]."""
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the first joint, in [m]."""

    def hand(self, joints: Float[np.ndarray, "*t D"]) -> Places:
        """Where the hand is, in [m]."""
        point = np.zeros((*joints.shape[:-1], 3))
        for i in reversed(range(len(self.axes))):
            point = _turn(point + self.links[i], self.axes[i], joints[..., i])
        return point + self.base

    def direction(
        self, joints: Float[np.ndarray, "*t D"], own: tuple[float, float, float]
    ) -> Places:
        """Where a direction of the hand's own frame points."""
        vector = np.broadcast_to(np.array(own), (*joints.shape[:-1], 3))
        for i in reversed(range(len(self.axes))):
            vector = _turn(vector, self.axes[i], joints[..., i])
        return vector


def _turn(vectors: Places, axis: str, angles: Float[np.ndarray, "*t"]) -> Places:
    i, j = _PLANES[axis]
    cos, sin = np.cos(angles), np.sin(angles)
    turned = vectors.copy()
    turned[..., i] = cos * vectors[..., i] - sin * vectors[..., j]
    turned[..., j] = sin * vectors[..., i] + cos * vectors[..., j]
    return turned


def moving(path: Float[np.ndarray, "t ..."], dt: float) -> CubicSpline:
    """A path through all frames, whose derivatives are velocity and acceleration."""
    return CubicSpline(np.arange(len(path)) * dt, path)


def first_passage(values: Float[np.ndarray, " t"], level: float, dt: float) -> float | None:
    """When values first pass a level upwards, by linear interpolation; None if they never do."""
    up = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    if not up.size:
        return None
    i = int(up[0])
    return dt * (i + float((level - values[i]) / (values[i + 1] - values[i])))


def lift_off(hand: CubicSpline, normals: Places) -> float | None:
    """When what lies in the hand leaves it: the hand no longer presses on it.

    The force on it along the hand's normal n is m (a + g z) n, with a the hand's acceleration.

    Args:
        hand: Path of the hand.
        normals: The hand's normal n at each of the path's frames, from the hand to the object.

    Returns:
        The time; None if it stays, or did not lie in the hand at first.
    """
    fine = np.linspace(hand.x[0], hand.x[-1], _PER_FRAME * (len(hand.x) - 1) + 1)
    pressed = hand(fine, 2) + np.array([0.0, 0.0, GRAVITY])
    force = np.sum(pressed * CubicSpline(hand.x, normals)(fine), axis=1)
    if force[0] <= 0.0:
        return None
    return first_passage(-force, 0.0, fine[1] - fine[0])


def flight(start: Place, velocity: Place, height: float = 0.0) -> tuple[Place, float] | None:
    """Where a parabola comes down to a height, and after what time; None if it stays below."""
    rise = velocity[2] ** 2 + 2.0 * GRAVITY * (start[2] - height)
    if rise < 0.0:
        return None
    time = float((velocity[2] + math.sqrt(rise)) / GRAVITY)
    return on_parabola(start, velocity, time), time


def on_parabola(start: Place, velocity: Place, time: float) -> Place:
    """Place after a time of free flight, in [m]."""
    return start + velocity * time - np.array([0.0, 0.0, GRAVITY * time**2 / 2.0])
