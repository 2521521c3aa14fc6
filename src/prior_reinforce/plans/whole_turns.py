"""Different numbers for the same pose: angles a whole turn apart, quaternions of either sign.

An angle without stops, of a joint that turns endlessly or a yaw, is the same pose a turn further.
An attitude has two forms: q and -q as a unit quaternion; v and v - 2 pi v / |v|, the same turn the
other way round, as a rotation vector (axis times angle).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

TURN: Mapping[str, float] = {"rad": 2 * math.pi, "deg": 360.0}
"""A whole turn by unit."""
HALF = 0.01
"""Tolerance of a step of half a turn, as a share of a turn. Ours: what a wrist turns in one
frame."""
_NEAR = 0.3
"""Largest residual of a leap after a turn or a sign is taken out, in [rad]. Ours."""
CIRCLES = r"yaw|roll|heading|azimuth?|bearing|gier(winkel)?|roll(winkel)?"
"""Names of angles without stops."""
_OF_A_LIMB = re.compile(
    r"(shoulder|elbow|(fore|upper_?)arm|wrist|waist|torso|hip|neck|ankle|knee|schulter"
    r"|hand_?gelenk)[^a-z]*(roll|pitch|yaw|rotate)",
    re.IGNORECASE,
)
"""Joints of limbs, which have stops and are no Euler angles; `wrist_tcp_roll` and `arm_roll`, which
describe what an arm holds, are Euler angles."""
_WHOLE_CIRCLE = re.compile(rf"(^|[^a-z])({CIRCLES})($|[^a-z])", re.IGNORECASE)
_QUATERNION = re.compile(r"(?P<stem>.*?)(?P<part>(?<![a-z])q[._]?[xyzw]|[._ /]?[xyzw])", re.I)
ATTITUDE = "quat|orient|attitude|euler|axis[ _]?angle"
"""Words of attitudes."""
_OF_ATTITUDE = re.compile(rf"{ATTITUDE}|rot|(^|[^a-z])q$", re.IGNORECASE)
_VECTOR = re.compile(r"(?P<stem>.*?)(?P<part>(?<![a-z])r[._]?[xyz]|[._ /]?[xyz])", re.IGNORECASE)
_OF_VECTOR = re.compile(r"rot_?vec|axis_?angle", re.IGNORECASE)
_PATTERNS = ((_QUATERNION, _OF_ATTITUDE, "wxyz"), (_VECTOR, _OF_VECTOR, "xyz"))

_LAST_WORD = re.compile(r"(?P<stem>|.*?[^a-z])(?P<word>r[._]?[xyz]|[a-z]+)")
"""Splits `tool_yaw` into its stem and the angle's name."""

Frames = TypeVar("Frames", bound=np.ndarray)


def whole_circles(names: Sequence[str], units: Sequence[str]) -> tuple[str, ...]:
    """Return the angles without stops, by their names: yaw, roll, heading."""
    pairs = zip(names, units, strict=True)
    circles = [n for n, unit in pairs if unit in TURN and _WHOLE_CIRCLE.search(n)]
    return tuple(name for name in circles if not is_of_a_limb(name))


def is_of_a_limb(name: str) -> bool:
    """Return whether an angle is a limb's joint, which has stops: `left_wrist_roll`."""
    return _OF_A_LIMB.search(name) is not None


