"""Plans as the network sees them: codes of a few numbers a dimension, scaled to [-1, 1].

Each dimension has a code of its own, decided when the codec is fitted, from the demonstrations
alone. A smooth one is coded by the control points of a cubic B-spline, about one for every four
frames, or twice or three times as many where the motion is fast; one that no spline follows (a
gripper that opens, recorded jitter) by its frames. Where there are more numbers than positions,
several consecutive ones are folded into one position. A dimension that is one number a plan, or is
held but for noise, is coded by that number at every position, and decoded by their mean.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.signals import HELD, MAX_LEVELS, analyse

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
_SPLINE_FOLDS = (1, 2, 3)
"""Control points for each position of the code: more where fewer do not follow the motion. Ours."""
_NOISE_RESIDUAL = 3.0
"""A spline may miss a dimension by so many standard deviations of its noise, rms. Ours."""
_MOST_NOISE = 0.02
"""But by no more than this part of its range: what is nothing but noise comes back too. Ours."""
_TIED = 3
"""Equal control points at a resting end: velocity and acceleration vanish there."""
_STIFFNESS = 0.3
"""Weight of the control points' third differences (see `_smoother`). Ours: the throws' points come
back to 1e-5, and an error of the network that alternates from point to point moves the plan's
acceleration by a third or less of what it did."""
_CONSTANT = 1e-9
"""A dimension whose range is below this, relative to its values, is constant."""

_SETTINGS = ("horizon", "length", "kinds", "folds", "rest_start", "rest_end", "levels")
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
    folds: tuple[int, ...]
    """For each dimension, how many numbers share one position of the code."""
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
        units: Sequence[str] | None = None,
        per_plan: Sequence[bool] | None = None,
        representation: Representation,
        frames_per_point: int,
        length_multiple: int,
        margin: float,
    ) -> Self:
        """Choose a code for plans like these.

        Args:
            plans: Of the demonstrations.
            units: Of the D dimensions; pure numbers by default.
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
        units = tuple(units or ("1",) * action_dim)
        signals = analyse(plans, units, dt=1.0)
        starts, ends = signals.rest_start, signals.rest_end
        kinds: list[Kind] = []
        folds: list[int] = []
        for d in range(action_dim):
            values, kind, fold = plans[:, :, d], "frames", math.ceil(horizon / length)
            if (per_plan is not None and per_plan[d]) or (
                signals.kinds[d] == "held" and representation == "splines"
            ):
                kind, fold = "number", 1
            elif representation == "splines" and signals.kinds[d] == "smooth":
                largest = max(
                    _LARGEST_SPLINE_RESIDUAL * float(np.ptp(values)),
                    min(
                        _NOISE_RESIDUAL * float(signals.noise[d]),
                        _MOST_NOISE * float(np.ptp(values)),
                    ),
                    HELD if units[d] in ("rad", "m") else 0.0,
                )
                for more in _SPLINE_FOLDS:
                    if _DEGREE < more * length < horizon and _fits(
                        values, more * length, starts[d], ends[d], largest
                    ):
                        kind, fold = "spline", more
                        break
            kinds.append(cast(Kind, kind))
            folds.append(fold)
        low, high = plans.min(axis=(0, 1)), plans.max(axis=(0, 1))
        slack = margin * (high - low)
        raw = cls(
            horizon=horizon,
            length=length,
            kinds=tuple(kinds),
            folds=tuple(folds),
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
        for d, (kind, fold) in enumerate(zip(self.kinds, self.folds, strict=True)):
            unfolded = raw[:, channel : channel + fold].transpose(0, 2, 1).reshape(len(codes), -1)
            if kind == "spline":
                ends = _ends(fold * self.length, self.rest_start[d], self.rest_end[d])
                free = unfolded @ np.linalg.pinv(ends).T
                plans[:, :, d] = free @ _synthesis(self.horizon, ends).T
            elif kind == "number":
                number = codes[:, channel].mean(axis=1) * half[channel] + centre[channel]
                plans[:, :, d] = number[:, None]
            else:
                frames = unfolded[:, : self.horizon].copy()
                # Two equal frames are no velocity at that end.
                plans[:, :, d] = _tie(frames, 2, self.rest_start[d], self.rest_end[d])
            channel += fold
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

    def _scale(self) -> tuple[Float[np.ndarray, "C 1"], Float[np.ndarray, "C 1"]]:
        low, high = self.code_range
        half = (high - low) / 2
        centre = (high + low) / 2
        constant = half <= _CONSTANT * np.maximum(np.abs(centre), 1.0)
        return centre[:, None], np.where(constant, 1.0, half)[:, None]

    def _code(self, values: _Values, d: int) -> Float[np.ndarray, "n c T"]:
        """Unscaled code of one dimension; c = 1, or the fold."""
        if self.kinds[d] == "number":
            return np.repeat(values.mean(axis=1)[:, None, None], self.length, axis=2)
        fold = self.folds[d]
        if self.kinds[d] == "spline":
            flat = _fit_spline(values, fold * self.length, self.rest_start[d], self.rest_end[d])
        else:
            missing = self.length * fold - self.horizon
            flat = np.pad(values, ((0, 0), (0, missing)), mode="edge")
        return flat.reshape(len(values), self.length, fold).transpose(0, 2, 1)


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


def _fits(values: _Values, n_points: int, at_start: bool, at_end: bool, largest: float) -> bool:
    """Whether a spline misses no plan by more than that, rms."""
    matrix = _synthesis(values.shape[1], _ends(n_points, at_start, at_end))
    residual = matrix @ np.linalg.lstsq(matrix, values.T, rcond=None)[0] - values.T
    rms = np.sqrt(np.mean(residual**2, axis=0)).max()
    constant = np.ptp(values) <= _CONSTANT * max(1.0, float(np.abs(values).max()))
    return bool(constant or rms <= largest)


def _levels(values: _Values) -> tuple[float, ...]:
    """The values of a switch; empty where there are too many for one."""
    distinct = np.unique(values)
    return tuple(distinct.tolist()) if distinct.size <= MAX_LEVELS else ()


def _as_tuples(value: Any) -> Any:
    """JSON's lists as the tuples they were."""
    return tuple(map(_as_tuples, value)) if isinstance(value, (list, tuple)) else value
