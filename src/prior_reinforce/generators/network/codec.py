"""Codes of plans for the network: a few numbers for each dimension, scaled to [-1, 1].

The code of each dimension is chosen from the demonstrations when the codec is fitted. A smooth
dimension is coded by the control points of a cubic B-spline, about one for every four frames, or
twice or three times as many if the motion is fast; one that no spline fits (a gripper that opens,
recorded jitter) by its frames. If there are more numbers than positions, several consecutive ones
are folded into one position. A dimension that is one number a plan, or is held except for noise, is
coded by that number at every position, and decoded by their mean.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.signals import HELD, NOISE_RMS

Representation = Literal["splines", "frames"]
"""Splines where they fit, or frames for every dimension."""
Kind = Literal["spline", "frames", "number"]
"""Code of one dimension: control points, frames, or one number a plan."""
Codes = Float[np.ndarray, "n C T"]
"""Coded plans: C numbers at each of T positions in time, those of demonstrations in [-1, 1]."""
_Values = Float[np.ndarray, "n H"]
"""One dimension of some plans."""

_DEGREE = 3
_LARGEST_SPLINE_RESIDUAL = 2e-3
"""Largest residual of a spline, rms, as a fraction of the dimension's range.

Ours: minimum-jerk throws have 1e-5 to 1e-4, a step 3e-2 or more; 2e-3 of a swing of 1.2 rad is
2.4 mrad, about what moves a landing point by its measurement noise."""
_SPLINE_FOLDS = (1, 2, 3)
"""Control points for each position of the code: more if fewer do not fit the motion. Ours."""
_MOST_NOISE = 0.02
"""The residual may also be as large as the noise (`NOISE_RMS`), up to this part of the range, so
that pure noise is not coded by frames. Ours."""
_TIED = 3
"""Equal control points at a resting end: velocity and acceleration vanish there."""
_STIFFNESS = 0.3
"""Weight of the control points' third differences (see `_Spline`). Ours: the throws' points are
reproduced to 1e-5, and an error of the network that alternates from point to point changes the
plan's acceleration by a third or less of what it would without."""
_CONSTANT = 1e-9
"""A code whose range is below this, relative to its values, is constant."""

_SETTINGS = ("horizon", "length", "kinds", "folds", "rest_start", "rest_end", "levels", "smoothing")
"""Fields of a codec that are not arrays."""


