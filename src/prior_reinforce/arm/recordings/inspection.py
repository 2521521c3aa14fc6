"""Report on recordings before an import: time, channels, rests, noise, limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from prior_reinforce.arm.recordings.appending import check_scale, copies
from prior_reinforce.arm.recordings.naming import find_channels
from prior_reinforce.arm.recordings.preprocessing import Preprocessed, Preprocessing, preprocess
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.takes import all_return, odd_starts
from prior_reinforce.arm.recordings.turns import aligned
from prior_reinforce.arm.recordings.units import (
    CHANNEL_UNITS,
    Ambiguity,
    raise_if_ambiguous,
    say_names,
    split_unit,
)
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import RobotLimits, joint_of, match_joints
from prior_reinforce.arm.robots.report import LimitLine, LimitReport
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError, InvalidPlanError
from prior_reinforce.plans.channels import zero_at_rest
from prior_reinforce.plans.interpolation import RATE
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.plan_format import PlanFormat, summed
from prior_reinforce.plans.speeds import Channels
from prior_reinforce.plans.symmetry import Symmetry
from prior_reinforce.units import UNITS, factor

_SMOOTH_HZ = 20
_SMOOTH = f"--smooth {_SMOOTH_HZ}"
"""Removes an encoder's noise; a throw has nothing above 20 Hz. Ours."""
_WORST = 2.5
"""Standard deviations by which the noisiest frame of a plan is off. Ours: measured, 30 plans of 88
frames, 2.3 to 2.9; an end leaps from rest by 1.3 to 2.4."""
_TAKE_IT = (
    "take a gripper in: new --gripper percent, or any column by its name in [plan]; what is stored "
    "beside the motion, by --key given again"
)
"""What to do about a channel that the plan lacks."""

