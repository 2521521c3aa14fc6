"""What recordings hold, before anything is taken in: time, channels, rests, noise, limits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from prior_reinforce.bench.importing.preprocessing import (
    Preprocessed,
    Preprocessing,
    copies,
    preprocess,
)
from prior_reinforce.bench.importing.recording import Recording
from prior_reinforce.bench.importing.selection import Selection
from prior_reinforce.bench.importing.units import Ambiguity, say_names
from prior_reinforce.bench.robots import GateSettings, RobotLimits, check_plan
from prior_reinforce.bench.robots.limits import match_joints
from prior_reinforce.bench.robots.report import LimitReport
from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.interpolation import RATE
from prior_reinforce.plans.motions import Plan, PlanFormat
from prior_reinforce.plans.speeds import Channels

_SMOOTH_HZ = 20
_SMOOTH = f"--smooth {_SMOOTH_HZ}"
"""What takes out an encoder's noise: 20 Hz is above what a throw holds. Ours."""

_WORST = 2.5
"""Standard deviations that the worst of a plan's frames is off by. Ours: measured, 30 plans of 88
frames, 2.3 to 2.9; what an end leaps by from rest is 1.3 to 2.4."""
_MUCH_NOISE = 0.25
"""Part of a limit that noise alone takes up, from which on it is said. Ours."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found in recordings, and what an import would make of them."""

    selection: Selection
    """N recordings with the plan's channels, in the plan's units."""
    processed: Preprocessed
    """What becomes of them."""
    settings: Preprocessing
    """How."""
    limits: RobotLimits | None = None
    """What the demonstrations were held against."""
    gate: GateSettings | None = None
    """The gate's settings for that."""
    reports: tuple[LimitReport, ...] = ()
    """What the gate says of each; empty where no robot is named."""
    ambiguities: tuple[Ambiguity, ...] = ()
    """Units, times and names of channels that are only guessed."""

    @property
    def robot(self) -> str | None:
        """Whose limits the demonstrations were held against."""
        return None if self.limits is None else self.limits.robot

    @cached_property
    def copies(self) -> str:
        """Which two motions are one; empty where none are."""
        return copies(self.processed.plans, self.selection.episodes)

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The N recordings."""
        return self.selection.recordings

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know, the most important first: limits, ends, gaps, ..."""
        left_out = self.selection.left_out
        first = (self.copies, *self.selection.remarks, *self._broken(), self._noise_warning())
        last = f"left out although it moves: {left_out} (take it with --joints)" if left_out else ""
        return tuple(filter(None, (*first, last, *self.processed.remarks)))

    @property
    def remedy(self) -> str:
        """An option that may help where no demonstration passes the gate; else nothing."""
        if not self.reports or not all(report.refused for report in self.reports):
            return ""
        broken = {line.check for r in self.reports for line in r.lines if line.status == "refuse"}
        if "position" in broken:
            return self.selection.other_unit
        return _SMOOTH if self._smoothing_helps else ""

    @property
    def rows(self) -> dict[str, str]:
        """The essential, a line each, by what it is about."""
        rows = {
            "rate": self._rate(),
            "channels": self._units(),
            "still ends": self._trimming(),
            "length": self._length(),
            "noise": self._noise(),
            "motion": self._motion(),
        }
        return rows | ({"limits": self._limits()} if self.robot is not None else {})

    @property
    def text(self) -> str:
        """Everything: rows, remarks, ambiguities, a table of episodes and one of channels."""
        guesses = [f"  - {one.what} ({one.option})" for one in self.ambiguities]
        head = ["", "what is only guessed:", *guesses] if guesses else []
        parts = [in_rows(self.rows, self.remarks), *head, "", *self._episodes(), ""]
        return "\n".join([*parts, *self._channels()])

    def _episodes(self) -> list[str]:
        rows = [["episode", "frames", "Hz", "length s", "cut before s", "cut after s"]]
        spans = zip(self.processed.starts, self.processed.ends, strict=True)
        for recording, (start, end) in zip(self.recordings, spans, strict=True):
            numbers = (recording.duration, start, recording.duration - end)
            rate = f"{1 / recording.period:.4g}"
            said = (f"{n:.2f}" for n in numbers)
            rows.append([recording.episode, str(len(recording.times)), rate, *said])
        return _columns(rows)

    def _channels(self) -> list[str]:
        rows = [["channel", "recorded as", "unit", "least", "most", "noise", ""]]
        selection = self.selection
        every = np.concatenate([r.positions for r in self.recordings])
        for i, name in enumerate(selection.names):
            ranges = (f"{every[:, i].min():.4g}", f"{every[:, i].max():.4g}")
            noise = say_small(float(self.processed.noise[i]), selection.units[i])
            held = "held" if i in self.processed.held_channels else ""
            recorded = self.recordings[0].columns[i]
            unit = selection.units[i]
            if selection.recorded_units[i] != unit:
                unit = f"{unit}, from {selection.recorded_units[i]}"
            rows.append([name, recorded, unit, *ranges, noise, held])
        return _columns(rows)

    def _units(self) -> str:
        """Channels by their units."""
        groups: dict[str, list[str]] = {}
        selection = self.selection
        for name, unit, recorded in zip(
            selection.names, selection.units, selection.recorded_units, strict=True
        ):
            said = unit if unit == recorded else f"{unit}, recorded in {recorded}"
            groups.setdefault(said, []).append(name)
        return "; ".join(f"{say_names(names)} [{unit}]" for unit, names in groups.items())

    def _limits(self) -> str:
        refused = [r for r in self.reports if r.refused]
        if not self.reports:
            return f"{self.robot}: not checked"
        unchecked = {c for r in self.reports for c in r.unchecked} - {"demonstrations", "box"}
        open_ = f"; not checked: {', '.join(sorted(unchecked))}" if unchecked else ""
        if not refused:
            return f"{self.robot}: all {len(self.reports)} demonstrations pass{open_}"
        return (
            f"{self.robot}: {len(refused)} of {len(self.reports)} demonstrations break a limit"
            f"{open_}"
        )

    def _broken(self) -> list[str]:
        """What breaks a limit: plans like it will be refused."""
        said: dict[str, list[str]] = {}
        for recording, report in zip(self.recordings, self.reports, strict=False):
            for line in report.lines:
                if line.status == "refuse":
                    said.setdefault(line.check, []).append(f"{recording.episode} ({line.text})")
        return [
            f"the gate refuses {check}: {', '.join(episodes)}" for check, episodes in said.items()
        ]

    def _rate(self) -> str:
        recorded = _span((1 / recording.period for recording in self.recordings), ".4g")
        dt = self.processed.dt
        clocks = " and ".join(dict.fromkeys(r.clock for r in self.recordings if r.clock))
        by = f" ({clocks})" if clocks else ""
        return f"recorded at {recorded} Hz{by}, plans at {1 / dt:.4g} Hz (dt {dt:.4g} s)"

    def _trimming(self) -> str:
        before = self.processed.starts
        after = [
            r.duration - end for r, end in zip(self.recordings, self.processed.ends, strict=True)
        ]
        if max(*before, *after) <= 0:
            return "nothing dropped"
        return (
            f"dropped {_span(before, '.2f')} s before and {_span(after, '.2f')} s after the motion"
        )

    def _length(self) -> str:
        done, horizon = self.processed, self.processed.plans.shape[1]
        lengths = [end - start for start, end in zip(done.starts, done.ends, strict=True)]
        held = f"; {done.held} hold their last pose" if done.held else ""
        return (
            f"motions of {_span(lengths, '.2f')} s, plans of {horizon} frames "
            f"({(horizon - 1) * done.dt:.2f} s){held}"
        )

    def _noise(self) -> str:
        names, units, done = self.selection.names, self.selection.units, self.processed
        noisiest = int(np.argmax(done.noise))
        held = say_names([names[i] for i in done.held_channels]) or "no channel"
        most = say_small(done.noise[noisiest], units[noisiest])
        seen = (
            f"up to {most} at rest ({names[noisiest]})" if done.noise[noisiest] > 1e-9 else "none"
        )
        said = f"{seen}; {held} held"
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
        names, units, plans = self.selection.names, self.selection.units, self.processed.plans
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
        """What part of a limit noise alone takes up; nothing where that is little.

        Channels that are held do not count: noise on them is not learned.
        """
        names, limits, processed = self.selection.names, self.limits, self.processed
        if limits is None or not self.reports or processed.smoothed is not None:
            return ""
        period = max(processed.dt, max(recording.period for recording in self.recordings))
        if 2 * _SMOOTH_HZ * period >= 1:  # so few frames hardly tell noise from motion
            return ""
        accelerations = acceleration_of(processed.noise, period)
        shares = [(0.0, "")]
        form = PlanFormat(names, self.selection.units, processed.dt)
        for joint, channel in match_joints(form, limits).items():
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
        """Whether not all demonstrations break a limit once they are smoothed.

        It is tried: what noise breaks, a motion that is too fast or starts at speed breaks as well.
        """
        try:
            smooth = replace(self.settings, smooth=_SMOOTH_HZ)
            processed = preprocess(self.recordings, self.selection.units, smooth)
        except ConfigurationError:  # recordings too short to be smoothed
            return False
        reports = _check(self.selection, processed, self.limits, self.gate)
        return not all(report.refused for report in reports)


