"""What an import found, in about ten lines and one picture, for a person to agree with."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from prior_reinforce.importing.picture import Picture, hull_corners
from prior_reinforce.importing.preprocessing import Preprocessed
from prior_reinforce.importing.recording import Recording
from prior_reinforce.plans.motions import Demonstrations

_REMARKS_SHOWN = 4


@dataclass(frozen=True)
class Preview:
    """The last look before demonstrations are used."""

    text: str
    """About ten lines: episodes, rate, trimming, resampling, outcomes, remarks."""
    remarks: tuple[str, ...]
    """What a person should look at: gaps, ends in mid-swing, messages skipped."""
    picture: Picture = field(repr=False, compare=False)
    """What `draw` draws."""

    def draw(self, path: str | os.PathLike[str]) -> None:
        """Write the picture (PNG): every joint over time, and the outcomes with their hull."""
        self.picture.draw(path)


def make_preview(
    source: str,
    format: str,
    recordings: Sequence[Recording],
    done: Preprocessed,
    demos: Demonstrations,
    outcomes_from: str,
) -> Preview:
    """Describe an import.

    Args:
        source: Name of what was read.
        format: Its format.
        recordings: N recordings with the plan's channels.
        done: What became of them.
        demos: The result.
        outcomes_from: Where the outcomes are from.
    """
    episodes = tuple(recording.episode for recording in recordings)
    rows = [
        ("episodes", f"{demos.n} from {source} ({format}): {', '.join(episodes)}"),
        ("rate", _rate(recordings, done)),
        ("channels", _channels(demos)),
        ("still ends", _trimming(recordings, done)),
        ("length", _length(done, demos)),
        ("motion", _motion(demos, episodes)),
        ("outcomes", f"{_ranges(demos)}, from {outcomes_from}"),
        ("coverage", _coverage(demos, episodes)),
        ("remarks", "none" if not done.remarks else f"{len(done.remarks)}"),
    ]
    lines = [f"{name:<11} {text}" for name, text in rows]
    lines += [f"  - {remark}" for remark in done.remarks[:_REMARKS_SHOWN]]
    if len(done.remarks) > _REMARKS_SHOWN:
        lines.append(f"  - and {len(done.remarks) - _REMARKS_SHOWN} more")
    picture = Picture(demos, episodes, tuple(recordings), done.starts)
    return Preview("\n".join(lines), done.remarks, picture)


def _span(low: float, high: float, form: str) -> str:
    first, last = format(low, form), format(high, form)
    return first if first == last else f"{first} to {last}"


def _rate(recordings: Sequence[Recording], done: Preprocessed) -> str:
    rates = [1 / recording.period for recording in recordings]
    recorded = _span(min(rates), max(rates), ".4g")
    return f"recorded at {recorded} Hz, plans at {1 / done.dt:.4g} Hz (dt {done.dt:.4g} s)"


def _channels(demos: Demonstrations) -> str:
    form = demos.format
    return ", ".join(f"{n} [{u}]" for n, u in zip(form.names, form.units, strict=True))


def _trimming(recordings: Sequence[Recording], done: Preprocessed) -> str:
    after = [r.duration - end for r, end in zip(recordings, done.ends, strict=True)]
    if max(*done.starts, *after) <= 0:
        return "nothing dropped"
    return (
        f"dropped {_span(min(done.starts), max(done.starts), '.2f')} s before and "
        f"{_span(min(after), max(after), '.2f')} s after the motion"
    )


def _length(done: Preprocessed, demos: Demonstrations) -> str:
    lengths = [end - start for start, end in zip(done.starts, done.ends, strict=True)]
    whole = (demos.horizon - 1) * done.dt
    held = f"; {done.held} hold their last pose" if done.held else ""
    return (
        f"motions of {_span(min(lengths), max(lengths), '.2f')} s, plans of {demos.horizon} frames "
        f"({whole:.2f} s){held}"
    )


def _motion(demos: Demonstrations, episodes: tuple[str, ...]) -> str:
    form = demos.format
    ranges = np.ptp(demos.plans, axis=(0, 1))
    most = int(np.argmax(ranges))
    speeds = np.abs(np.diff(demos.plans, axis=1)).max(axis=1) / form.dt
    episode, joint = np.unravel_index(int(np.argmax(speeds)), speeds.shape)
    return (
        f"{form.names[most]} moves most, over {ranges[most]:.3g} {form.units[most]}; fastest is "
        f"{form.names[joint]} of {episodes[episode]}, {speeds[episode, joint]:.3g} "
        f"{form.units[joint]}/s"
    )


def _ranges(demos: Demonstrations) -> str:
    parts = zip(demos.outcome_names, demos.outcome_units, demos.outcomes_seen.T, strict=True)
    return ", ".join(f"{n} {v.min():.3g} to {v.max():.3g} {u}" for n, u, v in parts)


def _coverage(demos: Demonstrations, episodes: tuple[str, ...]) -> str:
    points = demos.outcomes_seen
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
    gaps[np.diag_indices(demos.n)] = np.inf
    i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    nearest = f"nearest two are {episodes[i]} and {episodes[j]}, {gaps[i, j]:.3g} apart"
    if demos.outcome_dim == 1:
        return nearest
    corners = hull_corners(points[:, :2])
    x, y = points[corners, 0], points[corners, 1]
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    unit = demos.outcome_units[0]
    square = f" {unit}^2" if demos.outcome_units[1] == unit else ""
    name = " and ".join(demos.outcome_names[:2])
    return f"hull in {name} of {area:.3g}{square} by {len(corners)} of {demos.n}; {nearest}"