_MUCH_NOISE = 0.25
"""Share of a limit consumed by noise alone, above which it is reported. Ours."""
_OFF = 0.01
"""By which a held joint may be off, in [m] and [rad]. Ours: a lift's play and encoder noise."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What recordings are to become and to keep to: arguments of `import_demonstrations`."""

    names: tuple[str, ...] | None = None
    plan_units: Sequence[str] | None = None
    outcome_names: Sequence[str] | None = None
    outcome_units: Sequence[str] | None = None
    preprocessing: Preprocessing | None = None
    robot: RobotLimits | None = None
    gate: GateSettings | None = None
    declared: Callable[[PlanFormat], Symmetry | None] = lambda _: None
    """How motions of a format may be moved, if they may."""
    before: Demonstrations | None = None
    """Demonstrations beside which these are to be, in their turns, signs and units."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What recordings hold, and what an import would make of them."""

    selection: Selection
    """N recordings with the plan's channels, in the plan's units."""
    processed: Preprocessed
    """The plans made of them."""
    format: PlanFormat
    """What their numbers mean."""
    wanted: Wanted
    reports: tuple[LimitReport, ...] = ()
    """The gate's verdict on each; empty if no robot is named."""

    def __repr__(self) -> str:
        """The text."""
        return self.text

    @property
    def robot(self) -> str | None:
        """The robot whose limits the demonstrations were checked against."""
        return None if self.wanted.robot is None else self.wanted.robot.robot

    @cached_property
    def copies(self) -> str:
        """Two motions that are identical; empty if there are none."""
        return copies(self.processed.plans, self.selection.episodes)

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The N recordings."""
        return self.selection.recordings

    @property
    def ambiguities(self) -> tuple[Ambiguity, ...]:
        """Units, times and names of channels that are only inferred."""
        return self.selection.ambiguities

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings, the most important first: limits, ends, gaps, ..."""
        left_out = self.selection.left_out
        moved = zero_at_rest(self.format.names, self.format.units)
        first = (
            self.copies,
            all_return(summed(self.processed.plans, moved)),
            *self.selection.remarks,
            *self._broken(),
            self._noise_warning(),
        )
        last = f"left out although it moves: {left_out} ({_TAKE_IT})" if left_out else ""
        return tuple(filter(None, (*first, last, *self.processed.remarks)))

    @property
    def _refusals(self) -> list[list[LimitLine]]:
        """What the gate refuses of each demonstration."""
        return [[one for one in r.lines if one.status == "refuse"] for r in self.reports]

    @property
    def remedy(self) -> str:
        """An option that may help if no demonstration passes the gate; else empty."""
        if not self.reports or not all(report.refused for report in self.reports):
            return ""
        if any(line.check == "position" for lines in self._refusals for line in lines):
            return self.selection.other_unit
        return _SMOOTH if self._smoothing_helps else ""

    @property
    def rows(self) -> dict[str, str]:
        """The essentials, one line each, by topic."""
        done, selection = self.processed, self.selection
        clocks = " and ".join(dict.fromkeys(r.clock for r in self.recordings if r.clock))
        recorded = _span((1 / recording.period for recording in self.recordings), ".4g")
        before, after = done.starts, self._cut_after
        cut = f"dropped {_span(before, '.2f')} s before and {_span(after, '.2f')} s after the "
        cut += "motion (--no-trim keeps them)"
        horizon = done.plans.shape[1]
        lengths = [end - start for start, end in zip(done.starts, done.ends, strict=True)]
        groups: dict[str, list[str]] = {}
        for i, name in enumerate(selection.names):
            groups.setdefault(self._unit(i, "recorded in"), []).append(name)
        return {
            "rate": f"recorded at {recorded} Hz{f' ({clocks})' if clocks else ''}, plans at "
            f"{1 / done.dt:.4g} Hz (dt {done.dt:.4g} s)",
            "channels": "; ".join(f"{say_names(n)} [{unit}]" for unit, n in groups.items()),
            "still ends": cut if max(*before, *after) > 0 else "nothing dropped",
            "length": f"motions of {_span(lengths, '.2f')} s, plans of {horizon} frames "
            f"({(horizon - 1) * done.dt:.2f} s)"
            + (f"; {done.held} hold their last pose" if done.held else ""),
            "noise": self._noise(),
            "motion": self._motion(),
            **({"limits": self._limits()} if self.robot is not None else {}),
        }

    @property
    def text(self) -> str:
        """Everything: rows, remarks, ambiguities, a table of episodes and one of channels."""
        guesses = [f"  - {one.what} ({one.option})" for one in self.ambiguities]
        head = ["", "what is only guessed:", *guesses] if guesses else []
        parts = [in_rows(self.rows, self.remarks), *head, "", *self._episodes(), ""]
        return "\n".join([*parts, *self._channels()])

    @property
    def _cut_after(self) -> list[float]:
        """Time dropped after each motion, in [s]."""
        ends = zip(self.recordings, self.processed.ends, strict=True)
        return [recording.duration - end for recording, end in ends]

    def _unit(self, channel: int, recorded_in: str) -> str:
        """Unit of a channel, and the one it was recorded in if that is another."""
        unit, recorded = self.selection.units[channel], self.selection.recorded_units[channel]
        return unit if unit == recorded else f"{unit}, {recorded_in} {recorded}"

    def _episodes(self) -> list[str]:
        rows = [["episode", "frames", "Hz", "length s", "cut before s", "cut after s"]]
        spans = zip(self.recordings, self.processed.starts, self._cut_after, strict=True)
        for recording, start, after in spans:
            seconds = [f"{n:.2f}" for n in (recording.duration, start, after)]
            counts = [str(len(recording.times)), f"{1 / recording.period:.4g}"]
            rows.append([recording.episode, *counts, *seconds])
        return _columns(rows)

    def _channels(self) -> list[str]:
        rows = [["channel", "recorded as", "unit", "least", "most", "noise", ""]]
        every = np.concatenate([recording.positions for recording in self.recordings])
        recorded = zip(self.selection.names, self.recordings[0].columns, strict=True)
        for i, names in enumerate(recorded):
            ranges = (f"{every[:, i].min():.4g}", f"{every[:, i].max():.4g}")
            noise = say_small(self.processed.noise[i], self.selection.units[i])
            held = "held" if i in self.processed.held_channels else ""
            rows.append([*names, self._unit(i, "from"), *ranges, noise, held])
        return _columns(rows)

    def _limits(self) -> str:
        if not self.reports:
            return f"{self.robot}: not checked"
        refused = sum(report.refused for report in self.reports)
        of_themselves = {"demonstrations", "range", "speed", "box"}
        unchecked = {c for r in self.reports for c in r.unchecked} - of_themselves
        open_ = f"; not checked: {', '.join(sorted(unchecked))}" if unchecked else ""
        n = len(self.reports)
        verdict = "the demonstration passes" if n == 1 else f"all {n} demonstrations pass"
        if refused:
            verdict = f"{refused} of {n} demonstrations break a limit"
        return f"{self.robot}: {verdict}{open_}"

    def _broken(self) -> list[str]:
        """Limits that demonstrations break; plans like them will be refused."""
        said: dict[str, list[str]] = {}
        for recording, lines in zip(self.recordings, self._refusals, strict=False):
            for line in lines:
                said.setdefault(line.check, []).append(f"{recording.episode} ({line.text})")
        found = [
            f"the gate refuses {check}: {', '.join(episodes)}" for check, episodes in said.items()
        ]
        if said.keys() & {"acceleration", "jerk"} and self._smoothing_helps:
            found.append(f"with {_SMOOTH} fewer demonstrations break a limit")
        return found

    def _noise(self) -> str:
        names, units, done = self.selection.names, self.selection.units, self.processed
        noisiest = int(np.argmax(done.noise))
        most, seen = done.noise[noisiest], "none found"
        if most > 1e-9:
            seen = f"up to {say_small(most, units[noisiest])} at rest ({names[noisiest]})"
        held = say_names([names[i] for i in done.held_channels])
        said = f"{seen}; {f'{held} held still' if held else 'every channel moves'}"
        if done.smoothed is None:
            return said
        rms, largest = done.smoothed[:, 0], done.smoothed[:, 1]
        episode, channel = divmod(int(np.argmax(largest)), largest.shape[1])
        unit = units[channel]
        return (
            f"{said}; smoothing changed plans by {say_small(rms.max(), unit)} rms, at most "
            f"{say_small(largest[episode, channel], unit)} ({names[channel]} of "
            f"{self.recordings[episode].episode})"
        )

    def _motion(self) -> str:
        names, units = self.selection.names, self.selection.units
        plans = summed(self.processed.plans, self.format.increments)  # where increments lead
        ranges = np.ptp(plans, axis=(0, 1))
        most = int(np.argmax(ranges))
        speeds = np.abs(np.diff(plans, axis=1)).max(axis=1) / self.processed.dt
        episode, joint = np.unravel_index(int(np.argmax(speeds)), speeds.shape)
        where = f"{names[joint]} of {self.recordings[episode].episode}"
        return (
            f"{names[most]} moves most, over {ranges[most]:.3g} {units[most]}; fastest is "
            f"{where}, {speeds[episode, joint]:.3g} {units[joint]}/s"
        )

    def _noise_warning(self) -> str:
        """Share of a limit consumed by noise, if significant; noise on held channels is ignored."""
        names, limits, processed = self.selection.names, self.wanted.robot, self.processed
        if limits is None or not self.reports or processed.smoothed is not None:
            return ""
        period = max(processed.dt, max(recording.period for recording in self.recordings))
        if 2 * _SMOOTH_HZ * period >= 1:  # so few frames hardly tell noise from motion
            return ""
        accelerations = acceleration_of(processed.noise, period)
        shares = [(0.0, "")]
        for joint, channel in match_joints(self.format, limits).items():
            for what, most, scale in (
                ("acceleration", limits.acceleration, 1.0),
                ("jerk", limits.jerk, RATE),  # an end leaps to its acceleration in one cycle
            ):
                if most is not None and channel not in processed.held_channels:
                    share = float(accelerations[channel] * scale / most[joint])
                    shares.append((share, f"the {what} limit of {names[channel]}"))
        share, where = max(shares)
        if share < _MUCH_NOISE:
            return ""
        return f"noise alone takes up about {share:.0%} of {where}: {_SMOOTH} takes it out"

    @cached_property
    def _smoothing_helps(self) -> bool:
        """Whether more demonstrations pass once smoothed; tried, as motion breaks limits too."""
        broken = [{line.check for line in lines} for lines in self._refusals]
        out_of_range = all("position" in each for each in broken if each)
        if self.processed.smoothed is not None or out_of_range:
            return False
        how = replace(self.wanted.preprocessing or Preprocessing(), smooth=_SMOOTH_HZ)
        try:
            smooth = inspect(self.selection, replace(self.wanted, preprocessing=how, before=None))
        except ConfigurationError:  # recordings too short to be smoothed
            return False
        return sum(r.refused for r in smooth.reports) < sum(r.refused for r in self.reports)


