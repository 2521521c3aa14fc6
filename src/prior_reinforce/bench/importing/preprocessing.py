"""From recordings of any channels, rate and length to plans of one format and one horizon."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Frames, Plans, Point
from prior_reinforce.bench.importing.clock import LONGEST
from prior_reinforce.bench.importing.naming import (
    find_channels,
    joint_vectors,
    missing_channels,
    numbered_like,
)
from prior_reinforce.bench.importing.noise import (
    Channels,
    held_channels,
    is_step,
    moving_ends,
    noise_of,
)
from prior_reinforce.bench.importing.recording import Recording
from prior_reinforce.bench.importing.units import (
    Doubt,
    base_of,
    cannot_be,
    conversion,
    guess_unit,
    known_unit,
    say_names,
)
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.timing import moving_rows, still_bands

_ON_GRID = 0.02
"""A frame within this share of a time step of where it should be is taken as recorded. Ours: at
2 rad/s and 100 Hz that is 0.4 mrad, below the servo's own error."""
_OVERSHOOT = 0.01
"""A spline that leaves a channel's recorded range by more than this share of it is refused."""
_MOST_FRAMES = 100_000
"""Longest plan that is made; more is a wrong time step far more often than a motion."""


@dataclass(frozen=True)
class Selection:
    """Recordings that hold the plan's columns and nothing else."""

    recordings: tuple[Recording, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    """Of the plan's columns."""
    recorded_units: tuple[str, ...]
    """In which they were recorded."""
    doubts: tuple[Doubt, ...] = ()
    """Which of those are only guessed."""
    remarks: tuple[str, ...] = ()
    """What a person should know of them."""
    other_unit: str = ""
    """The option that says the unit they look like instead; empty where that is the one taken, or
    one option cannot say it."""


@dataclass(frozen=True)
class Preprocessing:
    """How recordings become plans. Time is never stretched: a retimed throw is another throw."""

    dt: float | None = None
    """Time between two frames of a plan, in [s]; None takes the recordings' median period."""
    horizon: int | None = None
    """Frames of every plan; None takes the longest recording's. Shorter ones hold their last pose;
    a longer one is an error, never cut."""
    trim: bool = True
    """Drop the still time before the first and after the last movement of each recording."""
    smooth: float | None = None
    """Frequency above which plans are smoothed, in [Hz]: a Butterworth filter of order 2, run
    forwards and backwards, so that nothing is delayed. Channels that jump are left alone. None
    keeps every frame as recorded."""
    margin: float = 0.1
    """Still time that trimming keeps at either end, in [s]. Ours: enough for the plan to start
    and end at rest at 30 frames a second."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A value outside its range.
        """
        if self.dt is not None and not (math.isfinite(self.dt) and self.dt > 0):
            raise ConfigurationError(f"dt must be a positive number of seconds, got {self.dt}")
        if self.horizon is not None and self.horizon < 2:
            raise ConfigurationError(f"horizon must be at least 2 frames, got {self.horizon}")
        if self.smooth is not None and not (math.isfinite(self.smooth) and self.smooth > 0):
            raise ConfigurationError(
                f"smooth must be a positive frequency in Hz, got {self.smooth}"
            )
        if not (math.isfinite(self.margin) and self.margin >= 0):
            raise ConfigurationError(f"margin must be 0 s or more, got {self.margin}")


@dataclass(frozen=True, eq=False)
class Preprocessed:
    """Plans, and what was done to get them."""

    plans: Plans
    dt: float
    """Time between two frames, in [s]."""
    starts: tuple[float, ...]
    """Where in its recording each plan starts, in [s]."""
    ends: tuple[float, ...]
    """Where in its recording each plan ends, in [s], before the last pose is held."""
    held: int
    """How many plans hold their last pose to reach the horizon."""
    held_channels: tuple[int, ...]
    """Channels that no recording moves, noise aside."""
    noise: Channels
    """Standard deviation of each channel's noise at rest, in its unit; the median recording's."""
    smoothed: Float[np.ndarray, "N 2 D"] | None
    """What smoothing changed in each plan: rms and largest change; None where nothing was."""
    remarks: tuple[str, ...]
    """What a person should know, the most important first: `episodes: what`."""


def select(
    recordings: Sequence[Recording],
    joints: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
) -> Selection:
    """Pick, order, convert and rename the channels of every recording.

    Args:
        recordings: At least one.
        joints: Recorded names to keep, in order; None keeps those of the first recording. They
            name the columns, in order, of recordings that name nothing.
        names: What to call them; None keeps the recorded names. Where they are the joints, and no
            column is called like them, numbered columns of which there are as many are a guess.
        units: Recorded units; a single one holds for all. None takes those that the recordings
            say, and for others the plan's; where an arm could not be in that unit, it is guessed.
        plan_units: Units of the plan; None takes radians for angles and metres for lengths, and
            radians for what has no unit.

    Raises:
        InvalidDemonstrationsError: A joint that a recording lacks.
        ConfigurationError: Another number of names or units than of joints, or units that
            contradict each other.
    """
    joints = tuple(joints) if joints is not None else recordings[0].names
    nobody_said = names is not None and tuple(names) == joints
    names = tuple(names) if names is not None else joints
    if not joints or len(set(joints)) != len(joints):
        raise ConfigurationError(f"joints must be names that differ, got {list(joints)}")
    if units is not None and len(units) == 1:
        units = (units[0],) * len(joints)
    n_units = len(joints) if units is None else len(units)
    if len(names) != len(joints) or n_units != len(joints):
        raise ConfigurationError(
            f"{len(joints)} joints need as many names and units, got {len(names)} names and "
            f"{n_units} units: {list(joints)}"
        )
    joints, guessed = _guess_names(recordings[0], joints) if nobody_said else (joints, ())
    columns = [_columns(recording, joints) for recording in recordings]
    said = [
        _said_unit(recordings, columns, i, None if units is None else units[i])
        for i in range(len(joints))
    ]
    wanted = [
        plan_units[i] if plan_units is not None else base_of(unit or "rad")[0]
        for i, unit in enumerate(said)
    ]
    picked = [r.positions[:, c] for r, c in zip(recordings, columns, strict=True)]
    recorded, doubts = _guess_units(recordings, picked, names, said, wanted)
    # No option may contradict a unit that the file says.
    open_ = all(r.units[i] is None for r, c in zip(recordings, columns, strict=True) for i in c)
    doubted = units is not None and open_
    slip = _doubt_units(recordings, picked, names, recorded) if doubted else ()
    recorded = [slip[0].option.split()[-1]] * len(joints) if slip else recorded
    scale = [conversion(r, w, n) for r, w, n in zip(recorded, wanted, names, strict=True)]
    kept = tuple(
        replace(
            r,
            positions=q * np.array(scale),
            names=joints,
            units=tuple(wanted),
            columns=tuple(r.columns[i] for i in c),
        )
        for r, q, c in zip(recordings, picked, columns, strict=True)
    )
    other = _other_unit(recordings, picked, names, recorded) if open_ else ""
    remarks = _far(recordings, picked, names, recorded, other)
    doubts = (*guessed, *doubts, *slip)
    return Selection(kept, names, tuple(wanted), tuple(recorded), doubts, remarks, other)


def _guess_names(
    recording: Recording, joints: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Doubt, ...]]:
    """The joints by their recorded names, where these can only be guessed: `q0`, `q1`, ..."""
    if not recording.named or find_channels(joints, recording.names) is not None:
        return joints, ()
    found = numbered_like(joints, recording.names)
    if found is None:
        return joints, ()
    what = f"no column is called {say_names(joints)}: it looks as if {say_names(found)} were these"
    return found, (Doubt(what, f"--joints {shlex.join(found)}"),)


