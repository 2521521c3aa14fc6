"""Plans as the network sees them: codes of a few numbers a dimension, scaled to [-1, 1].

A smooth dimension is coded by the control points of a cubic B-spline, about one for every four
frames; one that a spline cannot follow (a gripper that opens, recorded jitter) by its frames,
folded so that several consecutive frames share one position of the code. Which it is, is decided
for each dimension when the codec is fitted, from the demonstrations alone. A dimension that is one
number a plan is coded by that number at every position, and decoded by their mean.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.timing import resting_dimensions

Representation = Literal["splines", "frames"]
"""Splines where they fit, or frames for every dimension."""
Kind = Literal["spline", "frames", "number"]
"""How one dimension is coded: by control points, by frames, or by one number a plan."""
Codes = Float[np.ndarray, "n C T"]
"""Coded plans: C numbers at each of T positions in time, those of demonstrations in [-1, 1]."""
_Values = Float[np.ndarray, "n H"]
"""One dimension of some plans."""
_Matrix = Float[np.ndarray, "_ _"]

_DEGREE = 3
_LARGEST_SPLINE_RESIDUAL = 2e-3
"""A dimension is smooth if its spline misses it by at most this fraction of its range, rms.

Ours: minimum-jerk throws are missed by 1e-5 to 1e-4, a step by 3e-2 or more; 2e-3 of a swing of
1.2 rad is 2.4 mrad, about what moves a landing point by its measuring noise."""
_MOST_LEVELS = 4
"""A dimension that is not smooth and takes no more values than these is a switch."""
_TIED = 3
"""Equal control points at a resting end: velocity and acceleration vanish there."""
_STIFFNESS = 0.3
"""Weight of the control points' third differences (see `_smoother`). Ours: the throws' points come
back to 1e-5, and an error of the network that alternates from point to point moves the plan's
acceleration by a third or less of what it did."""
_CONSTANT = 1e-9
"""A dimension whose range is below this, relative to its values, is constant."""

_SETTINGS = ("horizon", "length", "kinds", "rest_start", "rest_end", "levels")
"""What a codec is beside its two arrays."""


@dataclass(frozen=True, eq=False)
class PlanCodec:
    """Turns plans of one shape into codes and back; made by `fit`."""

    horizon: int
    """H."""
    length: int
    """T."""
    kinds: tuple[Kind, ...]
    """For each of the D dimensions, how it is coded."""
    rest_start: tuple[bool, ...]
    """For each dimension: every demonstration starts at rest."""
    rest_end: tuple[bool, ...]
    """For each dimension: every demonstration ends at rest."""
    levels: tuple[tuple[float, ...], ...]
    """For each dimension: the values of a switch; empty where it is none."""
    plan_range: Float[np.ndarray, "2 D"]
    """Least and greatest value a dimension may take: the demonstrations' range, widened by the
    margin."""
    code_range: Float[np.ndarray, "2 C"]
    """The values that are scaled to -1 and 1."""

    @classmethod
    def fit(
        cls,
        plans: Plans,
        *,
        per_plan: Sequence[bool] | None = None,
        representation: Representation,
        frames_per_point: int,
        length_multiple: int,
        margin: float,
    ) -> Self:
        """Choose a code for plans like these.

        Args:
            plans: Of the demonstrations.
            per_plan: Which of the D dimensions are one number a plan; none by default.
            representation: `splines` where they fit, or `frames` for every dimension.
            frames_per_point: Frames for each control point.
            length_multiple: T will be a multiple of this.
            margin: How far generated plans may leave the demonstrated range of a dimension, as a
                fraction of that range.
        """
        _, horizon, action_dim = plans.shape
        if representation == "frames":
            length = math.ceil(horizon / length_multiple) * length_multiple
        else:
            length = max(1, round(horizon / frames_per_point / length_multiple)) * length_multiple
        starts, ends = resting_dimensions(plans)
        splines = representation == "splines" and _DEGREE < length < horizon
        kinds: list[Kind] = []
        for d in range(action_dim):
            if per_plan is not None and per_plan[d]:
                kinds.append("number")
            else:
                fits = splines and _is_smooth(plans[:, :, d], length, starts[d], ends[d])
                kinds.append("spline" if fits else "frames")
        low, high = plans.min(axis=(0, 1)), plans.max(axis=(0, 1))
        slack = margin * (high - low)
        raw = cls(
            horizon=horizon,
            length=length,
            kinds=tuple(kinds),
            rest_start=starts,
            rest_end=ends,
            levels=tuple(
                _levels(plans[:, :, d]) if kind == "frames" else () for d, kind in enumerate(kinds)
            ),
            plan_range=np.stack([low - slack, high + slack]),
            code_range=np.array([[-1.0], [1.0]]),
        )
        per_dimension = [raw._code(plans[:, :, d], d) for d in range(action_dim)]
        ranges = [
            np.repeat([[code.min()], [code.max()]], code.shape[1], axis=1) for code in per_dimension
        ]
        return replace(raw, code_range=np.concatenate(ranges, axis=1))

    @property
    def channels(self) -> int:
        """C, the numbers of a code at one position."""
        return self.code_range.shape[1]

    def encode(self, plans: Plans) -> Codes:
        """Code plans; demonstrations land in [-1, 1]."""
        codes = np.concatenate(
            [self._code(plans[:, :, d], d) for d in range(plans.shape[2])], axis=1
        )
        centre, half = self._scale()
        scaled: np.ndarray = (codes - centre) / half
        return scaled

    def decode(self, codes: Codes) -> Plans:
        """Turn codes into plans, at rest and in range as demonstrated."""
        centre, half = self._scale()
        raw = codes * half + centre
        plans = np.empty((len(codes), self.horizon, len(self.kinds)))
        channel = 0
        for d, kind in enumerate(self.kinds):
            if kind == "spline":
                ends = _ends(self.length, self.rest_start[d], self.rest_end[d])
                free = raw[:, channel] @ np.linalg.pinv(ends).T
                plans[:, :, d] = free @ _synthesis(self.horizon, ends).T
                channel += 1
            elif kind == "number":
                number = codes[:, channel].mean(axis=1) * half[channel] + centre[channel]
                plans[:, :, d] = number[:, None]
                channel += 1
            else:
                folded = raw[:, channel : channel + self._fold].transpose(0, 2, 1)
                frames = folded.reshape(len(codes), -1)[:, : self.horizon]
                # Two equal frames are no velocity at that end.
                plans[:, :, d] = _tie(frames.copy(), 2, self.rest_start[d], self.rest_end[d])
                channel += self._fold
            if self.levels[d]:
                levels = np.array(self.levels[d])
                nearest = np.abs(plans[:, :, d, None] - levels).argmin(axis=-1)
                plans[:, :, d] = levels[nearest]
        return np.clip(plans, self.plan_range[0], self.plan_range[1])

    def settings(self) -> dict[str, Any]:
        """Everything but the arrays, as JSON types."""
        return {name: getattr(self, name) for name in _SETTINGS}

    @classmethod
    def restore(
        cls,
        settings: Mapping[str, Any],
        plan_range: Float[np.ndarray, "2 D"],
        code_range: Float[np.ndarray, "2 C"],
    ) -> Self:
        """Rebuild a codec from its `settings` and arrays.

        Raises:
            KeyError, TypeError: Something is missing.
        """
        known = {name: _as_tuples(settings[name]) for name in _SETTINGS}
        return cls(**known, plan_range=plan_range, code_range=code_range)

    @property
    def _fold(self) -> int:
        return math.ceil(self.horizon / self.length)

    def _scale(self) -> tuple[Float[np.ndarray, "C 1"], Float[np.ndarray, "C 1"]]:
        low, high = self.code_range
        half = (high - low) / 2
        centre = (high + low) / 2
        constant = half <= _CONSTANT * np.maximum(np.abs(centre), 1.0)
        return centre[:, None], np.where(constant, 1.0, half)[:, None]

    def _code(self, values: _Values, d: int) -> Float[np.ndarray, "n c T"]:
        """Unscaled code of one dimension; c = 1, or the fold."""
        if self.kinds[d] == "number":
            return np.repeat(values[:, :1, None], self.length, axis=2)
        if self.kinds[d] == "spline":
            return _fit_spline(values, self.length, self.rest_start[d], self.rest_end[d])[:, None]
        missing = self.length * self._fold - self.horizon
        padded = np.pad(values, ((0, 0), (0, missing)), mode="edge")
        return padded.reshape(len(values), self.length, self._fold).transpose(0, 2, 1)


def _basis(horizon: int, n_points: int) -> _Matrix:
    """Value of every basis function (columns) at every frame; clamped, uniform knots."""
    from scipy.interpolate import BSpline

    inner = np.linspace(0, horizon - 1, n_points - _DEGREE + 1)
    knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
    matrix: np.ndarray = BSpline.design_matrix(
        np.arange(horizon, dtype=float), knots, _DEGREE
    ).toarray()
    return matrix


def _fit_spline(
    values: _Values, n_points: int, at_start: bool, at_end: bool
) -> Float[np.ndarray, "n p"]:
    """Least-squares control points, equal at a resting end."""
    ends = _ends(n_points, at_start, at_end)
    free = np.linalg.lstsq(_synthesis(values.shape[1], ends), values.T, rcond=None)[0]
    points: np.ndarray = (ends @ free).T
    return points


def _ends(n_points: int, at_start: bool, at_end: bool) -> _Matrix:
    """Which free point (columns) each control point is: one for all at a resting end."""
    free = np.arange(n_points)
    if at_start:
        free = np.maximum(free - (_TIED - 1), 0)
    if at_end:
        free = np.minimum(free, free[-_TIED])
    return np.eye(free[-1] + 1)[free]


def _synthesis(horizon: int, ends: _Matrix) -> _Matrix:
    """Frames of a plan (rows) from its free control points."""
    matrix: np.ndarray = _basis(horizon, len(ends)) @ ends @ _smoother(ends.shape[1])
    return matrix


def _smoother(n: int) -> _Matrix:
    """Whittaker's smoother: what alternates between control points hardly reaches a plan.

    An arm's acceleration limits are met by motions and broken by ripple: a milliradian from point
    to point is several rad/s^2. Codes are fitted through the smoother, so that what demonstrations
    show of it comes back.
    """
    differences = np.diff(np.eye(n), 3, axis=0) if n > 3 else np.zeros((1, n))
    matrix: np.ndarray = np.linalg.inv(np.eye(n) + _STIFFNESS * differences.T @ differences)
    return matrix


def _tie(values: _Values, n_tied: int, at_start: bool, at_end: bool) -> _Values:
    if at_start:
        values[:, :n_tied] = values[:, :n_tied].mean(axis=1, keepdims=True)
    if at_end:
        values[:, -n_tied:] = values[:, -n_tied:].mean(axis=1, keepdims=True)
    return values


def _is_smooth(values: _Values, n_points: int, at_start: bool, at_end: bool) -> bool:
    matrix = _synthesis(values.shape[1], _ends(n_points, at_start, at_end))
    residual = matrix @ np.linalg.lstsq(matrix, values.T, rcond=None)[0] - values.T
    rms = np.sqrt(np.mean(residual**2, axis=0)).max()
    constant = np.ptp(values) <= _CONSTANT * max(1.0, float(np.abs(values).max()))
    return bool(constant or rms <= _LARGEST_SPLINE_RESIDUAL * np.ptp(values))


def _levels(values: _Values) -> tuple[float, ...]:
    """The values of a switch; empty where there are too many for one."""
    distinct = np.unique(values)
    return tuple(distinct.tolist()) if distinct.size <= _MOST_LEVELS else ()


def _as_tuples(value: Any) -> Any:
    """JSON's lists as the tuples they were."""
    return tuple(map(_as_tuples, value)) if isinstance(value, (list, tuple)) else value