def inspect(
    selection: Selection,
    preprocessing: Preprocessing | None = None,
    robot: RobotLimits | None = None,
    gate: GateSettings | None = None,
) -> Inspection:
    """Make plans of recordings, and hold each against the robot's limits, once.

    Args:
        selection: Recordings with the plan's channels.
        preprocessing: Time step, horizon and trimming; None takes the defaults.
        robot: Limits that every demonstration is held against; None checks none.
        gate: The gate's settings for that.

    Raises:
        InvalidDemonstrationsError: An episode that never moves, or is longer than the horizon.
        ConfigurationError: Settings that contradict each other.
    """
    settings = preprocessing or Preprocessing()
    processed = preprocess(selection.recordings, selection.units, settings)
    reports = _check(selection, processed, robot, gate)
    return Inspection(selection, processed, settings, robot, gate, reports)


def _check(
    selection: Selection,
    processed: Preprocessed,
    robot: RobotLimits | None,
    gate: GateSettings | None,
) -> tuple[LimitReport, ...]:
    """What the gate says of every plan; nothing where no robot is named.

    Demonstrations that the gate cannot judge, such as those in degrees, give no reports.
    """
    if robot is None:
        return ()
    try:
        form = PlanFormat(selection.names, selection.units, processed.dt)
        return tuple(check_plan(Plan(p, form), robot, None, gate) for p in processed.plans)
    except InvalidPlanError:
        return ()


