"""When a motion starts, coded as one number beside the motion itself.

Demonstrations of one throw start at different times. Code them frame by frame and a network that
is asked for something between two of them averages a swing that has begun with one that has not,
which slows it: a throw 0.1 s too early and one 0.1 s too late average to one that lands 8 cm short
(docs/tasks/basketball.md). Here every plan is cut out of its own resting ends and its start time
becomes an extra channel of the code, so that the diffusion model generates both together. Whole
frames are moved, so nothing is lost: plans come back as recorded.

Ours; the paper leaves the misalignment to the network, or removes it by hand ("Timeline Aligned
Variants"). Start time and duration are parameters of their own in movement primitives as well
[Ijspeert2013]. Only where all demonstrations start and end at rest; else nothing is cut out, and
`StartTimeCodec.whole_because` says why.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import betainc
from typing_extensions import Self

from prior_reinforce.plans.alignment import AlignmentConfig, NotAtRestError, align
from prior_reinforce.plans.codec import PlanCodec, Representation
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import velocity_profiles

_PADDING = 4
"""Resting frames kept at either end of the cut-out motion, if there are as many: about one control
point, which a spline needs to come to rest."""
_TREMOR = 0.05
"""Where a hand's tremor never rests, slower than this part of a demonstration's peak speed counts
as rest. Ours: tremor of the shipped tele-operated sets reaches 0.03, their motions start within two
frames of it."""
_TREMOR_LOST = 0.01
"""What holding may change of any demonstration, rms: this part of the largest range among the
dimensions of that unit. Ours: the shipped tele-operated sets lose at most 0.008, and land within
5 mm of where they did."""
_TREMOR_PADDING = 12
"""`_PADDING` where rest is told from speed: a motion's slow onset is then kept well inside."""


@dataclass(frozen=True, eq=False)
class StartTimeCodec:
    """Turns plans into codes of a motion and its start, and back; made by `fit`."""

    motion: PlanCodec
    """Codec of the cut-out motions, or of whole plans where `starts` is None."""
    horizon: int
    """H, frames of a whole plan."""
    starts: tuple[int, int] | None
    """Earliest and latest frame at which a demonstration's cut-out begins; None where start times
    are not coded."""
    whole_because: str | None = None
    """What kept start times from being coded although they differ, as a clause: which demonstration
    and which end. None where they are coded, or all the same, or were not to be."""

    @classmethod
    def fit(
        cls,
        demonstrations: Demonstrations,
        *,
        start_times: bool,
        representation: Representation,
        frames_per_point: int,
        length_multiple: int,
        margin: float,
    ) -> tuple[Self, np.ndarray]:
        """Choose a code, and code the demonstrations.

        Args:
            demonstrations: N plans (N, H, D).
            start_times: Code start times as a channel of their own, where that is possible.
            representation: See `PlanCodec.fit`, and so are the next three.
            frames_per_point: Frames for each control point.
            length_multiple: T will be a multiple of this.
            margin: How far generated plans may leave the demonstrated range.

        Returns:
            The codec, and codes of the demonstrations, shape (N, C, T).
        """
        plans = demonstrations.plans
        cut, whole_because = None, None
        if start_times:
            try:
                cut = _cut(demonstrations)
            except NotAtRestError as error:
                whole_because = error.where
            except _CannotCutError as error:
                whole_because = str(error)
        if cut is not None:
            plans = _settled(_moved(plans, -cut.begins, cut.length), cut.before, cut.after)
        motion = PlanCodec.fit(
            plans,
            representation=representation,
            frames_per_point=frames_per_point,
            length_multiple=length_multiple,
            margin=margin,
        )
        codes = motion.encode(plans)
        if cut is None:
            return cls(motion, demonstrations.horizon, None, whole_because), codes
        codec = cls(motion, demonstrations.horizon, (int(cut.begins.min()), int(cut.begins.max())))
        centre, half = codec._scale()
        start = ((cut.begins - centre) / half)[:, None, None]
        channel = np.broadcast_to(start, (len(codes), 1, codes.shape[2]))
        return codec, np.concatenate([codes, channel], axis=1)

    @property
    def channels(self) -> int:
        """C, the numbers of a code at one position."""
        return self.motion.channels + (self.starts is not None)

    @property
    def length(self) -> int:
        """T, the positions of a code."""
        return self.motion.length

    @property
    def action_dim(self) -> int:
        """D."""
        return len(self.motion.smooth)

    def decode(self, codes: np.ndarray) -> np.ndarray:
        """Return plans (n, H, D) of codes (n, C, T)."""
        if self.starts is None:
            return self.motion.decode(codes)
        centre, half = self._scale()
        begins = codes[:, -1].mean(axis=1) * half + centre
        whole = np.clip(np.round(begins), *self.starts).astype(int)
        return _moved(self.motion.decode(codes[:, :-1]), whole, self.horizon)

    def settings(self) -> dict[str, Any]:
        """Everything but the arrays, as JSON types."""
        starts = None if self.starts is None else list(self.starts)
        return {
            "motion": self.motion.settings(),
            "horizon": self.horizon,
            "starts": starts,
            "whole_because": self.whole_because,
        }

    @classmethod
    def restore(
        cls, settings: dict[str, Any], plan_range: np.ndarray, code_range: np.ndarray
    ) -> Self:
        """Rebuild a codec from its `settings` and the motion codec's arrays."""
        starts = settings["starts"]
        return cls(
            PlanCodec.restore(settings["motion"], plan_range, code_range),
            int(settings["horizon"]),
            None if starts is None else (int(starts[0]), int(starts[1])),
            # Not in models that were saved before it was kept; they generate the same.
            settings.get("whole_because"),
        )

    def _scale(self) -> tuple[float, float]:
        assert self.starts is not None
        earliest, latest = self.starts
        return (latest + earliest) / 2, (latest - earliest) / 2


