r"""Phase and amplitude: a plan is a shape on a common phase, and a warp of time.

    A_i(t) = shape_i(tau_i(t))

People do not repeat a motion at the same time, nor at the same tempo. `decompose` finds shapes on
one common phase tau and a few numbers for each demonstration, the warp, so that both can be
learned; `Timeline.reconstruct` makes plans of any shapes and warps. `registration` estimates warps,
`extrapolation` extends plans beyond their recording, and `events` times channels that jump. A
channel that is held except for noise is held at its mean.

Notation:
    t      time of a plan               [frames]
    tau    phase, common to all plans   [frames]
    theta  `numbers`: the warp of a plan, then the times of its events (P,)
           start [frames], log tempo [-], times [frames]

Source: ours; separating phase from amplitude is functional data analysis [Srivastava2011].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.arrays import Plans
from prior_reinforce.generators.timing.events import Step, at_samples, find_transitions
from prior_reinforce.generators.timing.extrapolation import ExtrapolatedPlans
from prior_reinforce.generators.timing.registration import Motions, WarpKind, phases_at, times_at
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.signals import moving_rows, without_noise
from prior_reinforce.plans.speeds import SMOOTHING, largest_of_unit, velocity_profiles

Numbers = Float[np.ndarray, "n P"]
Shapes = Float[np.ndarray, "n L C"]
"""Channels that share the warp first, then the parts of those with events."""

_EXACT = 2e-5
"""Largest reconstruction error of demonstrations, as a part of the largest range of their unit,
rms, before shapes are sampled more finely. Ours: a tenth of a milliradian of 5 rad. Plans of 16
frames are reconstructed to 2e-3: too few frames to be shifted by fractions of one without a loss
(reproduction/docs/decisions-generator.md)."""
_LOSSY = 2e-2
"""Demonstrations with a larger reconstruction error are not timed at all. Ours: smooth swings of
five frames are reconstructed to 1.6e-2, five frames that jump about to 4e-2."""
_OVERSAMPLING = (1, 2, 4)
"""Samples of a shape for each frame that are tried. Ours: with one alone, plans that are cut in
mid-swing and noisy ones are reconstructed to 0.5 % of a range."""
_EASING = 0.1
"""Part of the frames over which a motion that is cut off comes to rest. Ours: the ends of our
tele-operated plans are cut at 1 to 4 % of their largest speed, which stops well within limits."""


@dataclass(frozen=True)
class Timeline:
    """The common phase of demonstrations, which maps shapes and warps to plans."""

    kind: WarpKind
    horizon: int
    """H."""
    n_channels: int
    """D."""
    first: int
    """Phase of a shape's first frame."""
    per_frame: int
    """Samples of a shape for each frame of phase."""
    linear: tuple[int, ...]
    """Channels that jump, but not equally often in all demonstrations: they share the warp, and are
    interpolated linearly, so that they do not overshoot."""
    steps: tuple[Step, ...]
    lowest: tuple[float, ...]
    """Lower bound of each number: the demonstrated range below the least demonstrated one. Ours:
    timing is extrapolated like shapes, but no further."""
    highest: tuple[float, ...]
    """Upper bound, likewise."""
    pose_band: tuple[float, ...]
    """How far each of the D channels may be from a pose and still count as there."""
    rests: tuple[bool, bool] = (False, False)
    """Whether all demonstrations rest at their first frame, and at their last. Then plans do, too:
    a motion that would be cut off there is eased to rest instead."""

    @property
    def n_numbers(self) -> int:
        """P, numbers of a warp and of events."""
        return len(self.lowest)

    @property
    def shared(self) -> list[int]:
        """The channels that share the warp."""
        stepped = {step.channel for step in self.steps}
        return [d for d in range(self.n_channels) if d not in stepped]

    def reconstruct(self, shapes: Shapes, numbers: Numbers) -> Plans:
        """Make plans of shapes, as from `decompose`, and numbers theta.

        theta is clipped to `lowest` and `highest`.
        """
        plans = np.full((len(shapes), self.horizon, self.n_channels), np.nan)
        if not (np.all(np.isfinite(shapes)) and np.all(np.isfinite(numbers))):
            # The generator diverged; executors refuse plans that are not finite.
            return plans
        n_warp = self.n_numbers - sum(len(step.phases) for step in self.steps)
        warps, events = np.split(np.clip(numbers, self.lowest, self.highest), [n_warp], axis=1)
        t, shared = np.arange(self.horizon, dtype=float), self.shared
        eased = [d for d in shared if d not in self.linear]  # a channel that jumps has no slope
        phases = phases_at(warps, t)
        cut = self.cut_off(shapes, warps) & self.rests
        for plan, shape, tau, times, (at_start, at_end) in zip(
            plans, shapes, phases, events, cut, strict=True
        ):
            samples = (tau - self.first) * self.per_frame
            plan[:, shared] = _sample(shape[:, : len(shared)], samples)
            for d in self.linear:
                plan[:, d] = at_samples(shape[:, shared.index(d)], samples)
            if at_start:
                plan[:, eased] = _eased(plan[::-1, eased])[::-1]
            if at_end:
                plan[:, eased] = _eased(plan[:, eased])
            k, m = len(shared), 0
            for step in self.steps:
                n = len(step.phases)
                phases_of_parts = t + (np.array(step.phases) - times[m : m + n])[:, None]
                samples = (phases_of_parts - self.first) * self.per_frame
                plan[:, step.channel] = step.join(shape[:, k + m : k + m + n], samples)
                m += n
        return plans

    def cut_off(self, shapes: Shapes, warps: Numbers) -> Bool[np.ndarray, "n 2"]:
        """Return whether each motion begins before the first frame, and ends after the last."""
        cut = np.zeros((len(shapes), 2), dtype=bool)
        moved = [k for k, d in enumerate(self.shared) if d not in self.linear]
        band = np.array(self.pose_band)[[self.shared[k] for k in moved]]
        for i, shape in enumerate(shapes if warps.shape[1] else ()):
            rows = moving_rows(shape[:, moved], band)
            if rows is not None:
                phases = self.first + np.array(rows) / self.per_frame
                begins, ends = times_at(warps[i : i + 1], phases)[0]
                cut[i] = begins < 0.0, ends > self.horizon - 1
        return cut

    def names(self, plan_format: PlanFormat) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return names, and units, of the C channels of a shape and then of the P numbers."""
        names = [plan_format.names[d] for d in self.shared]
        units = [plan_format.units[d] for d in self.shared]
        events = []
        for step in self.steps:
            name = plan_format.names[step.channel]
            changes = [f"{name}, change {m + 1}" for m in range(len(step.phases))]
            names += changes
            units += [plan_format.units[step.channel]] * len(changes)
            events += [f"time of {change}" for change in changes]
        warp = ("start", "tempo")[: self.n_numbers - len(events)]
        numbers = _unused([*warp, *events], names)
        of_numbers = *("frame", "log")[: len(warp)], *["frame"] * len(events)
        return (*names, *numbers), (*units, *of_numbers)


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Demonstrations as shapes and warps."""

    timeline: Timeline
    shapes: Float[np.ndarray, "N L C"]
    units: tuple[str, ...]
    """Of the C channels of a shape."""
    numbers: Numbers
    """theta of each demonstration."""
    by_step: bool
    """Whether phase 0 is the transition of a channel, such as a hand that opens."""
    exact: bool
    """Whether the demonstrations are reconstructed."""