def _said_unit(
    recordings: Sequence[Recording], columns: list[list[int]], index: int, given: str | None
) -> str | None:
    """Unit of a channel that was given or that its file says; None where neither does."""
    given = given if given is None else known_unit(given) or given
    for recording, column in zip(recordings, columns, strict=True):
        own = recording.units[column[index]]
        if own is not None and given not in (None, own):
            raise ConfigurationError(
                f"{recording.names[column[index]]} of episode {recording.episode} is in {own}, but "
                f"--units says {given}; correct or drop it"
            )
        given = given or own
    return given


def _guess_units(
    recordings: Sequence[Recording],
    picked: Sequence[Float[np.ndarray, "_ D"]],
    names: Sequence[str],
    said: Sequence[str | None],
    wanted: Sequence[str],
) -> tuple[list[str], tuple[Doubt, ...]]:
    """Unit of every channel: as said, as wanted where that is possible, else as it looks."""
    recorded, whats = [unit or "" for unit in said], []
    for base in dict.fromkeys(w for w, unit in zip(wanted, said, strict=True) if unit is None):
        open_ = [i for i, unit in enumerate(said) if unit is None and wanted[i] == base]
        most, where = _farthest(recordings, picked, names, open_)
        looks = guess_unit(base, most)
        if looks != base:
            seen = f"it looks like {looks}" if looks else "and as degrees neither"
            whats.append(
                f"{say_names([names[i] for i in open_])} in {base} would reach {most:.4g} "
                f"({where}), which no arm does: {seen}"
            )
        for i in open_:
            recorded[i] = looks or base
    shown = recorded[:1] if len(set(recorded)) == 1 else recorded
    return recorded, tuple(Doubt(what, f"--units {' '.join(shown)}") for what in whats)


