"""Joints that a robot's description holds still, as the recordings have them."""

from __future__ import annotations

from collections.abc import Sequence

from prior_reinforce.arm.recordings.naming import find_channels
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, say_names, split_unit
from prior_reinforce.arm.robots.limits import RobotLimits, joint_of
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
    """Whether a column stays at a place, in the unit that it states, or in one that it may have."""
    unit = split_unit(column, CHANNEL_UNITS)[1]
    usual = max(abs(low), abs(high)) <= UNITS["rad"].largest
    units = [unit] if unit else ["m", "rad"] if usual else CHANNEL_UNITS
    scales = [scale for u in units for base in ("m", "rad") if (scale := factor(u, base))]
    return any(all(abs(s * end - at) <= _OFF for end in (low, high)) for s in scales or [1.0])