@lru_cache(maxsize=8)  # patterns, the choice of timing and the generator ask for the same one
def decompose(
    demonstrations: Demonstrations, kind: WarpKind, subset: tuple[int, ...] = ()
) -> Decomposition:
    """Find the warp of each demonstration, or of a subset, and its shape on the common phase.

    Noise, jumps and the scales of channels are estimated from all. The decomposition is of kind
    `none` if the requested one would lose part of the motion. InvalidDemonstrationsError if nothing
    moves, so that nothing can be timed.
    """
    signals, horizon = demonstrations.signals, demonstrations.horizon
    units = demonstrations.format.units
    plans, transitions, motions = _motions(demonstrations)
    rows = list(subset) or slice(None)
    plans, transitions = plans[rows], {d: each[rows] for d, each in transitions.items()}
    warps, by_step = motions.register(kind, rows)
    # Whole frames, so that a transition is reproduced as recorded.
    times = {d: np.round(each).astype(int) for d, each in transitions.items() if each.shape[1]}
    steps = tuple(
        Step(
            d,
            tuple(round(float(phase)) for phase in transitions[d].mean(axis=0)),
            tuple(np.unique(plans[:, :, d]).tolist()) if signals.kinds[d] == "switch" else (),
        )
        for d in times
    )
    numbers = np.concatenate([warps, *times.values()], axis=1)
    ends = np.array([0.0, horizon - 1.0])
    spans = [phases_at(warps, ends)]
    spans += [ends + np.ravel(step.phases - times[step.channel])[:, None] for step in steps]
    first = int(np.floor(min(each[:, 0].min() for each in spans)))
    last = int(np.ceil(max(each[:, 1].max() for each in spans)))
    spread = np.ptp(numbers, axis=0)
    timeline = Timeline(
        kind=kind,
        horizon=horizon,
        n_channels=len(units),
        first=first,
        per_frame=1,
        linear=tuple(d for d in np.flatnonzero(signals.jumps).tolist() if d not in transitions),
        steps=steps,
        lowest=tuple((numbers.min(axis=0) - spread).tolist()),
        highest=tuple((numbers.max(axis=0) + spread).tolist()),
        pose_band=tuple(signals.pose_band.tolist()),
    )
    speeds = np.linalg.norm(motions.profiles[rows], axis=2)
    extrapolated = ExtrapolatedPlans(plans, signals.jumps, speeds)
    size = largest_of_unit(np.ptp(plans, axis=(0, 1)), units)
    size = np.where(size > 0, size, 1.0)
    for per_frame in _OVERSAMPLING:
        tau = first + np.arange((last - first) * per_frame + 1) / per_frame
        shapes = np.stack(
            [
                np.concatenate(
                    [
                        extrapolated(i, t)[:, timeline.shared],
                        *(s.split(plans[i, :, s.channel], times[s.channel][i], tau) for s in steps),
                    ],
                    axis=1,
                )
                for i, t in enumerate(times_at(warps, tau))
            ]
        )
        timeline = replace(timeline, per_frame=per_frame)
        cut = timeline.cut_off(shapes, warps)
        timeline = replace(timeline, rests=(not cut[:, 0].any(), not cut[:, 1].any()))
        errors = np.sqrt(np.mean((timeline.reconstruct(shapes, numbers) - plans) ** 2, axis=1))
        exact = bool(np.all(errors <= _EXACT * size))
        if exact:
            break
    if kind != "none" and np.any(errors > _LOSSY * size):
        return decompose(demonstrations, "none", subset)
    shape_units = timeline.names(demonstrations.format)[1][: shapes.shape[2]]
    return Decomposition(timeline, shapes, shape_units, numbers, by_step, exact)


