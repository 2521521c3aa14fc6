"""Which recorded channel is which joint: one rule for the gate, the manifest and recordings."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, say_names, split_unit
from prior_reinforce.arm.robots.limits import is_joint, says_no_position
from prior_reinforce.errors import InvalidDemonstrationsError

_POSITIONS = re.compile(r"(^|[^a-z])(q|j|joints?|pos|positions?|angles?)$", re.IGNORECASE)
"""Names of joint positions."""
_OF_POSITIONS = re.compile(
    r"(?<=.)([./\[]+(positions?|angle|value|q)\]?|_pos(ition)?)$", re.IGNORECASE
)
"""What follows a joint's name where tools write the messages' fields: `/elbow/position`."""
_NUMBERED = re.compile(r"(?P<stem>.*?)[_.\[ ]*(?P<number>\d+)\]?")


def find_channels(wanted: Sequence[str], there: Sequence[str]) -> list[int] | None:
    """Return the channel of each wanted joint; None if one is missing.

    `joint4` is also `panda_joint4` and `joint4.pos`, and vice versa (`robots.limits.is_joint`).
    InvalidDemonstrationsError if two channels look like one joint.
    """
    found = [_find(name, there) for name in wanted]
    picked = [index for index in found if index is not None]
    return picked if len(picked) == len(wanted) else None


def missing_channels(wanted: Sequence[str], there: Sequence[str]) -> list[str]:
    """Return the wanted joints that are missing, by the rule of `find_channels`."""
    return [name for name in wanted if _find(name, there) is None]


def vectors(names: Sequence[str]) -> dict[str, list[int]]:
    """Return groups of consecutively numbered channels, by the name before the number.

    Of `q[0]`, `q[1]`, `actual_q_0`, `actual_q_1`, `t` they are `{"q": [0, 1], "actual_q": [2, 3]}`.
    """
    groups: dict[str, list[tuple[int, int]]] = {}
    for index, name in enumerate(names):
        match = _NUMBERED.fullmatch(name.strip())
        if match is not None and match["stem"]:
            groups.setdefault(match["stem"], []).append((int(match["number"]), index))
    return {stem: [i for _, i in sorted(g)] for stem, g in groups.items() if len(g) > 1}


def joint_vectors(names: Sequence[str], count: int) -> dict[str, list[int]]:
    """Return the groups of `vectors` of this size that could be joint positions.

    Groups named after velocities, torques, poses and the like could not.
    """
    return {
        stem: group
        for stem, group in vectors(names).items()
        if len(group) == count and not says_no_position(stem)
    }


def numbered_like(joints: Sequence[str], there: Sequence[str]) -> tuple[str, ...] | None:
    """Return the group of as many numbered channels as joints; None if it is not clear which.

    Of several groups of that size, one named like positions is taken: `q` beside `a`; `dq` or `tau`
    never.
    """
    fitting = joint_vectors(there, len(joints))
    called = [stem for stem in fitting if _POSITIONS.search(stem) is not None]
    clear = list(fitting) if len(fitting) == 1 else called
    return tuple(there[i] for i in fitting[clear[0]]) if len(clear) == 1 else None


def _find(name: str, there: Sequence[str]) -> int | None:
    bare = split_unit(name, CHANNEL_UNITS)[0]
    for exact in (name, bare):
        if exact in there:
            return there.index(exact)
    names = [_OF_POSITIONS.sub("", split_unit(channel, CHANNEL_UNITS)[0]) for channel in there]
    found = [i for i, other in enumerate(names) if is_joint(other, bare) or is_joint(bare, other)]
    if len(found) > 1:
        raise InvalidDemonstrationsError(
            f"{say_names([there[i] for i in found])} all look like {name}; name the recorded ones "
            "with --joints"
        )
    return found[0] if found else None