def inspect(selection: Selection, wanted: Wanted) -> Inspection:
    """Make plans of recordings, and check each against the robot's limits, if units allow it.

    InvalidDemonstrationsError as in `check_held`, `check_scale`, `aligned` and `preprocess`;
    UnclearUnitsError where a unit that cannot be guessed may be why; ConfigurationError if settings
    contradict each other.
    """
    robot, before = wanted.robot, wanted.before
    check_held(selection.recordings, robot)
    if before is not None:
        check_scale(before, selection)
    try:
        selection, form = aligned(selection, robot, before)
    except InvalidDemonstrationsError:
        raise_if_ambiguous(selection.ambiguities, take_guesses=True)  # counts, for radians, leap
        raise
    how = wanted.preprocessing or Preprocessing()
    processed = preprocess(selection.recordings, form, how)
    form = replace(form, dt=processed.dt)
    shown = () if before is None else before.plans
    odd = odd_starts([*shown], [*processed.plans], selection.episodes, form.names, form.units)
    selection = replace(selection, remarks=(*selection.remarks, *odd))
    reports: tuple[LimitReport, ...] = ()
    if robot is not None:
        with suppress(InvalidPlanError):
            plans = [Plan(plan, form) for plan in processed.plans]
            reports = tuple(check_plan(plan, robot, None, wanted.gate) for plan in plans)
    return Inspection(selection, processed, form, wanted, reports)


