"""One episode as it was recorded: uneven times, whatever channels the recorder had."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from prior_reinforce.errors import InvalidDemonstrationsError

RecordingFormat = Literal["npz", "csv", "lerobot", "robomimic", "droid", "ros"]
"""What can be read. `ros` covers ROS 1 bags, ROS 2 sqlite bags and MCAP."""


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

    def __post_init__(self) -> None:
        """Copy and check.

        Raises:
            InvalidDemonstrationsError: Shapes that do not fit, fewer than two frames, repeated
                names, times that do not increase, or values that are not finite.
        """
        try:
            times = np.array(self.times, dtype=np.float64)
            positions = np.array(self.positions, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidDemonstrationsError(
                f"episode {self.episode} must hold numbers: {error}; mend or drop it"
            ) from error
        names = tuple(str(name) for name in self.names)
        if times.ndim != 1 or positions.shape != (times.size, len(names)) or times.size < 2:
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
        backward = np.flatnonzero(~(np.diff(times) > 0))
        if backward.size or not np.all(np.isfinite(times)):
            frame = int(backward[0]) + 1 if backward.size else 0
            raise InvalidDemonstrationsError(
                f"episode {self.episode}: time does not increase at frame {frame} "
                f"({times[frame - 1]:g} s, then {times[frame]:g} s); sort or drop those frames"
            )
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
