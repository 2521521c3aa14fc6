r"""Phase and amplitude: a plan is a shape played through a monotone warp of time.

    A_i(t) = shape_i(tau_i(t))

People do not repeat a motion at the same time, nor at the same tempo. A `Timeline` takes
demonstrations apart into shapes on one common phase tau and a few numbers each, the warp, so that
both can be learned; it plays any shape through any warp. The inverse map is what is parametrised:

    t(tau) = start + integral from 0 to tau of exp(rho(u)) du

- `none`: t = tau.
- `start`: rho = 0; one number, when it moves.
- `tempo`: rho constant; two numbers.
- `warp`: rho piecewise linear over the motion, constant outside; `_KNOTS` numbers more.

Phase 0 is the middle of the motion, so that start and tempo hardly depend on each other; by `start`
alone, motions of uneven pace agree where they are fastest. Outside its recording a plan holds where
it rests, and goes on with its last velocity where it does not, so no rest is needed at either end,
and nothing is cut off. A channel that is held but for noise (`channels`) is held without it. One
that rests but for short transitions is timed by itself: its shape is split at its transitions, and
when each of them comes is one number more. If it goes with the motion, its last transition is phase
0 of `start`, and where `tempo` and `warp` begin their search: a hand that opens decides where the
object goes, and what the arm does just then is what has to be mixed.

Notation:
    t      time of a plan               [frames]
    tau    phase, common to all plans   [frames]
    theta  `numbers`: the warp of a plan (P,)  start [frames], then rho at each knot [-]

Source: ours; learning phase and amplitude apart is functional data analysis [Srivastava2011], with
its square-root velocities as what is compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.arrays import Plans
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.alignment import correlation_lags
from prior_reinforce.plans.channels import (
    kinds,
    largest_of_unit,
    noise,
    transitions,
    without_noise_where_held,
)
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.plans.timing import (
    SMOOTHING,
    Continued,
    middle,
    motion_span,
    moving_rows,
    velocity_profiles,
)

WarpKind = Literal["none", "start", "tempo", "warp"]
"""What a warp may do: nothing, move, stretch as a whole, stretch in parts."""
Numbers = Float[np.ndarray, "n P"]

_KNOTS = 6
"""Knots of rho over the motion. Ours: two phases and a pause between them need five."""
_STIFFNESS = 0.02
"""Weight of rho's variance over the knots, against a motion's unit energy. Ours, not tuned."""
_LARGEST_TEMPO = 0.7
"""Bound of |rho|: tempos differ by a factor of two at most. Ours."""
_ROUNDS = 4
"""Rounds of "mean of all motions, then each to it". Ours: two more change starts by 0.12
frames at most, on six sets of the zoo's development tasks."""
_GOES_WITH = 0.15
"""A step goes with the motion if it comes at the same time in it, to this part of the motion's
length, standard deviation. Ours: 0.02 to 0.03 on five sets of zoo-gripper; a gripper that closes by
the clock, whenever the arm starts, goes with nothing."""
_AROUND = 0.2
"""Part of a motion's length, as a standard deviation, around its fastest moment over which motions
are compared there. Ours: with 0.1 two styles of a motion are taken for one (docs/decisions-
generator.md)."""
_SEARCHED = 0.3
"""If one would have to be moved by more than this part of the length to agree there, in a round or
in all, none is moved. Ours."""
_SHARED = 0.7
"""Least share of the motions' energy there that is in their mean. Ours: 0.67 to 0.99 in the zoo;
0.45 and 0.64 where a push goes to either side, which moved exact starts by 9 frames and 2."""
_SAME = 0.007
"""Starts that would move by less than this part of the length stay where whole motions agree best.
Ours: where nobody's pace differs, estimates do by up to that (curling, set A)."""
_LEAST_ENERGY = 1e-6
"""Below this nothing moves; a whole motion's is `_FINE`."""
_COMPARED = 40.0
"""Phases over the motion at which velocities are compared. Ours: they are smooth."""
_FINE = 8
"""Points a frame at which a warp is tabulated, and motions are compared when they are fastest."""
_EXACT = 2e-5
"""Demonstrations come back from shape and warp to this part of the largest range of their unit,
rms, or the shapes are sampled more finely. Ours: a tenth of a milliradian of 5 rad."""
_OVERSAMPLING = (1, 2, 4)
_STILL = 1e-4
"""A pose is left where a channel is off by this part of the largest range of its unit, or by
`_STILL_NOISE` standard deviations of its noise. Ours: a minimum-jerk motion has 0.7 % of its
largest speed there, and can stop."""
_STILL_NOISE = 6.0
_EASED = 0.1
"""Part of the frames over which a motion that is cut off comes to rest. Ours: the ends of our
tele-operated plans are cut at 1 to 4 % of their largest speed, which stops well within limits."""
_FEW_FRAMES = 20
"""In fewer frames nothing can be moved by parts of one without a loss; they are kept as recorded.
Ours."""