class _CannotCutError(Exception):
    """Start times differ and cannot be coded; the message says why, as a clause."""


@dataclass(frozen=True, eq=False)
class _Cut:
    """Where the motions are cut out."""

    begins: np.ndarray
    """Frame at which each demonstration's cut-out begins, shape (N,)."""
    length: int
    """Frames of every cut-out; outside it a demonstration holds its ends."""
    before: int
    """Frames of it before the first motion begins."""
    after: int
    """Frames of it after the last motion has ended."""


def _cut(demonstrations: Demonstrations) -> _Cut | None:
    """Find the cut-outs; None where start times do not differ.

    They cannot be told where a demonstration moves at an end that would have to be held, nor moved
    where the longest motion with the latest start would not end within the plan. Where hands
    tremble to the very ends, no frame rests exactly; what is slow there is held instead.

    Raises:
        NotAtRestError: They cannot be told.
        _CannotCutError: They cannot be moved, or the tremor is too large to be held.
    """
    delays = -np.round(align(demonstrations).shifts / demonstrations.format.dt).astype(int)
    if np.ptp(delays) == 0:
        return None
    plans = demonstrations.plans
    moving = [np.flatnonzero(np.any(plan[1:] != plan[:-1], axis=1)) for plan in plans]
    with suppress(_CannotCutError):
        return _window(moving, delays, demonstrations.horizon, _PADDING)
    smoothing = AlignmentConfig().smoothing / demonstrations.format.dt
    profiles = velocity_profiles(plans, demonstrations.format.units, smoothing)
    speeds = np.linalg.norm(profiles, axis=2)
    moving = [np.flatnonzero(speed > _TREMOR * speed.max()) for speed in speeds]
    cut = _window(moving, delays, demonstrations.horizon, _TREMOR_PADDING)
    _check_held(cut, demonstrations)
    return cut


def _check_held(cut: _Cut, demonstrations: Demonstrations) -> None:
    """Refuse to hold ends that do not tremble but move."""
    plans, plan_format = demonstrations.plans, demonstrations.format
    motions = _settled(_moved(plans, -cut.begins, cut.length), cut.before, cut.after)
    squares = (_moved(motions, cut.begins, demonstrations.horizon) - plans) ** 2
    ranges, units = np.ptp(plans, axis=(0, 1)), np.array(plan_format.units)
    largest = np.array([ranges[units == unit].max() for unit in units])
    lost = np.sqrt(np.mean(squares, axis=1))
    if np.all(lost <= _TREMOR_LOST * largest):
        return
    share = lost / np.where(largest > 0, largest, 1.0)
    i, d = np.unravel_index(share.argmax(), share.shape)
    middle = int(cut.begins[i]) + cut.length // 2
    end = "before" if squares[i, :middle, d].sum() > squares[i, middle:, d].sum() else "after"
    raise _CannotCutError(
        f"demonstration {i} does not rest {end} its motion: holding {plan_format.names[d]} still "
        f"there would change it by {share[i, d]:.1%} of the largest range, rms (at most "
        f"{_TREMOR_LOST:.0%} counts as tremor)"
    )


def _window(moving: list[np.ndarray], delays: np.ndarray, horizon: int, padding: int) -> _Cut:
    """The shortest common cut-out that holds every motion, if it fits into the plan at any start.

    A slower motion may be generated with a later start than any demonstrated pair of the two: the
    cut-out has to lie within the plan at every start, so that no rest is ever cut off.

    Raises:
        _CannotCutError: It does not fit.
    """
    some = [i for i, frames in enumerate(moving) if frames.size]
    firsts = {i: int(moving[i][0] - delays[i]) for i in some}
    lasts = {i: int(moving[i][-1]) + 1 - int(delays[i]) for i in some}
    first, last = min(firsts.values()), max(lasts.values())
    before = min(padding, int(delays.min()) + first)
    after = min(padding, horizon - 1 - int(delays.max()) - last)
    if before < 0:
        raise _CannotCutError(
            f"demonstration {min(firsts, key=firsts.__getitem__)}'s motion, begun as early as "
            f"demonstration {int(delays.argmin())}'s, would begin {-before} frames before the plan"
        )
    if after < 0:
        raise _CannotCutError(
            f"demonstration {max(lasts, key=lasts.__getitem__)}'s motion, begun as late as "
            f"demonstration {int(delays.argmax())}'s, would end {-after} frames after the plan"
        )
    return _Cut(delays + first - before, last - first + 1 + before + after, before, after)


def _moved(plans: np.ndarray, by: np.ndarray, length: int) -> np.ndarray:
    """Plans (n, H, D) that many frames later, their ends held, cut to a length; (n, length, D)."""
    frames = np.clip(np.arange(length) - by[:, None], 0, plans.shape[1] - 1)
    return plans[np.arange(len(plans))[:, None], frames]


def _settled(motions: np.ndarray, before: int, after: int) -> np.ndarray:
    """Motions (n, L, D) that grow out of their first frame and die down to their last, smoothly.

    Where ends rest exactly nothing changes; tremor that is cut in mid-swing would jerk the arm.
    """
    frames = np.arange(motions.shape[1])
    rise = betainc(3, 3, np.minimum(1.0, frames / max(1, before)))[:, None]
    fall = betainc(3, 3, np.minimum(1.0, frames[::-1] / max(1, after)))[:, None]
    first, last = motions[:, :1], motions[:, -1:]
    settled = first + rise * (motions - first)
    return np.asarray(last + fall * (settled - last))
