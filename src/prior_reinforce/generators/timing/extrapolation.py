"""Extrapolation of plans as functions of time beyond the recorded frames.

A plan that rests at an end is held there; another one continues with the velocity of its last
frames. So no rest is needed at either end, and nothing is cut off. Ours.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.interpolation import interp_columns
from prior_reinforce.plans.speeds import END_SPEED

_SLOPE_FRAMES = 3
"""Steps at an end over which its velocity is averaged. Ours: 2 and 6 move plans that are cut in
mid-swing by 0.4 and 1 % of a range, and hit as often."""


class ExtrapolatedPlans:
    """Plans at any time: recorded at whole frames, on a cubic spline between them.

    Channels that jump are linear between frames, so that they never overshoot, and held outside.
    """

    def __init__(
        self, plans: Plans, jumps: Bool[np.ndarray, " D"], speeds: Float[np.ndarray, "n H"]
    ) -> None:
        """Fit the splines; plans rest at ends where `speeds` are low, `jumps` are held."""
        from scipy.interpolate import make_interp_spline

        horizon = plans.shape[1]
        clock, n = np.arange(horizon, dtype=float), min(_SLOPE_FRAMES, horizon - 1)
        self._plans, self._jumps = plans, np.flatnonzero(jumps)
        self._splines = [make_interp_spline(clock, plan, k=min(3, horizon - 1)) for plan in plans]
        moving = speeds[:, [0, -1]] > END_SPEED * speeds.max(axis=1, keepdims=True)
        slopes = np.stack([plans[:, n] - plans[:, 0], plans[:, -1] - plans[:, -1 - n]]) / n
        self._slopes = slopes * moving.T[:, :, None] * ~jumps

    def __call__(self, i: int, t: Float[np.ndarray, " L"]) -> Float[np.ndarray, "L D"]:
        """Return plan i at times t, in frames."""
        last = self._plans.shape[1] - 1
        before, after = self._slopes[:, i]
        outside = np.minimum(t, 0.0)[:, None] * before + np.maximum(t - last, 0.0)[:, None] * after
        inside = np.clip(t, 0.0, last)
        values = self._splines[i](inside)
        jumps = self._jumps
        values[:, jumps] = interp_columns(inside, np.arange(last + 1), self._plans[i][:, jumps])
        whole = inside == np.floor(inside)
        values[whole] = self._plans[i, inside[whole].astype(int)]
        return np.asarray(values + outside)