def _farthest(
    recordings: Sequence[Recording],
    picked: Sequence[Float[np.ndarray, "_ D"]],
    names: Sequence[str],
    among: Sequence[int],
) -> tuple[float, str]:
    """How far some channels reach without their sign, and where that is."""
    reach = np.array([np.abs(q[:, among]).max(axis=0) for q in picked])
    episode, channel = divmod(int(np.argmax(reach)), len(among))
    most = float(reach[episode, channel])
    return most, f"{names[among[channel]]} of {recordings[episode].episode}"


def _doubt_units(
    recordings: Sequence[Recording],
    picked: Sequence[Float[np.ndarray, "_ D"]],
    names: Sequence[str],
    recorded: Sequence[str],
) -> tuple[Doubt, ...]:
    """What was said of the units of all channels, and cannot be."""
    unit = recorded[0]
    if len(set(recorded)) > 1:
        return ()
    most, where = _farthest(recordings, picked, names, range(len(names)))
    looks = guess_unit(unit, most)
    if not cannot_be(unit, most) or looks is None:
        return ()
    what = (
        f"{say_names(names)} in {unit}, as --units says, would reach {most:.4g} ({where}), which "
        f"no arm does: it looks like {looks}"
    )
    return (Doubt(what, f"--units {looks}"),)


def _other_unit(
    recordings: Sequence[Recording],
    picked: Sequence[Float[np.ndarray, "_ D"]],
    names: Sequence[str],
    recorded: Sequence[str],
) -> str:
    """The option that says what unit all channels look like; empty where it is theirs."""
    if len(set(recorded)) > 1:
        return ""
    looks = guess_unit(recorded[0], _farthest(recordings, picked, names, range(len(names)))[0])
    return "" if looks in (recorded[0], None) else f"--units {looks}"


def _far(
    recordings: Sequence[Recording],
    picked: Sequence[Float[np.ndarray, "_ D"]],
    names: Sequence[str],
    recorded: Sequence[str],
    other: str,
) -> tuple[str, ...]:
    """What reaches farther than arms mostly do, in the unit that it was recorded in."""
    said = []
    for unit in dict.fromkeys(recorded):
        among = [i for i, own in enumerate(recorded) if own == unit]
        most, where = _farthest(recordings, picked, names, among)
        looks = guess_unit(unit, most)
        if looks not in (unit, None):
            advice = f"if it was recorded in {looks}, say {other}" if other else "check its unit"
            said.append(f"{where} reaches {most:.4g} {unit}, and arms do not: {advice}")
    return tuple(said)


def _columns(recording: Recording, joints: tuple[str, ...]) -> list[int]:
    found = find_channels(joints, recording.names)
    if found is not None:
        return found
    there = say_names(recording.names)
    if recording.named:
        missing = say_names(missing_channels(joints, recording.names))
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has no joint {missing}; it has {there}: give the "
            f"recorded names in the plan's order with --joints{_by_key(recording, len(joints))}"
        )
    if len(recording.names) != len(joints):
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has {len(recording.names)} columns without names, but "
            f"{len(joints)} joints were given; name all its columns in order, or give some of "
            f"{there}"
        )
    return list(range(len(joints)))


def _by_key(recording: Recording, count: int) -> str:
    """A hint at numbered columns of which there are as many as joints."""
    fitting = list(joint_vectors(recording.names, count))
    return f", or numbered columns at once: --key {fitting[0]}" if fitting else ""