def attitudes(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the groups of names that are an attitude: `qx, qy, qz, qw`, or `rx, ry, rz`."""
    found = []
    for pattern, stem_pattern, letters in _PATTERNS:
        groups: dict[str, dict[str, str]] = {}
        for name in names:
            match = pattern.fullmatch(name.strip())
            if match is None:
                continue
            stem, part = match["stem"], match["part"].strip("._ /")
            if len(part) > 1 or stem_pattern.search(stem):
                groups.setdefault(stem, {})[part[-1].lower()] = name
        found += [
            tuple(n for n in names if n in group.values())
            for group in groups.values()
            if sorted(group) == sorted(letters)
        ]
    quaternions = {name for group in found if len(group) == 4 for name in group}
    return tuple(g for g in found if len(g) == 4 or quaternions.isdisjoint(g))


def other_form(attitude: np.ndarray) -> np.ndarray:
    """Return the other form of the same attitudes (..., 4) or (..., 3)."""
    if attitude.shape[-1] == 4:
        return -attitude
    angle = np.linalg.norm(attitude, axis=-1, keepdims=True)
    return attitude * (1 - 2 * math.pi / np.maximum(angle, 1e-9)) * (angle > 1e-9)


def leap_alone(motions: Sequence[np.ndarray]) -> bool:
    """Return whether one of three numbers leaps by a turn alone, as Euler angles do.

    The numbers of a rotation vector leap together, since its sign changes.
    """
    starts = np.array([motion[0] for motion in motions])
    alone, together = 0.0, 0.0
    for own, expected in ((starts, starts[:1]), *((m[1:], _expected(m)) for m in motions)):
        off = own - expected
        leaps = np.linalg.norm(off, axis=1) > 1
        each = [off - TURN["rad"] * np.round(off / TURN["rad"]), other_form(own) - expected]
        one, other = (np.linalg.norm(left[leaps], axis=1) for left in each)
        near = np.minimum(one, other) < _NEAR  # else a motion that is neither
        alone, together = alone + one[near].sum(), together + other[near].sum()
    return bool(alone < together / 2)


def _expected(motion: np.ndarray) -> np.ndarray:
    """Extrapolate each frame but the first from the two before it, without leaps."""
    steps = np.diff(motion, axis=0)
    steps[np.linalg.norm(steps, axis=1) > 1] = 0.0
    return motion[:-1] + np.vstack([np.zeros(motion.shape[1]), steps[:-1]])


def euler_angles(names: Sequence[str], units: Sequence[str]) -> tuple[tuple[str, str, str], ...]:
    """Return the groups of Euler angles: roll, pitch and yaw; a robot's A, B, C.

    The second of each group is the middle rotation, whatever the order of recording.
    """
    found = []
    for letters in _EULER:
        groups: dict[str, dict[str, str]] = {}
        for name, unit in zip(names, units, strict=True):
            word = _last_word(name)
            is_angle = unit in TURN and not is_of_a_limb(name)
            if is_angle and word is not None and word[1] in letters:
                groups.setdefault(word[0], {})[word[1]] = name
        for group in groups.values():
            if len(group) == 3:
                first, middle, last = (group[letter] for letter in letters)
                found.append((first, middle, last))
    return tuple(found)


def other_euler_forms(group: Sequence[str]) -> tuple[EulerForm, ...]:
    """Return the functions that compute the other angles of the same attitude, by the names.

    Two if the names do not tell whether the first and the last rotation are about the same axis.
    """
    words = tuple(word[1] for word in map(_last_word, group) if word is not None)
    return _EULER.get(words, _EITHER)


def _last_word(name: str) -> tuple[str, str] | None:
    """Split an angle's name into its stem and its last word: `tool_yaw`, `r.x`."""
    match = _LAST_WORD.fullmatch(name.strip().lower())
    return match and (match["stem"], re.sub("[._]", "", match["word"]))


def other_euler_angles(turn: float, angles: np.ndarray) -> np.ndarray:
    """Return the other angles (..., 3) of the same attitudes, about three axes: XYZ, ZYX, ..."""
    half = turn / 2
    return np.stack([angles[..., 0] + half, half - angles[..., 1], angles[..., 2] + half], axis=-1)


def other_proper_euler_angles(turn: float, angles: np.ndarray) -> np.ndarray:
    """Return the other angles (..., 3) of the same attitudes, about two axes: ZYZ, ZXZ, ..."""
    half = turn / 2
    return np.stack([angles[..., 0] + half, -angles[..., 1], angles[..., 2] + half], axis=-1)


EulerForm = Callable[[float, np.ndarray], np.ndarray]
"""Maps a whole turn and angles (..., 3), the middle rotation second, to the other angles."""
_EITHER = (other_euler_angles, other_proper_euler_angles)
_EULER: Mapping[tuple[str, ...], tuple[EulerForm, ...]] = {
    ("roll", "pitch", "yaw"): (other_euler_angles,),
    ("w", "p", "r"): (other_euler_angles,),
    ("o", "a", "t"): (other_proper_euler_angles,),
    ("a", "b", "c"): _EITHER,
    ("rx", "ry", "rz"): _EITHER,
    ("alpha", "beta", "gamma"): _EITHER,
    ("psi", "theta", "phi"): _EITHER,
}
"""Names of Euler angles, the middle rotation second, and their possible conventions: Fanuc's W, P,
R; Kawasaki's O, A, T; KUKA's A, B, C about three axes, and Doosan's about two."""