@lru_cache(maxsize=2)  # all kinds of warps use the same ones
def _motions(
    demonstrations: Demonstrations,
) -> tuple[Plans, dict[int, Float[np.ndarray, "N M"]], Motions]:
    """Return plans without noise, transitions of channels that jump, and motions of the others."""
    signals, units = demonstrations.signals, demonstrations.format.units
    plans = without_noise(demonstrations.plans, signals.held)
    transitions = find_transitions(plans, signals)
    smooth = [d for d in range(len(units)) if d not in transitions]
    profiles = velocity_profiles(
        plans[:, :, smooth], [units[d] for d in smooth], SMOOTHING / demonstrations.format.dt
    )
    lasts = [times[:, -1] for times in transitions.values() if times.shape[1]]
    decisive = max(lasts, key=lambda last: float(last.mean()), default=None)
    return plans, transitions, Motions(np.stack(profiles), decisive)


def _sample(values: Float[np.ndarray, "L C"], at: Float[np.ndarray, " H"]) -> np.ndarray:
    """Interpolate smooth channels at fractional samples; their ends are held."""
    from scipy.interpolate import make_interp_spline

    if not values.shape[1]:
        return np.empty((len(at), 0))
    last = len(values) - 1
    spline = make_interp_spline(np.arange(last + 1.0), values, k=min(3, last))
    return np.asarray(spline(np.clip(at, 0.0, last)))


def _eased(plan: Float[np.ndarray, "H C"]) -> Float[np.ndarray, "H C"]:
    """Bring a plan to rest over its last frames."""
    frames = max(round(_EASING * len(plan)), 1)
    part = (np.arange(frames) + 1.0) / frames
    steps = np.diff(plan, axis=0)
    steps[-frames:] *= 1.0 - (part**2 * (3.0 - 2.0 * part))[:, None]
    return np.concatenate([plan[:1], plan[:1] + np.cumsum(steps, axis=0)])


def _unused(names: list[str], taken: list[str]) -> list[str]:
    """Append underscores to names that are taken."""
    unused = []
    for name in names:
        while name in taken:
            name += "_"
        unused.append(name)
    return unused
