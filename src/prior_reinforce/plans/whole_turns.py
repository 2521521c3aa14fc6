"""Numbers that differ and are one pose: angles a whole turn apart, quaternions of either sign.

An angle a turn further is the same pose where nothing stops it: of a joint that turns endlessly, of
a yaw. An attitude has two forms: q and -q as a unit quaternion, and as a rotation vector
(axis times angle) the same turn the other way round, v - 2 pi v / |v|.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

TURN: Mapping[str, float] = {"rad": 2 * math.pi, "deg": 360.0}
"""A whole turn by unit."""
_WHOLE_CIRCLE = re.compile(
    r"(^|[^a-z])(yaw|roll|heading|azimuth|azimut|bearing|gier(winkel)?|roll(winkel)?)($|[^a-z])",
    re.IGNORECASE,
)
"""Names of angles that nothing stops."""
_QUATERNION = re.compile(r"(?P<stem>.*?)(?P<part>(?<![a-z])q[._]?[xyzw]|[._ /]?[xyzw])", re.I)
_OF_ATTITUDE = re.compile(r"quat|orient|rot|attitude|(^|[^a-z])q$", re.IGNORECASE)
_VECTOR = re.compile(r"(?P<stem>.*?)(?P<part>(?<![a-z])r[._]?[xyz]|[._ /]?[xyz])", re.IGNORECASE)
_OF_VECTOR = re.compile(r"rot_?vec|axis_?angle", re.IGNORECASE)
_PATTERNS = ((_QUATERNION, _OF_ATTITUDE, "wxyz"), (_VECTOR, _OF_VECTOR, "xyz"))

_LAST_WORD = re.compile(r"(?P<stem>|.*[^a-z])(?P<word>[a-z]+)")
"""`tool_yaw`: what it is of, and which angle."""

Frames = TypeVar("Frames", bound=np.ndarray)


def whole_circles(names: Sequence[str], units: Sequence[str]) -> tuple[str, ...]:
    """Return the angles that nothing stops, by their names: yaw, roll, heading."""
    pairs = zip(names, units, strict=True)
    return tuple(n for n, unit in pairs if unit in TURN and _WHOLE_CIRCLE.search(n))


def attitudes(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the groups of names that are an attitude: `qx, qy, qz, qw`, or `rx, ry, rz`."""
    found = []
    for pattern, says, letters in _PATTERNS:
        groups: dict[str, dict[str, str]] = {}
        for name in names:
            match = pattern.fullmatch(name.strip())
            if match is None:
                continue
            stem, part = match["stem"], match["part"].strip("._ /")
            if len(part) > 1 or says.search(stem):
                groups.setdefault(stem, {})[part[-1].lower()] = name
        found += [
            tuple(n for n in names if n in group.values())
            for group in groups.values()
            if sorted(group) == sorted(letters)
        ]
    quaternions = {name for group in found if len(group) == 4 for name in group}
    return tuple(g for g in found if len(g) == 4 or quaternions.isdisjoint(g))


def other_form(attitude: np.ndarray) -> np.ndarray:
    """Return the other numbers of the same attitudes (..., 4) or (..., 3)."""
    if attitude.shape[-1] == 4:
        return -attitude
    angle = np.linalg.norm(attitude, axis=-1, keepdims=True)
    return attitude * (1 - 2 * math.pi / np.maximum(angle, 1e-9)) * (angle > 1e-9)


def euler_angles(names: Sequence[str], units: Sequence[str]) -> tuple[tuple[str, str, str], ...]:
    """Return the groups of angles that are an attitude: roll, pitch and yaw; a robot's A, B, C.

    The second of each is the middle turn, whatever the order in which they are recorded.
    """
    found = []
    for letters in (("roll", "pitch", "yaw"), ("a", "b", "c")):
        groups: dict[str, dict[str, str]] = {}
        for name, unit in zip(names, units, strict=True):
            match = _LAST_WORD.fullmatch(name.strip().lower())
            if unit in TURN and match is not None and match["word"] in letters:
                groups.setdefault(match["stem"], {})[match["word"]] = name
        for group in groups.values():
            if len(group) == 3:
                first, middle, last = (group[letter] for letter in letters)
                found.append((first, middle, last))
    return tuple(found)


def other_euler_angles(angles: np.ndarray, turn: float) -> np.ndarray:
    """Return the other Euler angles (..., 3) of the same attitudes, the middle turn second."""
    half = turn / 2
    return np.stack([angles[..., 0] + half, half - angles[..., 1], angles[..., 2] + half], axis=-1)
