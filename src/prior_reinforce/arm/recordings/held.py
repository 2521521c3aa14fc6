"""Joints that a robot's description holds still, as the recordings have them."""

from __future__ import annotations

from collections.abc import Sequence

from prior_reinforce.arm.recordings.naming import find_channels
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, say_names, split_unit
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.units import UNITS, factor

_OFF = 0.01
"""By which a held joint may be off, in [m] and [rad]. Ours: a lift's play and its encoder's noise;
at an arm's length 0.01 rad is as much."""


def check_held(recordings: Sequence[Recording], robot: RobotLimits | None) -> None:
    """Check that joints that the robot holds still stand in the recordings where it says.

    Columns without a unit are in m and rad, or where they are too large for these in another: a
    lift that is held at 0.35 m may be recorded as 350.

    Raises:
        InvalidDemonstrationsError: One stands elsewhere, or moves: the arm's reach and its box
            would be wrong.
    """
    for joint, at in robot.held.items() if robot is not None else ():
        elsewhere: dict[tuple[float, float], list[str]] = {}
        for recording in recordings:
            for column in [one for one in recording.beside if find_channels([joint], [one])]:
                span, unit = recording.beside[column][:2], split_unit(column, CHANNEL_UNITS)[1]
                units = (
                    ["m", "rad"] if max(map(abs, span)) <= UNITS["rad"].largest else CHANNEL_UNITS
                )
                units = [unit] if unit else units
                scales = [scale for u in units for b in ("m", "rad") if (scale := factor(u, b))]
                if not any(all(abs(s * end - at) <= _OFF for end in span) for s in scales or [1.0]):
                    low, high = (float(f"{end:.3g}") for end in span)
                    elsewhere.setdefault((low, high), []).append(recording.episode)
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
