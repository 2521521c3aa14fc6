"""One episode as it was recorded: uneven times, whatever channels the recorder had."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError

RecordingFormat = Literal["npz", "csv", "lerobot", "robomimic", "droid", "ros", "zarr"]
"""What can be read. `ros` covers ROS 1 bags, ROS 2 sqlite bags and MCAP; `zarr` is the replay
buffer of Diffusion Policy."""


@dataclass(frozen=True)
class Reading:
    """What the reader of a format is asked for; each field as in `read_recordings`."""

    key: str | None = None
    rate: float | None = None
    episodes: tuple[str, ...] | None = None
    joints: tuple[str, ...] | None = None

    def wants(self, episode: str) -> bool:
        """Whether that episode was asked for."""
        return self.episodes is None or episode in self.episodes


@dataclass(frozen=True, eq=False)
class Recording:
    """One demonstration before trimming and resampling."""

    episode: str
    """Name within its source, by which outcomes and messages refer to it."""
    times: np.ndarray
    """Time of each frame from the first, shape (T,), strictly increasing, in [s]."""
    positions: np.ndarray
    """What was recorded, shape (T, D), in the recorder's units, float64."""
    names: tuple[str, ...]
    """Names of the D channels, as recorded."""
    named: bool = True
    """False where the file names nothing and `names` were made up."""
    outcome: np.ndarray | None = None
    """Where the object landed, shape (k,), for the rare file that says so."""
    remarks: tuple[str, ...] = ()
    """What a person should know about how it was read."""

    def __post_init__(self) -> None:
        """Copy and check.

        Raises:
            InvalidDemonstrationsError: Shapes that do not fit, fewer than two frames, repeated
                names, times that do not increase, or values that are not finite.
        """
        try:
            times = np.array(self.times, dtype=np.float64)
            positions = np.array(self.positions, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise InvalidDemonstrationsError(
                f"episode {self.episode} must hold numbers: {error}; mend or drop it"
            ) from error
        names = tuple(str(name) for name in self.names)
        fits = positions.shape == (times.size, len(names)) and len(names) > 0
        if times.ndim != 1 or not fits or times.size < 2:
            raise InvalidDemonstrationsError(
                f"episode {self.episode} has times {times.shape} and positions {positions.shape} "
                f"for {len(names)} channels; expected (T,) and (T, {len(names)}) with T >= 2: "
                "mend or drop it"
            )
        if len(set(names)) != len(names):
            raise InvalidDemonstrationsError(
                f"episode {self.episode} repeats a channel name: {names}; rename the channels"
            )
        bad = np.argwhere(~np.isfinite(positions))
        if bad.size:
            frame, channel = bad[0].tolist()
            raise InvalidDemonstrationsError(
                f"episode {self.episode}: {names[channel]} is {positions[frame, channel]} at frame "
                f"{frame}, expected a finite number; mend or drop that episode"
            )
        if not np.all(np.isfinite(times)):
            frame = int(np.argmax(~np.isfinite(times)))
            raise InvalidDemonstrationsError(
                f"episode {self.episode}: time is {times[frame]} at frame {frame}, expected a "
                "finite number; mend or drop that episode"
            )
        backward = np.flatnonzero(np.diff(times) <= 0)
        if backward.size:
            frame = int(backward[0]) + 1
            raise InvalidDemonstrationsError(
                f"episode {self.episode}: time does not increase at frame {frame} "
                f"({times[frame - 1]:g} s, then {times[frame]:g} s); sort or drop those frames"
            )
        if self.outcome is not None:
            outcome = np.atleast_1d(np.array(self.outcome, dtype=np.float64))
            object.__setattr__(self, "outcome", outcome)
        times -= times[0]
        times.setflags(write=False)
        positions.setflags(write=False)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "names", names)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, in [s]."""
        return float(self.times[-1])

    @property
    def period(self) -> float:
        """Median time between two frames, in [s]."""
        return float(np.median(np.diff(self.times)))


def made_up_names(count: int) -> tuple[str, ...]:
    """`joint1`, `joint2`, ...: for channels that a file does not name."""
    return tuple(f"joint{i}" for i in range(1, count + 1))


def evenly(count: int, rate: float | None, episode: str) -> np.ndarray:
    """Times of frames that a file does not time, from the given rate.

    Raises:
        FileFormatError: No rate was given.
    """
    if rate is None:
        raise FileFormatError(
            f"episode {episode} holds neither times nor a rate; give the rate in frames a second"
        )
    return np.arange(count) / rate