@dataclass(frozen=True)
class Step:
    """A channel that is timed by itself: split at its transitions."""

    channel: int
    phases: tuple[int, ...]
    """Where on the common phase each transition stands, in whole frames."""
    levels: tuple[float, ...] = ()
    """The values of a switch, which takes no others; empty where there are more."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """The common phase of demonstrations, and how to take plans apart and play them."""

    kind: WarpKind
    horizon: int
    """H."""
    span: float
    """Length of the motion between the first and the last knot, in frames."""
    first: int
    """Phase of a shape's first frame."""
    linear: tuple[int, ...]
    """Channels that jump, but not equally often in all demonstrations: they share the warp, and are
    played on lines, so that they do not overshoot."""
    per_frame: int
    """Samples of a shape for each frame of phase."""
    steps: tuple[Step, ...]
    lowest: tuple[float, ...]
    """Least that each number may be: as far below the demonstrated ones as these are apart. Ours:
    beyond the demonstrations timing is extrapolated like shapes, but no further."""
    highest: tuple[float, ...]
    """Greatest, likewise."""
    still: tuple[float, ...]
    """How far each channel that shares the warp may be from a pose and still count as there."""
    rests: tuple[bool, bool]
    """Whether all demonstrations rest at their first frame, and at their last. Where they do, plans
    do: what would be cut off there is eased instead."""

    @property
    def n_numbers(self) -> int:
        """P, numbers of a warp, those of steps included."""
        return len(self.lowest)

    def play(self, shapes: Float[np.ndarray, "n L C"], numbers: Numbers) -> Plans:
        """Play shapes through warps: the plans that they make.

        Args:
            shapes: From `take_apart`, or like them.
            numbers: theta of each; kept between `lowest` and `highest`.
        """
        if not (np.all(np.isfinite(shapes)) and np.all(np.isfinite(numbers))):
            # Of a generator gone wrong; whoever executes plans refuses what is not finite.
            return np.full((len(shapes), self.horizon, self.n_channels(shapes)), np.nan)
        numbers = np.clip(numbers, self.lowest, self.highest)
        n_steps = sum(len(step.phases) for step in self.steps)
        warp, events = np.split(numbers, [numbers.shape[1] - n_steps], axis=1)
        t = np.arange(self.horizon, dtype=float)
        n_channels = self.n_channels(shapes)
        plans = np.zeros((len(shapes), self.horizon, n_channels))
        smooth = _others(n_channels, self.steps)
        eased = [d for d in smooth if d not in self.linear]  # what jumps is at one level or another
        for i, theta in enumerate(warp):
            at = (_inverse(theta, self.span, t) - self.first) * self.per_frame
            plans[i][:, smooth] = _sample(shapes[i][:, : len(smooth)], at)
            for d in self.linear:
                plans[i, :, d] = _linear(shapes[i, :, smooth.index(d)], at)
        begins, ends = np.logical_and(self.cut_off(shapes, warp), self.rests).T
        for at_end, cut in ((False, begins), (True, ends)):
            for which in np.flatnonzero(cut):
                plans[which][:, eased] = _eased(plans[which][:, eased], at_end=at_end)
        parts, event = shapes[:, :, len(smooth) :], 0
        for step in self.steps:
            for phase in step.phases:
                for i, came in enumerate(events[:, event]):
                    at = (t + phase - came - self.first) * self.per_frame
                    plans[i, :, step.channel] += _linear(parts[i, :, event], at)
                event += 1
            if step.levels:
                levels, values = np.array(step.levels), plans[:, :, step.channel]
                nearest = np.abs(values[:, :, None] - levels).argmin(axis=-1)
                plans[:, :, step.channel] = levels[nearest]
        return plans

    def cut_off(self, shapes: Float[np.ndarray, "n L C"], warp: Numbers) -> Bool[np.ndarray, "n 2"]:
        """Whether some of each motion comes before the first frame, and after the last."""
        lost = np.zeros((len(shapes), 2), dtype=bool)
        if not warp.shape[1]:
            return lost
        smooth = _others(self.n_channels(shapes), self.steps)
        moved = [k for k, d in enumerate(smooth) if d not in self.linear]
        still = np.array(self.still)[moved]
        for i, theta in enumerate(warp):
            rows = moving_rows(shapes[i][:, moved], still)
            if rows is not None:
                phases = self.first + np.array(rows) / self.per_frame
                begins, ends = _times(theta, self.span, phases)
                lost[i] = begins < 0.0, ends > self.horizon - 1
        return lost

    def n_channels(self, shapes: Float[np.ndarray, "n L C"]) -> int:
        """D, channels of the plans that shapes make."""
        return shapes.shape[2] - sum(len(step.phases) - 1 for step in self.steps)

    def settings(self) -> dict[str, Any]:
        """Everything as JSON types."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            **fields,
            "steps": [[step.channel, step.phases, step.levels] for step in self.steps],
        }

    @classmethod
    def restore(cls, settings: Any) -> Timeline:
        """Rebuild it from `settings`.

        Raises:
            KeyError, TypeError, ValueError: Something is missing, or does not fit.
        """
        known = {name: settings[name] for name in cls.__dataclass_fields__}
        if known["kind"] not in get_args(WarpKind):
            raise ValueError(f"no warp {known['kind']!r}")
        known["steps"] = tuple(
            Step(int(channel), tuple(map(int, phases)), tuple(map(float, levels)))
            for channel, phases, levels in known["steps"]
        )
        known["linear"] = tuple(map(int, known["linear"]))
        known["rests"] = bool(known["rests"][0]), bool(known["rests"][1])
        for name in ("lowest", "highest", "still"):
            known[name] = tuple(map(float, known[name]))
        return cls(**known)


@dataclass(frozen=True, eq=False)
class Apart:
    """Demonstrations taken apart into shapes and warps."""

    timeline: Timeline
    shapes: Float[np.ndarray, "N L C"]
    """Smooth channels first, then the parts of those that are timed by themselves."""
    numbers: Numbers
    """theta of each demonstration."""
    by_step: bool = False
    """Phase 0 is the transition of a channel: a hand that opens, say."""

    def names(self, plan_format: PlanFormat) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Name and unit of each of the C channels of a shape, then of the P numbers."""
        steps = self.timeline.steps
        smooth = _others(plan_format.action_dim, steps)
        names = [plan_format.names[d] for d in smooth]
        units = [plan_format.units[d] for d in smooth]
        events = []
        for step in steps:
            name = plan_format.names[step.channel]
            for m in range(len(step.phases)):
                names.append(f"{name}, change {m + 1}")
                units.append(plan_format.units[step.channel])
                events.append(f"time of {name}, change {m + 1}")
        n_warp = self.timeline.n_numbers - len(events)
        numbers = [*(["start"] if n_warp else []), *(f"tempo {m + 1}" for m in range(n_warp - 1))]
        kinds_ = [*(["frame"] if n_warp else []), *["log"] * max(0, n_warp - 1)]
        return (
            (*names, *_unused([*numbers, *events], names)),
            (*units, *kinds_, *["frame"] * len(events)),
        )


