"""What the zoo's tasks are computed from: arms, releases, flight and sliding.

All are of one execution; lengths in [m], times in [s], angles in [rad], z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, CubicSpline

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
    """Position of the first joint, in [m]."""

    @classmethod
    def straight(cls, axes: str, *lengths: float, base: float = 0.0) -> Arm:
        """An arm whose links all lie along z, of these lengths, on a base of this height [m]."""
        return cls(axes, tuple((0.0, 0.0, length) for length in lengths), (0.0, 0.0, base))

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


def _turn(vectors: np.ndarray, axis: str, angles: np.ndarray) -> np.ndarray:
    # Shapes (*t, 3) and (*t,): its callers', which are checked; it is called for every joint.
    i, j = _PLANES[axis]
    cos, sin = np.cos(angles), np.sin(angles)
    turned = vectors.copy()
    turned[..., i] = cos * vectors[..., i] - sin * vectors[..., j]
    turned[..., j] = sin * vectors[..., i] + cos * vectors[..., j]
    return turned


def moving(path: Float[np.ndarray, "t ..."], dt: float) -> CubicSpline:
    """A path through all frames, whose derivatives are velocity and acceleration."""
    return CubicSpline(np.arange(len(path)) * dt, path)


def finely(path: CubicSpline) -> Float[np.ndarray, " t"]:
    """Times of a path, eight a frame, among which a release is looked for."""
    return np.linspace(path.x[0], path.x[-1], _PER_FRAME * (len(path.x) - 1) + 1)


def first_passage(values: Float[np.ndarray, " t"], level: float, dt: float) -> float | None:
    """When values first pass a level upwards, by linear interpolation; None if they never do."""
    up = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    if not up.size:
        return None
    i = int(up[0])
    return dt * (i + float((level - values[i]) / (values[i + 1] - values[i])))


def lift_off(hand: CubicSpline, normals: Places) -> float | None:
    """When what lies in the hand leaves it: the hand no longer presses on it.

    The force on it along the hand's normal n, which points to it and is given at each of the path's
    frames, is m (a + g z) n, with a the hand's acceleration. None if it stays, or did not lie in
    the hand at first.
    """
    fine = finely(hand)
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


def landing(start: Place, velocity: Place) -> Float[np.ndarray, "2"] | None:
    """Where a parabola comes down to z = 0, (x, y) in [m]; None if it stays below."""
    landed = flight(start, velocity)
    return None if landed is None else landed[0][:2]


def on_parabola(start: Place, velocity: Place, time: float) -> Place:
    """Place after a time of free flight, in [m]."""
    return start + velocity * time - np.array([0.0, 0.0, GRAVITY * time**2 / 2.0])


def flight_in_air(start: Place, velocity: Place, drag: float, step: float = 0.01) -> Place | None:
    """Where a ball comes down to z = 0 against quadratic drag; None if it begins below.

    It starts in [m] and [m/s]; drag is deceleration over speed squared, in [1/m], and `step` the
    classical Runge-Kutta rule's, in [s].
    """
    if start[2] <= 0.0:
        return None

    def slope(state: np.ndarray) -> np.ndarray:  # shape (6,); not checked, as it is called so often
        v = state[3:]
        slower = -drag * math.sqrt(float(v @ v)) * v
        slower[2] -= GRAVITY
        return np.concatenate([v, slower])

    state = np.concatenate([start, velocity])
    while True:
        a = slope(state)
        b = slope(state + step / 2.0 * a)
        c = slope(state + step / 2.0 * b)
        d = slope(state + step * c)
        after = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        if after[2] < 0.0:
            # Between two steps the height is a cubic in all but the sixth digit.
            times = np.array([0.0, step])
            fall = CubicHermiteSpline(times, [state[2], after[2]], [state[5], after[5]])
            down = max(float(t) for t in fall.solve(0.0, extrapolate=False))
            along = CubicHermiteSpline(times, [state[:3], after[:3]], [state[3:], after[3:]])
            return np.asarray(along(down))
        state = after


def hung(pivot: CubicSpline, length: float, until: float, step: float) -> tuple[Place, Place]:
    """Place and velocity of a mass that hangs on a taut string from a moving pivot, from rest.

    With r from the pivot and G = g - a the gravity that the pivot feels, r'' = G + s r, where s
    keeps |r| the string's length [m]: s = -(|r'|^2 + G r) / |r|^2. It is looked at `until`, in [s];
    the classical Runge-Kutta rule takes steps of about `step`, in [s].
    """
    n = max(math.ceil(until / step), 1)
    h = until / n
    felt = -pivot(np.linspace(0.0, until, 2 * n + 1), 2)
    felt[:, 2] -= GRAVITY
    rows: list[tuple[float, float, float]] = [tuple(row) for row in felt.tolist()]
    r, v = (0.0, 0.0, -length), (0.0, 0.0, 0.0)
    for i in range(n):
        first = _pulled(r, v, rows[2 * i])
        r2, v2 = _on(r, v, h / 2), _on(v, first, h / 2)
        second = _pulled(r2, v2, rows[2 * i + 1])
        r3, v3 = _on(r, v2, h / 2), _on(v, second, h / 2)
        third = _pulled(r3, v3, rows[2 * i + 1])
        r4, v4 = _on(r, v3, h), _on(v, third, h)
        fourth = _pulled(r4, v4, rows[2 * i + 2])
        r = _on(r, _weighed(v, v2, v3, v4), h)
        v = _on(v, _weighed(first, second, third, fourth), h)
    return pivot(until) + r, pivot(until, 1) + v


_Triple = tuple[float, float, float]


def _on(a: _Triple, b: _Triple, h: float) -> _Triple:
    return a[0] + h * b[0], a[1] + h * b[1], a[2] + h * b[2]


def _weighed(a: _Triple, b: _Triple, c: _Triple, d: _Triple) -> _Triple:
    x, y, z = ((p + 2 * q + 2 * r + s) / 6 for p, q, r, s in zip(a, b, c, d, strict=True))
    return x, y, z


def _pulled(r: _Triple, v: _Triple, felt: _Triple) -> _Triple:
    squared = r[0] ** 2 + r[1] ** 2 + r[2] ** 2
    speed = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    s = -(speed + felt[0] * r[0] + felt[1] * r[1] + felt[2] * r[2]) / squared
    return _on(felt, r, s)
