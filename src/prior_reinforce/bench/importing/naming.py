"""Which recorded channel is which joint: one rule for the gate, the manifest and recordings."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.bench.importing.units import CHANNEL_UNITS, say_names, split_unit
from prior_reinforce.bench.robots.limits import is_joint
from prior_reinforce.errors import InvalidDemonstrationsError

_POSITIONS = re.compile(r"(^|[^a-z])(q|j|joints?|pos|positions?|angles?)$", re.IGNORECASE)
"""How the positions of joints are called."""
_ELSE = re.compile(
    r"vel|speed|accel|jerk|torque|tau|effort|force|wrench|current|temperature|cartesian|tcp|pose"
    r"|(^|[^a-z])(acc|d+q|qd+|q_?dot|temp|tool|ee|eef)($|[^a-z])",
    re.IGNORECASE,
)
"""How what is no position of a joint is called. Ours, and rather too much than too little: what is
not offered can still be said."""
_NUMBERED = re.compile(r"(?P<stem>.*?)[_.\[ ]*(?P<number>\d+)\]?")


def find_channels(wanted: Sequence[str], there: Sequence[str]) -> list[int] | None:
    """Return which channel is each joint that is wanted; None where one is not there.

    Args:
        wanted: Names of joints, as recorded or as the plan calls them: `joint4` is also
            `panda_joint4` and `joint4.pos`, and the other way round (`robots.limits.is_joint`).
        there: Names of the channels.

    Raises:
        InvalidDemonstrationsError: Two channels look like one joint.
    """
    found = [_find(name, there) for name in wanted]
    picked = [index for index in found if index is not None]
    return picked if len(picked) == len(wanted) else None


def missing_channels(wanted: Sequence[str], there: Sequence[str]) -> list[str]:
    """Return the joints that are wanted and not there, by the rule of `find_channels`."""
    return [name for name in wanted if _find(name, there) is None]


def vectors(names: Sequence[str]) -> dict[str, list[int]]:
    """Return groups of channels that are numbered on, by the name before the number.

    Args:
        names: For instance `q[0]`, `q[1]`, `actual_q_0`, `actual_q_1`, `t`.

    Returns:
        Their indices, in order: `{"q": [0, 1], "actual_q": [2, 3]}`.
    """
    groups: dict[str, list[tuple[int, int]]] = {}
    for index, name in enumerate(names):
        match = _NUMBERED.fullmatch(name.strip())
        if match is not None and match["stem"]:
            groups.setdefault(match["stem"], []).append((int(match["number"]), index))
    return {stem: [i for _, i in sorted(g)] for stem, g in groups.items() if len(g) > 1}


def joint_vectors(names: Sequence[str], count: int) -> dict[str, list[int]]:
    """Return the groups of `vectors` that have a size and could be positions of joints.

    Groups whose name says something else, such as velocities, torques or a pose, could not.
    """
    return {
        stem: group
        for stem, group in vectors(names).items()
        if len(group) == count and _ELSE.search(stem) is None
    }


def could_be_forgotten(names: Sequence[str], count: int) -> set[str]:
    """Return which channels that are not joints may belong to the motion, such as a gripper's.

    Those whose name says something else do not, and nor does a numbered group of the joints' size
    or more, such as their commands.

    Args:
        names: Of all channels that are left out.
        count: Of joints.
    """
    groups = {i for group in vectors(names).values() if len(group) >= max(count, 2) for i in group}
    return {name for i, name in enumerate(names) if i not in groups and _ELSE.search(name) is None}


def numbered_like(joints: Sequence[str], there: Sequence[str]) -> tuple[str, ...] | None:
    """Return numbered channels of which there are as many as joints; None where nothing is clear.

    Where several groups are as many, one that is called like positions is taken: `q` beside `a`.
    Groups that say they are something else never are: `dq`, `tau`.
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
    names = [split_unit(channel, CHANNEL_UNITS)[0] for channel in there]
    found = [i for i, other in enumerate(names) if is_joint(other, bare) or is_joint(bare, other)]
    if len(found) > 1:
        raise InvalidDemonstrationsError(
            f"{say_names([there[i] for i in found])} all look like {name}; name the recorded ones "
            "with --joints"
        )
    return found[0] if found else None