@dataclass(frozen=True, eq=False)
class PlanCodec:
    """Encodes and decodes plans of one shape; made by `fit`."""

    horizon: int
    """H."""
    length: int
    """T."""
    kinds: tuple[Kind, ...]
    """For each of the D dimensions: its code."""
    folds: tuple[int, ...]
    """For each dimension, how many numbers share one position of the code."""
    rest_start: tuple[bool, ...]
    """For each dimension: every demonstration starts at rest."""
    rest_end: tuple[bool, ...]
    """For each dimension: every demonstration ends at rest."""
    levels: tuple[tuple[float, ...], ...]
    """For each dimension: the values of a switch; empty where it is none."""
    smoothing: float
    """Standard deviation, in frames, of the Gaussian that smooths dimensions coded by frames."""
    plan_range: Float[np.ndarray, "2 D"]
    """Least and greatest value a dimension may take: the demonstrations' range, widened by the
    margin."""
    code_range: Float[np.ndarray, "2 C"]
    """The values that are scaled to -1 and 1."""

    @classmethod
    def fit(
        cls,
        demonstrations: Demonstrations,
        *,
        representation: Representation,
        frames_per_point: int,
        length_multiple: int,
        margin: float,
        smoothing: float = 0.0,
    ) -> Self:
        """Choose a code for plans like the demonstrated ones.

        `representation` is `splines` where they fit, or `frames` for every dimension. T will be a
        multiple of `length_multiple`; `margin` is how far generated plans may leave the
        demonstrated range of a dimension, as a fraction of that range; `smoothing` is in [s].
        """
        plans, signals = demonstrations.plans, demonstrations.signals
        horizon, action_dim = demonstrations.horizon, demonstrations.action_dim
        if representation == "frames":
            length = math.ceil(horizon / length_multiple) * length_multiple
        else:
            length = max(1, round(horizon / frames_per_point / length_multiple)) * length_multiple
        low, high = plans.min(axis=(0, 1)), plans.max(axis=(0, 1))
        slack = margin * (high - low)
        coded = [
            _choose_code(demonstrations, d, length, representation == "splines")
            for d in range(action_dim)
        ]
        raw = cls(
            horizon=horizon,
            length=length,
            kinds=tuple(kind for kind, _ in coded),
            folds=tuple(fold for _, fold in coded),
            rest_start=signals.rest_start,
            rest_end=signals.rest_end,
            levels=tuple(
                tuple(np.unique(plans[:, :, d]).tolist()) if kind == "switch" else ()
                for d, kind in enumerate(signals.kinds)
            ),
            smoothing=smoothing / demonstrations.format.dt,
            plan_range=np.stack([low - slack, high + slack]),
            code_range=np.array([[-1.0], [1.0]]),
        )
        codes = [raw._code(plans[:, :, d], d) for d in range(action_dim)]
        ranges = [np.repeat([[c.min()], [c.max()]], c.shape[1], axis=1) for c in codes]
        return replace(raw, code_range=np.concatenate(ranges, axis=1))

    @property
    def shape(self) -> tuple[int, int]:
        """(C, T), of codes."""
        return self.code_range.shape[1], self.length

    def encode(self, plans: Plans) -> Codes:
        """Encode plans; demonstrations have codes in [-1, 1]."""
        codes = [self._code(plans[:, :, d], d) for d in range(plans.shape[2])]
        centre, half = self._scale()
        return np.asarray((np.concatenate(codes, axis=1) - centre) / half)

    def decode(self, codes: Codes) -> Plans:
        """Decode plans, at rest and in range as demonstrated."""
        centre, half = self._scale()
        raw = np.split(codes * half + centre, np.cumsum(self.folds)[:-1], axis=1)
        plans = np.empty((len(codes), self.horizon, len(self.kinds)))
        for d, (kind, code) in enumerate(zip(self.kinds, raw, strict=True)):
            values = code.transpose(0, 2, 1).reshape(len(codes), -1)
            if kind == "number":
                values = values.mean(axis=1, keepdims=True)
            elif kind == "spline":
                values = self._spline(d).frames(values)
            else:
                values = values[:, : self.horizon].copy()
                if self.smoothing and not self.levels[d]:
                    from scipy.ndimage import gaussian_filter1d

                    values = gaussian_filter1d(values, self.smoothing, axis=1, mode="nearest")
                # Equal frames at an end have no velocity.
                if self.rest_start[d]:
                    values[:, :2] = values[:, :2].mean(axis=1, keepdims=True)
                if self.rest_end[d]:
                    values[:, -2:] = values[:, -2:].mean(axis=1, keepdims=True)
            if self.levels[d]:
                levels = np.array(self.levels[d])
                values = levels[np.abs(values[:, :, None] - levels).argmin(axis=-1)]
            plans[:, :, d] = values
        return np.clip(plans, self.plan_range[0], self.plan_range[1])

    def settings(self) -> dict[str, Any]:
        """Return everything except the arrays, as JSON types."""
        return {name: getattr(self, name) for name in _SETTINGS}

    @classmethod
    def restore(
        cls,
        settings: Mapping[str, Any],
        plan_range: Float[np.ndarray, "2 D"],
        code_range: Float[np.ndarray, "2 C"],
    ) -> Self:
        """Rebuild a codec from its `settings` and arrays.

        KeyError or TypeError if something is missing.
        """
        known = {name: _as_tuples(settings[name]) for name in _SETTINGS}
        return cls(**known, plan_range=plan_range, code_range=code_range)

    def _scale(self) -> tuple[Float[np.ndarray, "C 1"], Float[np.ndarray, "C 1"]]:
        """Return centre and half width of the range of each number of a code."""
        low, high = self.code_range
        half = (high - low) / 2
        centre = (high + low) / 2
        constant = half <= _CONSTANT * np.maximum(np.abs(centre), 1.0)
        return centre[:, None], np.where(constant, 1.0, half)[:, None]

    def _code(self, values: _Values, d: int) -> Float[np.ndarray, "n c T"]:
        """Return the unscaled code of one dimension; c is 1 or the fold."""
        kind, fold = self.kinds[d], self.folds[d]
        if kind == "number":
            return np.repeat(values.mean(axis=1)[:, None, None], self.length, axis=2)
        if kind == "spline":
            flat = self._spline(d).points(values)
        else:
            missing = self.length * fold - self.horizon
            flat = np.pad(values, ((0, 0), (0, missing)), mode="edge")
        return flat.reshape(len(values), self.length, fold).transpose(0, 2, 1)

    def _spline(self, d: int) -> _Spline:
        n_points = self.folds[d] * self.length
        return _spline(self.horizon, n_points, self.rest_start[d], self.rest_end[d])