def check_held(recordings: Sequence[Recording], robot: RobotLimits | None) -> None:
    """Refuse recordings in which a held joint stands elsewhere: InvalidDemonstrationsError."""
    held = {} if robot is None else robot.held
    joints = list(held)
    for i, (joint, at) in enumerate(held.items()):
        elsewhere: dict[tuple[float, float], list[str]] = {}
        for recording in recordings:
            for column, (low, high, _) in recording.beside.items():
                name = split_unit(column, CHANNEL_UNITS)[0]
                own = find_channels([joint], [column]) and joint_of(name, joints) in (None, i)
                if own and not _stands_at(at, column, low, high):
                    span = float(f"{low:.3g}"), float(f"{high:.3g}")
                    elsewhere.setdefault(span, []).append(recording.episode)
        if elsewhere:
            each = [
                (f"at {low:.4g}" if high - low <= _OFF else f"from {low:.4g} to {high:.4g}")
                + f" in {say_names(episodes)}"
                for (low, high), episodes in elsewhere.items()
            ]
            raise InvalidDemonstrationsError(
                f"{joint} is recorded {', '.join(each)}, but this robot holds it still at {at:g}: "
                f"make the workspace with --hold {joint}=WHERE IT STOOD, or leave out the "
                "recordings in which it stood elsewhere (--leave-out)"
            )


def _stands_at(at: float, column: str, low: float, high: float) -> bool:
    """Whether a column stays at a place: a lift at 0.35 m may be 350 there, without a unit."""
    unit = split_unit(column, CHANNEL_UNITS)[1]
    usual = max(abs(low), abs(high)) <= UNITS["rad"].largest
    units = [unit] if unit else ["m", "rad"] if usual else CHANNEL_UNITS
    scales = [scale for u in units for base in ("m", "rad") if (scale := factor(u, base))]
    return any(all(abs(s * end - at) <= _OFF for end in (low, high)) for s in scales or [1.0])


def acceleration_of(noise: Channels, dt: float) -> Channels:
    """Return the largest acceleration that noise of a standard deviation makes, in units/s^2.

    White noise at the knots of a cubic spline, `dt` in [s] apart, makes 6 / dt^2 times as much.
    """
    return _WORST * 6.0 * noise / dt**2


def in_rows(rows: Mapping[str, str], remarks: Sequence[str]) -> str:
    """Put the topic before each line, and list the remarks below."""
    every = {**rows, "remarks": str(len(remarks)) if remarks else "none"}
    lines = [f"{name:<11} {text}" for name, text in every.items()]
    return "\n".join([*lines, *(f"  - {remark}" for remark in remarks)])


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Cells under each other; the first column to the left, numbers to the right."""
    first, *others = (max(map(len, column)) for column in zip(*rows, strict=True))
    form = "  ".join([f"{{:<{first}}}", *(f"{{:>{width}}}" for width in others)])
    return [form.format(*row).rstrip() for row in rows]


def say_small(value: float, unit: str) -> str:
    """Format a small number: angles in mrad, lengths in mm."""
    thousandth = UNITS[unit].small if unit in UNITS else ""
    return f"{1000 * value:.2g} {thousandth}" if thousandth else f"{value:.2g} {unit}"


def _span(values: Iterable[float], form: str) -> str:
    ordered = sorted(values)
    first, last = format(ordered[0], form), format(ordered[-1], form)
    return first if first == last else f"{first} to {last}"