def acceleration_of(noise: Channels, dt: float) -> Channels:
    """Return the largest acceleration that noise alone makes in a plan, in units/s^2.

    White noise at the knots of a cubic spline makes 6 / dt^2 times as much acceleration there.

    Args:
        noise: Standard deviation of each channel's noise.
        dt: Time between two frames, in [s].
    """
    return _WORST * 6.0 * noise / dt**2


def in_rows(rows: Mapping[str, str], remarks: Sequence[str]) -> str:
    """Name what each line is about, and list the remarks below."""
    every = {**rows, "remarks": str(len(remarks)) if remarks else "none"}
    lines = [f"{name:<11} {text}" for name, text in every.items()]
    return "\n".join([*lines, *(f"  - {remark}" for remark in remarks)])


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Cells under each other; the first column to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def say_small(value: float, unit: str) -> str:
    """Say a small number: in mrad or mm where it is an angle or a length."""
    thousandth = {"rad": "mrad", "m": "mm"}.get(unit)
    return f"{1000 * value:.2g} {thousandth}" if thousandth else f"{value:.2g} {unit}"


def _span(values: Iterable[float], form: str) -> str:
    ordered = sorted(values)
    first, last = format(ordered[0], form), format(ordered[-1], form)
    return first if first == last else f"{first} to {last}"
