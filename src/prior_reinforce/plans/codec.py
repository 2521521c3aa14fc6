"""Plans as the network sees them: codes of a few numbers a dimension, scaled to [-1, 1].

A smooth dimension is coded by the control points of a cubic B-spline, about one for every four
frames; one that a spline cannot follow (a gripper that opens, recorded jitter) by its frames,
folded so that several consecutive frames share one position of the code. Which it is, is decided
for each dimension when the codec is fitted, from the demonstrations alone.

Notation:
    plans  (n, H, D)   in their units
    codes  (n, C, T)   scaled; T positions in time; C = D, or more where frames are folded
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.interpolate import BSpline
from typing_extensions import Self

Representation = Literal["splines", "frames"]

_DEGREE = 3
_LARGEST_SPLINE_RESIDUAL = 2e-3
"""A dimension is smooth if its spline misses it by at most this fraction of its range, rms.

Ours: minimum-jerk throws are missed by 1e-5 to 1e-4, a step by 3e-2 or more; 2e-3 of a swing of
1.2 rad is 2.4 mrad, about what moves a landing point by its measuring noise."""
_MOST_LEVELS = 4
"""A dimension that is not smooth and takes no more values than these is a switch."""
_REST = 0.01
"""A dimension rests at an end if its step there is below this fraction of its largest step."""
_TIED = 3
"""Equal control points at a resting end: velocity and acceleration vanish there."""
_STIFFNESS = 0.3
"""Weight of the control points' third differences (see `_smoother`). Ours: the throws' points come
back to 1e-5, and an error of the network that alternates from point to point moves the plan's
acceleration by a third or less of what it did."""
_CONSTANT = 1e-9
"""A dimension whose range is below this, relative to its values, is constant."""


@dataclass(frozen=True, eq=False)
class PlanCodec:
    """Turns plans of one shape into codes and back; made by `fit`."""

    horizon: int
    """H."""
    length: int
    """T."""
    smooth: tuple[bool, ...]
    """For each of the D dimensions: coded by control points, else by frames."""
    rest_start: tuple[bool, ...]
    """For each dimension: every demonstration starts at rest."""
    rest_end: tuple[bool, ...]
    """For each dimension: every demonstration ends at rest."""
    levels: tuple[tuple[float, ...], ...]
    """For each dimension: the values of a switch; empty where it is none."""
    plan_range: np.ndarray
    """Least and greatest value a dimension may take, shape (2, D): the demonstrations' range,
    widened by the margin."""
    code_range: np.ndarray
    """The values that are scaled to -1 and 1, shape (2, C)."""

    @classmethod
    def fit(
        cls,
        plans: np.ndarray,
        *,
        representation: Representation,
        frames_per_point: int,
        length_multiple: int,
        margin: float,
    ) -> Self:
        """Choose a code for plans like these.

        Args:
            plans: Demonstrations, shape (N, H, D).
            representation: `splines` where they fit, or `frames` for every dimension.
            frames_per_point: Frames for each control point.
            length_multiple: T will be a multiple of this.
            margin: How far generated plans may leave the demonstrated range of a dimension, as a
                fraction of that range.
        """
        horizon = plans.shape[1]
        if representation == "frames":
            length = math.ceil(horizon / length_multiple) * length_multiple
        else:
            length = max(1, round(horizon / frames_per_point / length_multiple)) * length_multiple
        rest = _rest(plans)
        smooth = [False] * plans.shape[2]
        if representation == "splines" and _DEGREE < length < horizon:
            smooth = _smooth(plans, length, *rest)
        low, high = plans.min(axis=(0, 1)), plans.max(axis=(0, 1))
        slack = margin * (high - low)
        raw = cls(
            horizon=horizon,
            length=length,
            smooth=tuple(smooth),
            rest_start=rest[0],
            rest_end=rest[1],
            levels=tuple(
                () if is_smooth else _levels(plans[:, :, d]) for d, is_smooth in enumerate(smooth)
            ),
            plan_range=np.stack([low - slack, high + slack]),
            code_range=np.array([[-1.0], [1.0]]),
        )
        per_dimension = [raw._code(plans[:, :, d], d) for d in range(plans.shape[2])]
        ranges = [
            np.repeat([[code.min()], [code.max()]], code.shape[1], axis=1) for code in per_dimension
        ]
        return cls(**{**raw.__dict__, "code_range": np.concatenate(ranges, axis=1)})

    @property
    def channels(self) -> int:
        """C, the numbers of a code at one position."""
        return self.code_range.shape[1]

    def encode(self, plans: np.ndarray) -> np.ndarray:
        """Return codes (n, C, T) of plans (n, H, D); demonstrations land in [-1, 1]."""
        codes = np.concatenate(
            [self._code(plans[:, :, d], d) for d in range(plans.shape[2])], axis=1
        )
        centre, half = self._scale()
        scaled: np.ndarray = (codes - centre) / half
        return scaled

    def decode(self, codes: np.ndarray) -> np.ndarray:
        """Return plans (n, H, D) of codes (n, C, T), at rest and in range as demonstrated."""
        centre, half = self._scale()
        raw = codes * half + centre
        plans = np.empty((len(codes), self.horizon, len(self.smooth)))
        channel = 0
        for d, is_smooth in enumerate(self.smooth):
            if is_smooth:
                ends = _ends(self.length, self.rest_start[d], self.rest_end[d])
                free = raw[:, channel] @ np.linalg.pinv(ends).T
                plans[:, :, d] = free @ _synthesis(self.horizon, ends).T
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
        return {
            "horizon": self.horizon,
            "length": self.length,
            "smooth": list(self.smooth),
            "rest_start": list(self.rest_start),
            "rest_end": list(self.rest_end),
            "levels": [list(values) for values in self.levels],
        }

    @classmethod
    def restore(
        cls, settings: dict[str, Any], plan_range: np.ndarray, code_range: np.ndarray
    ) -> Self:
        """Rebuild a codec from its `settings` and arrays."""
        return cls(
            horizon=int(settings["horizon"]),
            length=int(settings["length"]),
            smooth=tuple(settings["smooth"]),
            rest_start=tuple(settings["rest_start"]),
            rest_end=tuple(settings["rest_end"]),
            levels=tuple(tuple(values) for values in settings["levels"]),
            plan_range=plan_range,
            code_range=code_range,
        )

    @property
    def _fold(self) -> int:
        return math.ceil(self.horizon / self.length)

    def _scale(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = self.code_range
        half = (high - low) / 2
        centre = (high + low) / 2
        constant = half <= _CONSTANT * np.maximum(np.abs(centre), 1.0)
        return centre[:, None], np.where(constant, 1.0, half)[:, None]

    def _code(self, values: np.ndarray, d: int) -> np.ndarray:
        """Unscaled code (n, 1 or fold, T) of one dimension (n, H)."""
        if self.smooth[d]:
            return _fit_spline(values, self.length, self.rest_start[d], self.rest_end[d])[:, None]
        missing = self.length * self._fold - self.horizon
        padded = np.pad(values, ((0, 0), (0, missing)), mode="edge")
        return padded.reshape(len(values), self.length, self._fold).transpose(0, 2, 1)


def _basis(horizon: int, n_points: int) -> np.ndarray:
    """Value of every basis function at every frame, shape (H, n_points); clamped, uniform knots."""
    inner = np.linspace(0, horizon - 1, n_points - _DEGREE + 1)
    knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
    matrix: np.ndarray = BSpline.design_matrix(
        np.arange(horizon, dtype=float), knots, _DEGREE
    ).toarray()
    return matrix


def _fit_spline(values: np.ndarray, n_points: int, at_start: bool, at_end: bool) -> np.ndarray:
    """Least-squares control points (n, n_points) of (n, H), equal at a resting end."""
    ends = _ends(n_points, at_start, at_end)
    free = np.linalg.lstsq(_synthesis(values.shape[1], ends), values.T, rcond=None)[0]
    points: np.ndarray = (ends @ free).T
    return points


def _ends(n_points: int, at_start: bool, at_end: bool) -> np.ndarray:
    """Which free point each control point is, shape (n_points, n_free): one for all at a rest."""
    free = np.arange(n_points)
    if at_start:
        free = np.maximum(free - (_TIED - 1), 0)
    if at_end:
        free = np.minimum(free, free[-_TIED])
    return np.eye(free[-1] + 1)[free]


def _synthesis(horizon: int, ends: np.ndarray) -> np.ndarray:
    """Frames of a plan from its free control points, shape (H, n_free)."""
    matrix: np.ndarray = _basis(horizon, len(ends)) @ ends @ _smoother(ends.shape[1])
    return matrix


def _smoother(n: int) -> np.ndarray:
    """Whittaker's smoother (n, n): what alternates between control points hardly reaches a plan.

    An arm's acceleration limits are met by motions and broken by ripple: a milliradian from point
    to point is several rad/s^2. Codes are fitted through the smoother, so that what demonstrations
    show of it comes back.
    """
    differences = np.diff(np.eye(n), 3, axis=0) if n > 3 else np.zeros((1, n))
    matrix: np.ndarray = np.linalg.inv(np.eye(n) + _STIFFNESS * differences.T @ differences)
    return matrix


def _tie(values: np.ndarray, n_tied: int, at_start: bool, at_end: bool) -> np.ndarray:
    if at_start:
        values[:, :n_tied] = values[:, :n_tied].mean(axis=1, keepdims=True)
    if at_end:
        values[:, -n_tied:] = values[:, -n_tied:].mean(axis=1, keepdims=True)
    return values


def _rest(plans: np.ndarray) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    steps = np.abs(np.diff(plans, axis=1))
    slow = _REST * steps.max(axis=(0, 1))
    return (
        tuple((steps[:, 0] <= slow).all(axis=0).tolist()),
        tuple((steps[:, -1] <= slow).all(axis=0).tolist()),
    )


def _smooth(
    plans: np.ndarray, n_points: int, at_start: tuple[bool, ...], at_end: tuple[bool, ...]
) -> list[bool]:
    result = []
    for d in range(plans.shape[2]):
        values = plans[:, :, d]
        ends = _ends(n_points, at_start[d], at_end[d])
        matrix = _synthesis(values.shape[1], ends)
        residual = matrix @ np.linalg.lstsq(matrix, values.T, rcond=None)[0] - values.T
        rms = np.sqrt(np.mean(residual**2, axis=0)).max()
        constant = np.ptp(values) <= _CONSTANT * max(1.0, float(np.abs(values).max()))
        result.append(bool(constant or rms <= _LARGEST_SPLINE_RESIDUAL * np.ptp(values)))
    return result


def _levels(values: np.ndarray) -> tuple[float, ...]:
    distinct = np.unique(values)
    return tuple(distinct.tolist()) if distinct.size <= _MOST_LEVELS else ()