def _choose_code(
    demonstrations: Demonstrations, d: int, length: int, splines: bool
) -> tuple[Kind, int]:
    """Choose the code of one dimension, and its fold."""
    form, signals, horizon = demonstrations.format, demonstrations.signals, demonstrations.horizon
    if form.names[d] in form.per_plan or (splines and signals.kinds[d] == "held"):
        return "number", 1
    if splines and signals.kinds[d] == "smooth":
        values = demonstrations.plans[:, :, d]
        extent = float(np.ptp(values))
        largest = max(
            _LARGEST_SPLINE_RESIDUAL * extent,
            min(NOISE_RMS * float(signals.noise[d]), _MOST_NOISE * extent),
            HELD if form.units[d] in ("rad", "m") and d not in form.increments else 0.0,
        )
        for fold in _SPLINE_FOLDS:
            if _DEGREE < fold * length < horizon:
                ends = signals.rest_start[d], signals.rest_end[d]
                spline = _spline(horizon, fold * length, *ends)
                residuals = spline.frames(spline.points(values)) - values
                if np.sqrt(np.mean(residuals**2, axis=1)).max() <= largest:
                    return "spline", fold
    return "frames", math.ceil(horizon / length)


class _Spline:
    """A cubic B-spline with clamped, uniform knots, and equal control points at a resting end.

    Whittaker's smoother S^-1, with S = I + w R^T R and third differences R, damps ripple between
    control points, of which a milliradian is several rad/s^2, beyond an arm's limits. Points are
    fitted through the smoother, so that demonstrations are reproduced.
    """

    def __init__(self, horizon: int, n_points: int, at_start: bool, at_end: bool) -> None:
        """Build it for plans of H frames that all rest at their start, or at their end."""
        from scipy import sparse
        from scipy.interpolate import BSpline
        from scipy.sparse.linalg import splu

        free = np.arange(n_points)
        if at_start:
            free = np.maximum(free - (_TIED - 1), 0)
        if at_end:
            free = np.minimum(free, free[-_TIED])
        self._free, n = free, int(free[-1]) + 1  # the free point of each control point
        inner = np.linspace(0, horizon - 1, n_points - _DEGREE + 1)
        knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
        basis = BSpline.design_matrix(np.arange(horizon, dtype=float), knots, _DEGREE)
        ends = sparse.csr_array((np.ones(n_points), (np.arange(n_points), free)))
        self._basis = basis @ ends  # (H, n)
        third = sparse.csr_array((1, n))  # fewer than four points have no third difference
        if n > 3:
            third = sparse.diags_array([-1.0, 3.0, -3.0, 1.0], offsets=range(4), shape=(n - 3, n))
        # All matrices are banded, so that their solution is linear in H.
        self._stiffness = sparse.csc_array(sparse.eye_array(n) + _STIFFNESS * third.T @ third)
        self._smooth = splu(self._stiffness).solve
        self._solve_normal = splu(sparse.csc_array(self._basis.T @ self._basis)).solve

    def points(self, values: _Values) -> Float[np.ndarray, "n p"]:
        """Return the least-squares control points of frames."""
        free = self._stiffness @ self._solve_normal(self._basis.T @ values.T)
        return np.asarray(free[self._free].T)

    def frames(self, points: Float[np.ndarray, "n p"]) -> _Values:
        """Return the frames of control points; those at a resting end are averaged."""
        first = np.flatnonzero(np.diff(self._free, prepend=-1))
        free = np.add.reduceat(points.T, first) / np.bincount(self._free)[:, None]
        return np.asarray((self._basis @ self._smooth(free)).T)


_spline = lru_cache(maxsize=8)(_Spline)  # a codec uses the same few for each plan


def _as_tuples(value: Any) -> Any:
    """Convert JSON's lists back to tuples."""
    return tuple(map(_as_tuples, value)) if isinstance(value, (list, tuple)) else value