def preprocess(
    recordings: Sequence[Recording], units: Sequence[str], settings: Preprocessing
) -> Preprocessed:
    """Trim, resample and bring to one horizon.

    Args:
        recordings: N of them, each with the same D channels.
        units: Of the D channels.
        settings: How.

    Raises:
        InvalidDemonstrationsError: An episode that never moves, or is longer than the horizon.
    """
    dt = settings.dt or _common_dt(recordings)
    every, units = [r.positions for r in recordings], tuple(units)
    spans = [(0.0, recording.duration) for recording in recordings]
    if settings.trim:
        still = still_bands(every, units)
        spans = [_moving_span(recording, still, settings.margin) for recording in recordings]
    said = _Remarks()
    pieces, changes = [], []
    for recording, (start, end) in zip(recordings, spans, strict=True):
        if (end - start) / dt > _MOST_FRAMES:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode} makes {(end - start) / dt:.0f} frames at dt {dt:g} s;"
                " give a larger dt, or cut the recording"
            )
        piece, stepwise = _resample(recording, start, end, dt, units)
        if settings.smooth is not None:
            smooth = _smoothed(recording, piece, dt, settings.smooth, units)
            changes.append(_change(piece, smooth))
            piece = smooth
        pieces.append(piece)
        said.gap(recording, start, end)
        if stepwise:
            said.add(_STEPS, recording, f"{', '.join(stepwise)} jumps; no spline goes through it")
        for remark in recording.remarks:
            said.add(_READING, recording, remark)
    longest = max(map(len, pieces))
    horizon = settings.horizon or longest
    for recording, piece, span in zip(recordings, pieces, spans, strict=True):
        if len(piece) > horizon:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode} has {len(piece)} frames, more than the horizon "
                f"{horizon}; give a horizon of {longest}, or a larger dt (motions are never cut)"
            )
        said.ends(recording, span, units, held=len(piece) < horizon)
    longest_motion = max(end - start for start, end in spans)
    if longest_motion > LONGEST:
        said.add(
            _SLOW,
            None,
            f"motions take up to {longest_motion:.3g} s, and throws take seconds: cut the "
            "recordings, or say in which unit their times are (--time-unit)",
        )
    elif horizon > 400:
        said.add(_LONG, None, f"{horizon} frames are many; dt {dt * horizon / 140:.2g} s makes 140")
    held = np.all([held_channels(q, units) for q in every], axis=0)
    return Preprocessed(
        np.stack([np.pad(p, ((0, horizon - len(p)), (0, 0)), mode="edge") for p in pieces]),
        dt,
        tuple(start for start, _ in spans),
        tuple(end for _, end in spans),
        sum(len(piece) < horizon for piece in pieces),
        tuple(np.flatnonzero(held).tolist()),
        np.median([noise_of(q) for q in every], axis=0),
        np.array(changes) if changes else None,
        said.lines(len(recordings)),
    )


def refuse_copies(plans: Plans, names: Sequence[str]) -> None:
    """Do nothing where no two motions are one to the last number, as no two recordings are.

    Args:
        plans: N of them.
        names: What to call each.

    Raises:
        InvalidDemonstrationsError: A file was copied, or one plan was executed twice: what lies
            between its outcomes would be asked of the same motion.
    """
    first: dict[bytes, str] = {}
    for plan, name in zip(plans, names, strict=True):
        other = first.setdefault(plan.tobytes(), name)
        if other != name:
            raise InvalidDemonstrationsError(
                f"{other} and {name} are one motion to the last number; if a file was copied, drop "
                "it, and if one plan was executed twice, give it once, with the middle of where it "
                "landed (--leave-out)"
            )


_SLOW, _ENDS, _GAPS, _READING, _STEPS, _LONG = range(6)
"""Kinds of remarks, the most important first: what the gate will refuse, what is not known, what
was left out or chosen."""


class _Remarks:
    """What there is to say, each once for all episodes that it is true of."""

    def __init__(self) -> None:
        self._said: dict[tuple[int, str], list[str]] = {}

    def add(self, kind: int, recording: Recording | None, what: str) -> None:
        """Note something of an episode, or of all."""
        episodes = self._said.setdefault((kind, what), [])
        if recording is not None:
            episodes.append(recording.episode)

    def gap(self, recording: Recording, start: float, end: float) -> None:
        """The longest time within the motion without a frame, where that is no jitter."""
        steps = np.diff(recording.times)
        inside = (recording.times[1:] > start) & (recording.times[:-1] < end)
        worst = int(np.argmax(np.where(inside, steps, 0.0)))
        if steps[worst] > 3 * recording.period:
            at = recording.times[worst]
            self.add(_GAPS, recording, f"nothing recorded for {steps[worst]:.3f} s at {at:.2f} s")

    def ends(
        self, recording: Recording, span: tuple[float, float], units: tuple[str, ...], *, held: bool
    ) -> None:
        """Channels that are not at rest where the plan starts or ends."""
        t = recording.times
        kept = (t >= span[0]) & (t <= span[1])
        if np.count_nonzero(kept) < 5:
            return
        starts, ends = moving_ends(t[kept], recording.positions[kept], units)
        then = ", then holds its last pose" if held else ""
        for moving, what in ((starts, "starts in motion"), (ends, f"ends in motion{then}")):
            if np.any(moving):
                names = [recording.names[i] for i in np.flatnonzero(moving)]
                self.add(_ENDS, recording, f"{what} ({say_names(names)})")

    def lines(self, n: int) -> tuple[str, ...]:
        """One line each: which episodes, and what."""
        ordered = sorted(self._said.items(), key=lambda item: item[0][0])
        return tuple(
            f"{'all' if len(e) in (0, n) and n > 1 else ', '.join(e)}: {what}"
            for (_, what), e in ordered
        )


