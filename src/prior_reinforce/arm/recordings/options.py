"""Options for reading recordings: one record for Python, the command line and the readers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from prior_reinforce.arm.recordings.units import TIME_UNITS
from prior_reinforce.errors import ConfigurationError

NO_COLUMN = "none"
"""Value of `time_column` and of `episode_column` by which no such column is read."""
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": r"\s+"}
"""How the command line names what stands between two cells."""


@dataclass(frozen=True)
class ReadOptions:
    """How recordings are read; an option that the format does not use is refused.

    Raises:
        ConfigurationError: A value outside its range.
    """

    format: str | None = None
    """Format of the source: npz, csv, lerobot, hdf5, ros, zarr; detected if not given."""
    key: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Place of the motion in the source: array of an NPZ, feature of a LeRobot data set, path
    of an HDF5 data set inside an episode, topic of a bag. If not given, the only candidate; give
    it again for what is stored beside it, such as a gripper's opening."""
    rate: float | None = None
    """Frames per second, for a source without times; those that it has, and its own rate, must
    agree."""
    time_unit: Literal["s", "ms", "us", "ns", "min", "h", "day", "frame"] | None = None
    """Unit of the recorded times, if their name does not give it (`t_ms`); `frame` for a column
    that counts frames."""
    time_column: str | None = None
    """Column or array of the times: its name, or its number from 1; none reads no times."""
    episode_column: str | None = None
    """Column of a table that names the episode of each row; none if a file is one episode."""
    rests: float | None = None
    """Cut every recording where the arm stands still for so many seconds, into NAME-0, NAME-1 and
    on; 0 never cuts. If not given, one recording with several motions is asked about."""
    delimiter: str | None = None
    """Delimiter of a CSV: comma, semicolon, tab, space, or the character; inferred if not
    given."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign of a CSV; inferred if not given."""
    episodes: tuple[str, ...] | None = None
    """Episodes to keep, in order; all if not given."""
    leave_out: tuple[str, ...] | None = None
    """Episodes to leave out; they are not read."""
    joints: tuple[str, ...] | None = None
    """Recorded names of the channels to keep, in the plan's order; if the source names no columns,
    names for all of them. If not given, all channels (on the command line, the manifest's
    action names)."""
    units: tuple[str, ...] | None = None
    """Recorded units of those channels: rad, deg, m, cm, mm, in; a single one holds for all. If not
    given, those that the source states, else the plan's."""

    def __post_init__(self) -> None:
        """Check, and turn lists into tuples."""
        if isinstance(self.key, str):
            object.__setattr__(self, "key", (self.key,))
        for name in ("key", "episodes", "leave_out", "joints", "units"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, tuple(map(str, given)))
        if self.rate is not None and not (math.isfinite(self.rate) and self.rate > 0):
            raise ConfigurationError(
                f"rate must be a positive number of frames a second, got {self.rate}"
            )
        if self.rests is not None and not 0 <= self.rests < math.inf:
            raise ConfigurationError(f"rests must be seconds, at least 0, got {self.rests}")
        if self.time_unit not in (None, *TIME_UNITS):
            raise ConfigurationError(
                f"time-unit must be one of {', '.join(TIME_UNITS)}, got {self.time_unit!r}"
            )
        if self.delimiter not in (None, *DELIMITERS) and len(str(self.delimiter)) != 1:
            raise ConfigurationError(
                f"delimiter must be one of {', '.join(DELIMITERS)}, or one character, got "
                f"{self.delimiter!r}"
            )

    @property
    def given(self) -> dict[str, object]:
        """The options that were given, by field."""
        return {name: value for name, value in vars(self).items() if value not in (None, ())}

    def leaves_out(self, episode: str) -> bool:
        """Whether an episode was not asked for."""
        wanted = self.episodes is None or episode in self.episodes
        return not wanted or episode in (self.leave_out or ())