def take_apart(demonstrations: Demonstrations, kind: WarpKind) -> Apart:
    """Find the warp of each demonstration, and its shape on the common phase.

    Args:
        demonstrations: N of them, of any kind of channel.
        kind: What the warps may do.

    Raises:
        InvalidDemonstrationsError: Nothing moves, so nothing can be timed.
    """
    plan_format = demonstrations.format
    plans = without_noise_where_held(demonstrations.plans, plan_format.units)
    found = kinds(plans, plan_format.units)
    events = {
        d: found_times
        for d, each in enumerate(found)
        if each in ("step", "switch") and (found_times := transitions(plans[:, :, d])) is not None
    }
    if len(events) == len(found):  # nothing but steps: they are the motion
        events = {}
    smooth = [d for d in range(len(found)) if d not in events]
    profiles = velocity_profiles(
        plans[:, :, smooth], tuple(plan_format.units[d] for d in smooth), SMOOTHING / plan_format.dt
    )
    lasts = [each[:, -1] for each in events.values() if each.shape[1]]
    decisive = max(lasts, key=lambda last: float(last.mean()), default=None)
    warp, span, by_step = _warps(profiles, kind, decisive)
    # Whole frames, so that a transition comes back as recorded.
    times = {d: np.round(each).astype(int) for d, each in events.items()}
    steps = tuple(
        Step(
            d,
            tuple(round(float(phase)) for phase in each.mean(axis=0)),
            tuple(np.unique(plans[:, :, d]).tolist()) if found[d] == "switch" else (),
        )
        for d, each in times.items()
        if each.shape[1]
    )
    numbers = np.concatenate([warp, *(times[step.channel] for step in steps)], axis=1)
    horizon = demonstrations.horizon
    ends = np.array([0.0, horizon - 1.0])
    phases = np.stack([_inverse(theta, span, ends) for theta in warp])
    least, most = phases[:, 0].min(), phases[:, 1].max()
    for step in steps:
        offsets = np.array(step.phases) - times[step.channel]
        least, most = min(least, offsets.min()), max(most, horizon - 1 + offsets.max())
    first, last = int(np.floor(least)), int(np.ceil(most))
    timeline = Timeline(
        kind=kind,
        horizon=horizon,
        span=span,
        first=first,
        per_frame=1,
        linear=tuple(
            d for d, each in enumerate(found) if each in ("step", "switch") and d not in times
        ),
        steps=steps,
        lowest=tuple((numbers.min(axis=0) - np.ptp(numbers, axis=0)).tolist()),
        highest=tuple((numbers.max(axis=0) + np.ptp(numbers, axis=0)).tolist()),
        still=tuple(_still(plans, plan_format.units)[_others(len(found), steps)].tolist()),
        rests=(False, False),
    )
    continued = Continued(plans, plan_format.units, np.linalg.norm(profiles, axis=2))
    for per_frame in _OVERSAMPLING:
        timeline = replace(timeline, per_frame=per_frame)
        tau = first + np.arange((last - first) * per_frame + 1) / per_frame
        shapes = _shapes(timeline, continued, warp, times, tau)
        cut = timeline.cut_off(shapes, warp)
        timeline = replace(timeline, rests=(not cut[:, 0].any(), not cut[:, 1].any()))
        if _comes_back(timeline.play(shapes, numbers), plans, plan_format.units):
            return Apart(timeline, shapes, numbers, by_step)
    if kind == "none" or timeline.horizon >= _FEW_FRAMES:
        return Apart(timeline, shapes, numbers, by_step)
    return take_apart(demonstrations, "none")


