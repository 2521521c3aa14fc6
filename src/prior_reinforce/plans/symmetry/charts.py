"""Charts of outcomes: coordinates in which a symmetry is an addition.

    z = chart.to(r)    r = chart.back(z)

A rotation about an axis adds to the bearing, a factor on the distance to its logarithm, a shift to
x and y. Components beyond those that a chart names stay as they are (a time of arrival).

    r  outcomes       in their own units, shape (..., k)
    z  coordinates    in the chart's units, shape (..., k)
"""

from __future__ import annotations

import msgspec
import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Points

Outcomes = Float[np.ndarray, "*n k"]
Jacobian = Float[np.ndarray, "*n k k"]

_LEAST = 1e-6
"""Least distance from the axis, [m]: a point on it has no bearing and no logarithm."""


class Chart(msgspec.Struct, frozen=True):
    """Interface and identity chart; members are data, so that they can be saved."""

    def to(self, outcomes: Outcomes) -> Outcomes:
        """Return z of outcomes."""
        return np.array(outcomes, dtype=np.float64)

    def back(self, z: Outcomes) -> Outcomes:
        """Return the outcomes of z."""
        return np.array(z, dtype=np.float64)

    def jacobian(self, z: Outcomes) -> Jacobian:
        """Return dr/dz, rows the components of r, columns those of z."""
        return np.broadcast_to(np.eye(z.shape[-1]), (*z.shape, z.shape[-1])).copy()

    def units(self, units: tuple[str, ...]) -> tuple[str, ...]:
        """Return the units of z for outcomes in these units."""
        return units

    def around(self, outcomes: Points) -> Self:
        """Return the chart with its discontinuity away from these outcomes."""
        return self


class Polar(Chart, frozen=True, tag="polar"):
    """(ln distance, bearing) of x and y about a centre; [1] and [rad].

    The bearing jumps by a turn where it is opposite to `ahead`.
    """

    centre: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the axis, in the outcomes' units."""
    ahead: float = 0.0
    """Central bearing, in [rad]: the bearing in z is within half a turn of it."""

    def to(self, outcomes: Outcomes) -> Outcomes:
        """See `Chart.to`."""
        out = super().to(outcomes)
        x, y = out[..., 0] - self.centre[0], out[..., 1] - self.centre[1]
        out[..., 0] = np.log(np.maximum(np.hypot(x, y), _LEAST))
        cos, sin = np.cos(self.ahead), np.sin(self.ahead)
        out[..., 1] = self.ahead + np.arctan2(cos * y - sin * x, cos * x + sin * y)
        return out

    def back(self, z: Outcomes) -> Outcomes:
        """See `Chart.back`."""
        out = super().back(z)
        distance = np.exp(z[..., 0])
        out[..., 0] = self.centre[0] + distance * np.cos(z[..., 1])
        out[..., 1] = self.centre[1] + distance * np.sin(z[..., 1])
        return out

    def jacobian(self, z: Outcomes) -> Jacobian:
        """See `Chart.jacobian`."""
        out = super().jacobian(z)
        x, y = np.exp(z[..., 0]) * np.array([np.cos(z[..., 1]), np.sin(z[..., 1])])
        out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = x, -y, y, x
        return out

    def units(self, units: tuple[str, ...]) -> tuple[str, ...]:
        """See `Chart.units`."""
        return ("1", "rad", *units[2:])

    def around(self, outcomes: Points) -> Self:
        """See `Chart.around`: ahead is the direction of the outcomes' mean unit vector."""
        away = outcomes[:, :2] - self.centre
        x, y = (away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), _LEAST)).sum(axis=0)
        return msgspec.structs.replace(self, ahead=float(np.arctan2(y, x)))


class LogDistance(Chart, frozen=True, tag="log-distance"):
    """ln of the first component, which is positive; [1]."""

    def to(self, outcomes: Outcomes) -> Outcomes:
        """See `Chart.to`."""
        out = super().to(outcomes)
        out[..., 0] = np.log(np.maximum(out[..., 0], _LEAST))
        return out

    def back(self, z: Outcomes) -> Outcomes:
        """See `Chart.back`."""
        out = super().back(z)
        out[..., 0] = np.exp(out[..., 0])
        return out

    def jacobian(self, z: Outcomes) -> Jacobian:
        """See `Chart.jacobian`."""
        out = super().jacobian(z)
        out[..., 0, 0] = np.exp(z[..., 0])
        return out

    def units(self, units: tuple[str, ...]) -> tuple[str, ...]:
        """See `Chart.units`."""
        return ("1", *units[1:])


class Cartesian(Chart, frozen=True, tag="cartesian"):
    """Outcomes as they are."""


AnyChart = Polar | LogDistance | Cartesian