def _smoothed(
    recording: Recording, frames: Frames, dt: float, frequency: float, units: tuple[str, ...]
) -> Frames:
    """Frames without what is faster than a frequency, but for channels that jump."""
    from scipy.signal import butter, sosfiltfilt

    if frequency >= 0.5 / dt:
        raise ConfigurationError(
            f"--smooth {frequency:g} Hz is no less than half the plans' {1 / dt:g} Hz, where "
            "nothing is faster; give less, or leave it out"
        )
    if frequency * len(frames) * dt < 1:
        raise ConfigurationError(
            f"--smooth {frequency:g} Hz takes out all that is faster than {1 / frequency:.3g} s, "
            f"and episode {recording.episode} is {len(frames) * dt:.3g} s long; give more Hz"
        )
    sections = butter(2, frequency, fs=1 / dt, output="sos")
    pad = min(len(frames) - 1, math.ceil(1 / (frequency * dt)))
    # Mirrored at an end, a channel keeps its rest there; turned about it, its speed.
    at_rest, moving = (
        np.asarray(sosfiltfilt(sections, frames, axis=0, padtype=padding, padlen=pad))
        for padding in ("even", "odd")
    )
    starts, ends = moving_ends(np.arange(len(frames)) * dt, frames, units)
    smooth = np.where(starts | ends, moving, at_rest)
    return np.where(is_step(recording.positions, units), frames, smooth)


def _change(before: Frames, after: Frames) -> Float[np.ndarray, "2 D"]:
    """Rms and largest change of each channel."""
    off = after - before
    return np.stack([np.sqrt(np.mean(off**2, axis=0)), np.abs(off).max(axis=0)])


def _common_dt(recordings: Sequence[Recording]) -> float:
    """Median period, snapped to a whole rate that is within half a per cent of it."""
    period = float(np.median([recording.period for recording in recordings]))
    rate = round(1 / period)
    return 1 / rate if rate > 0 and abs(rate * period - 1) < 0.005 else period


def _moving_span(recording: Recording, still: Point, margin: float) -> tuple[float, float]:
    """From when to when a recording is kept, in [s]: its motion and a margin."""
    t, rows = recording.times, moving_rows(recording.positions, still)
    if rows is None:
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} never moves by more than {still.max():.2g} from its "
            "first pose; leave it out, or import without trimming"
        )
    # The last frame within the still band before the motion, and the first one after it.
    before, after = rows[0] - 1, min(rows[1] + 1, len(t) - 1)
    first = np.searchsorted(t, t[before] - margin, side="right") - 1
    last = np.searchsorted(t, t[after] + margin)
    return float(t[max(first, 0)]), float(t[min(last, len(t) - 1)])


def _resample(
    recording: Recording, start: float, end: float, dt: float, units: tuple[str, ...]
) -> tuple[Frames, list[str]]:
    """Frames at start, start + dt, ... until the end is covered, and names of stepwise channels."""
    t, q = recording.times, recording.positions
    count = max(2, math.ceil((end - start) / dt - _ON_GRID) + 1)
    grid = start + np.arange(count) * dt
    nearest = np.clip(np.searchsorted(t, grid - dt / 2), 0, len(t) - 1)
    if np.all(np.abs(t[nearest] - grid) <= _ON_GRID * dt):
        return q[nearest], []
    from scipy.interpolate import CubicSpline, PchipInterpolator

    at = np.clip(grid, t[0], t[-1])
    frames = CubicSpline(t, q)(at) if len(t) > 3 else PchipInterpolator(t, q)(at)
    low, high = q.min(axis=0), q.max(axis=0)
    beyond = np.maximum(low - frames.min(axis=0), frames.max(axis=0) - high)
    # Splines leave the range of noise by about as much as there is noise.
    stepwise = (beyond > _OVERSHOOT * (high - low)) & (beyond > 5 * noise_of(q))
    stepwise &= ~held_channels(q, units)
    if np.any(stepwise):
        # PCHIP never leaves the range of its neighbours: right for grippers and switches.
        frames[:, stepwise] = PchipInterpolator(t, q[:, stepwise])(at)
    return frames, [n for n, s in zip(recording.names, stepwise, strict=True) if s]