def _still(plans: Plans, units: tuple[str, ...]) -> Float[np.ndarray, " D"]:
    """How far each channel may be from a pose and still count as there."""
    largest = largest_of_unit(np.ptp(plans, axis=(0, 1)), units)
    return np.maximum(_STILL * largest, _STILL_NOISE * noise(plans))


def _shapes(
    timeline: Timeline,
    plans: Continued,
    warp: Numbers,
    times: dict[int, np.ndarray],
    tau: Float[np.ndarray, " L"],
) -> Float[np.ndarray, "N L C"]:
    """Sample every plan on the common phase."""
    smooth = _others(plans.plans.shape[2], timeline.steps)
    shapes = []
    for i, theta in enumerate(warp):
        parts = [plans(i, _times(theta, timeline.span, tau))[:, smooth]]
        for step in timeline.steps:
            values = plans.plans[i, :, step.channel]
            parts.append(_parts(values, step, times[step.channel][i], tau))
        shapes.append(np.concatenate(parts, axis=1))
    return np.stack(shapes)


def _parts(
    values: Float[np.ndarray, " H"], step: Step, at: np.ndarray, tau: Float[np.ndarray, " L"]
) -> Float[np.ndarray, "L M"]:
    """A step's transitions apart: the first with the value before it, the others as changes."""
    borders = np.concatenate([[0], (at[1:] + at[:-1]) // 2, [len(values) - 1]])
    found = []
    for m, phase in enumerate(step.phases):
        part = _linear(values, np.clip(tau - phase + at[m], borders[m], borders[m + 1]))
        found.append(part if m == 0 else part - values[borders[m]])
    return np.stack(found, axis=1)


def _warps(
    profiles: Float[np.ndarray, "N H S"],
    kind: WarpKind,
    decisive: Float[np.ndarray, " N"] | None,
) -> tuple[Numbers, float, bool]:
    """Return theta of each demonstration, the span of the knots, and whether a step is phase 0."""
    if kind == "none":
        return np.zeros((len(profiles), 0)), 1.0, False
    speeds = np.linalg.norm(profiles, axis=2)
    if not np.all(speeds.max(axis=1) > 0):
        raise InvalidDemonstrationsError("a demonstration does not move, so it cannot be timed")
    # Phase 0 is the middle of the motion, in the mean, or a step that goes with the motion.
    starts = np.mean([middle(speed) for speed in speeds]) - correlation_lags(profiles)
    length = float(np.median([np.ptp(motion_span(speed)) for speed in speeds]))
    by_step = decisive is not None and bool(np.std(decisive - starts) <= _GOES_WITH * length)
    if decisive is not None and by_step:
        starts = decisive
    if kind == "start":
        if not by_step:
            starts = _together_when_fastest(profiles, starts, length)
        return starts[:, None], 1.0, by_step
    span = length
    warp = _refine(profiles, np.stack([starts, np.zeros_like(starts)], axis=1), span)
    if kind == "warp":
        warp = np.concatenate([warp[:, :1], np.repeat(warp[:, 1:], _KNOTS, axis=1)], axis=1)
        warp = _refine(profiles, warp, span)
    return warp, span, by_step


def _together_when_fastest(
    profiles: Float[np.ndarray, "N H S"], starts: Float[np.ndarray, " N"], length: float
) -> Float[np.ndarray, " N"]:
    """Move starts to where motions agree best around the moment at which they are fastest.

    What is thrown leaves about then, so there positions and velocities have to be mixed; where
    paces differ, motions that agree best as a whole do not agree there. Where motions differ too
    much to say so, starts stay: their mean has too small a share in them, or one would have to go
    far. Of increments it is the moment at which they change most.
    """
    horizon = profiles.shape[1]
    tau = np.arange(-horizon * _FINE, horizon * _FINE + 1) / _FINE
    clock = np.arange(horizon, dtype=float)
    unit = profiles / np.sqrt(np.sum(profiles**2, axis=(1, 2), keepdims=True))
    reach = int(_SEARCHED * length * _FINE)
    steps = np.arange(-reach, reach + 1)
    size = 2 * len(tau)  # padded: what is moved never wraps around
    moved = starts
    for _ in range(_ROUNDS):
        played = np.stack(
            [
                np.stack([np.interp(tau + s, clock, p, left=0.0, right=0.0) for p in each.T])
                for s, each in zip(moved, unit, strict=True)
            ]
        )
        mean = played.mean(axis=0)
        fastest = tau[np.argmax(np.linalg.norm(mean, axis=0))]
        window = np.exp(-0.5 * ((tau - fastest) / (_AROUND * length)) ** 2)
        template = np.fft.rfft(window * mean, size).conj()
        alike = np.fft.irfft(np.sum(np.fft.rfft(played, size) * template, axis=1), size)
        energy = np.fft.irfft(
            np.fft.rfft(np.sum(played**2, axis=1), size) * np.fft.rfft(window, size).conj(), size
        )
        if alike[:, 0].sum() < _SHARED * energy[:, 0].sum():
            return starts
        score = alike[:, steps] / np.sqrt(np.maximum(energy[:, steps], _LEAST_ENERGY))
        best = np.where(score.max(axis=1) > 0.0, steps[np.argmax(score, axis=1)], 0)
        if not best.any():
            break
        moved = moved + best / _FINE
    change = moved - starts
    change -= change.mean()
    if not _SAME * length <= np.abs(change).max() <= _SEARCHED * length:
        return starts
    return starts + change


def _refine(profiles: Float[np.ndarray, "N H S"], warp: Numbers, span: float) -> Numbers:
    """Move each demonstration's warp to where its square-root velocity fits the mean of all."""
    from scipy.optimize import least_squares

    horizon = profiles.shape[1]
    tau = np.arange(-horizon / 2, horizon / 2 + 1, max(1.0, span / _COMPARED))
    clock = np.arange(horizon, dtype=float)
    scales = np.sqrt(np.sum(profiles**2, axis=(1, 2)))
    unit = profiles / scales[:, None, None]

    def root_velocity(i: int, theta: np.ndarray) -> np.ndarray:
        t = _times(theta, span, tau)
        slope = np.exp(_rho(theta, span, tau))
        played = np.stack([np.interp(t, clock, p, left=0.0, right=0.0) for p in unit[i].T], axis=1)
        return np.asarray(played * np.sqrt(slope)[:, None])

    bound = np.full(warp.shape[1], _LARGEST_TEMPO)
    bound[0] = horizon
    warp = np.clip(warp, -bound, bound)
    for _ in range(_ROUNDS):
        mean = np.mean([root_velocity(i, theta) for i, theta in enumerate(warp)], axis=0)
        moved = []
        for i, theta in enumerate(warp):

            def misfit(x: np.ndarray, i: int = i, mean: np.ndarray = mean) -> np.ndarray:
                off = (root_velocity(i, x) - mean).ravel()
                rho = x[1:]
                return np.concatenate([off, np.sqrt(_STIFFNESS / len(rho)) * (rho - rho.mean())])

            scale = np.where(np.arange(len(theta)) == 0, 1.0, 0.05)
            moved.append(
                least_squares(misfit, theta, bounds=(-bound, bound), x_scale=scale, max_nfev=12).x
            )
        warp = np.array(moved)
        warp[:, 1:] -= warp[:, 1:].mean(axis=0)
        warp = np.clip(warp, -bound, bound)
    return warp


def _rho(theta: np.ndarray, span: float, tau: np.ndarray) -> np.ndarray:
    if len(theta) < 2:
        return np.zeros_like(tau)
    knots = np.linspace(-span / 2, span / 2, len(theta) - 1) if len(theta) > 2 else np.zeros(1)
    return np.interp(tau, knots, theta[1:])


def _table(theta: np.ndarray, span: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Phase and time on a fine grid that covers `reach` frames to either side."""
    half = int(np.ceil(reach * _FINE))
    tau = np.arange(-half, half + 1) / _FINE
    slope = np.exp(_rho(theta, span, tau))
    steps = (slope[1:] + slope[:-1]) / (2 * _FINE)
    t = np.concatenate([[0.0], np.cumsum(steps)])
    return tau, theta[0] + t - t[half]


def _times(theta: np.ndarray, span: float, tau: np.ndarray) -> np.ndarray:
    """t(tau)."""
    if len(theta) < 1:
        return tau
    if len(theta) <= 2:
        return np.asarray(theta[0] + np.exp(_rho(theta, span, tau)) * tau)
    table, t = _table(theta, span, np.abs(tau).max() + 1)
    return np.interp(tau, table, t)


def _inverse(theta: np.ndarray, span: float, t: np.ndarray) -> np.ndarray:
    """tau(t)."""
    if len(theta) < 1:
        return t
    if len(theta) <= 2:
        return np.asarray((t - theta[0]) / np.exp(_rho(theta, span, np.zeros(1))))
    reach = np.abs(t - theta[0]).max() * np.exp(_LARGEST_TEMPO) + 1
    table, at = _table(theta, span, reach)
    return np.interp(t, at, table)


def _sample(values: Float[np.ndarray, "L C"], at: Float[np.ndarray, " H"]) -> np.ndarray:
    """Smooth channels at parts of frames; their ends are held."""
    from scipy.interpolate import make_interp_spline

    if not values.shape[1]:
        return np.empty((len(at), 0))
    at = np.clip(at, 0.0, len(values) - 1)
    spline = make_interp_spline(
        np.arange(len(values), dtype=float), values, k=min(3, len(values) - 1)
    )
    return np.asarray(spline(at))


def _eased(plan: Float[np.ndarray, "H C"], *, at_end: bool) -> Float[np.ndarray, "H C"]:
    """The same plan, brought to rest over its last frames, or from rest over its first."""
    if not at_end:
        return _eased(plan[::-1], at_end=True)[::-1]
    frames = max(round(_EASED * len(plan)), 1)
    part = (np.arange(frames) + 1.0) / frames
    steps = np.diff(plan, axis=0)
    steps[-frames:] *= 1.0 - (part**2 * (3.0 - 2.0 * part))[:, None]
    return np.concatenate([plan[:1], plan[:1] + np.cumsum(steps, axis=0)])


def _linear(values: Float[np.ndarray, " L"], at: Float[np.ndarray, " H"]) -> np.ndarray:
    """A step at parts of frames: it never overshoots."""
    return np.interp(at, np.arange(len(values)), values)


def _comes_back(plans: Plans, expected: Plans, units: tuple[str, ...]) -> bool:
    largest = largest_of_unit(np.ptp(expected, axis=(0, 1)), units)
    off = np.sqrt(np.mean((plans - expected) ** 2, axis=1))
    return bool(np.all(off <= _EXACT * np.where(largest > 0, largest, 1.0)))


def _others(n_channels: int, steps: tuple[Step, ...]) -> list[int]:
    own = {step.channel for step in steps}
    return [d for d in range(n_channels) if d not in own]


def _unused(names: list[str], taken: list[str]) -> list[str]:
    """The names, each with underscores until no channel has it."""
    found = []
    for name in names:
        while name in taken:
            name += "_"
        found.append(name)
    return found
