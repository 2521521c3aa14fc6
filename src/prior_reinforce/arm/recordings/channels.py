"""What a recorded channel is by its name: one table for all that read, judge and align channels.

A name tells a kind, and the kind the units that its numbers may be in. Some kinds are told by the
names beside: `x` is a place beside `y`, and an entry of a matrix has eight others. Which names are
no position of a robot's joint at all, a rate for instance, `robots.limits.says_no_position` tells.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from itertools import takewhile

from prior_reinforce.plans.plan_format import OF_A_TOOL, PlanFormat
from prior_reinforce.plans.whole_turns import CIRCLES, TURN, attitudes, euler_angles
from prior_reinforce.units import base_of, is_rate


class Kind(Enum):
    """What a channel is; in no unit that its kind cannot have, unless that is stated."""

    ANGLE = "an angle: joint3, base_yaw, gripper_roll, index_finger_mcp"
    SLIDE = "an axis that turns or slides: a rail, E1, a SCARA's d3"
    ROTATION = "a part of a rotation vector, or of angles called like one: rx, ry, rz"
    QUATERNION = "a part of a quaternion: qx, qy, qz, qw"
    MATRIX = "an entry of a matrix: R11 to R33, rot6d_0"
    PLACE = "a coordinate: x, y, z, tool_x; px, py, pz beside an attitude"
    LENGTH = "a displacement, or how far something is extended: dx, delta_z, torso_lift_joint"
    VELOCITY = "how fast something goes: vx, x.vel"
    TURN_RATE = "how fast something turns: dq0, joint1_vel, wz"
    TOOL = "a gripper, or a sensor: a width, a share, a pressure"
    UNKNOWN = "a name that says nothing"

    @property
    def is_pose(self) -> bool:
        """Whether it is a part of where something is, and no joint."""
        return self in (Kind.ROTATION, Kind.QUATERNION, Kind.PLACE)

    def usual_unit(self, largest: float) -> str:
        """Return the unit of its numbers where nobody states one, by the largest of them."""
        if self in _USUAL:
            return _USUAL[self]
        share = self is Kind.TOOL and largest <= 1
        return "1" if share or self in (Kind.QUATERNION, Kind.MATRIX) else "rad"


_USUAL = {
    Kind.PLACE: "m",
    Kind.LENGTH: "m",
    Kind.VELOCITY: "m/s",
    Kind.TURN_RATE: "rad/s",
}
"""Units of kinds that have the same whatever their numbers."""
_TURN = rf"{CIRCLES}|pitch|rotation|angle|winkel"
_ALWAYS = rf"{_TURN}|d(r[xyz]|roll|pitch|yaw|heading)|mcp|pip|dip|cmc|flex(ion)?|abd(uction)?"
_ALONE = "j|q|a"
_WITHIN = (
    rf"{_TURN}|joint|axis|achse|gelenk|rot|turn|twist|swing|steer|theta|phi|psi|alpha|beta|gamma"
    r"|base|basis|waist|torso|shoulder|schulter|elbow|ellbogen|arm|wrist|hand|hip|knee|ankle|neck"
    r"|head|pan|tilt"
)
"""Words of angles: that outweigh a gripper's, that stand alone, or within others (`Handgelenk`)."""
_TOOL = rf"{OF_A_TOOL}|pressure|force|torque|voltage|temperature"
_RAIL = r"rail|track|linear|slider?|gantry|prismatic|carriage"
_SLIDE = rf"[de]\d|ext(ernal)?([_ ]?axis)?[_ ]?\d*|{_RAIL}"
_ALONG = rf"[xyz]|{_RAIL}|belt|conveyor|(tcp|eef?)(?!.*[3-5]\]?$)"
"""What goes at m/s; of six numbered speeds of a tool, `actual_TCP_speed_0` (UR), the last turn."""


def _word(words: str) -> str:
    """A pattern of words that stand apart from other letters."""
    return rf"(^|[^a-z])({words})s?($|[^a-z])"


_RATE = r"([._ ]?(vel(ocit(y|ies))?|speeds?)[_.\[ ]*\d*\]?)"
_BY_NAME = (
    (re.compile(r"(^|.*[^a-z])(d_?|delta[_. ]?)[xyz]|.*torso_?lift.*", re.IGNORECASE), Kind.LENGTH),
    (re.compile(rf"(^|.*[^a-z])(v[xyz]|({_ALONG}){_RATE})", re.IGNORECASE), Kind.VELOCITY),
    (re.compile(rf"(^|.*[^a-z])(w[xyz]|(dq|qd)[_.\[ ]*\d+\]?)|.*{_RATE}", re.I), Kind.TURN_RATE),
    (re.compile(r".*quat(ernion)?[_.\[ ]*\d\]?", re.IGNORECASE), Kind.QUATERNION),
    (re.compile(r".*(rot_?vec|axis_?angle)[_.\[ ]*\d\]?", re.IGNORECASE), Kind.ROTATION),
    (re.compile(r".*rot(ation)?_?6d.*", re.IGNORECASE), Kind.MATRIX),
)
"""Kinds by what the whole name is, unless it is a gripper's; the first counts."""
_BY_WORD = (
    (re.compile(_word(_ALWAYS), re.IGNORECASE), Kind.ANGLE),
    (re.compile(_TOOL, re.IGNORECASE), Kind.TOOL),
    (re.compile(_word(_SLIDE), re.IGNORECASE), Kind.SLIDE),
    (re.compile(rf"{_word(_ALONE)}|{_WITHIN}", re.IGNORECASE), Kind.ANGLE),
)
"""Kinds by a word in the name; the first counts."""
_COORDINATE = re.compile(r"(?P<group>|.*[^a-z0-9])(?P<part>[xyz])([ _-]?ax[ei]s)?", re.IGNORECASE)
_OF_PLACE = re.compile(
    r"|(.*[^a-z])?(p|pos|positions?|place|trans(lation)?|cart(esian)?|tcp|tool|tip|ee|eef|pose|xyz"
    r"|(end_?)?effector|flange|hand|location|ax[ei]s|base|state|action)[^a-z]*",
    re.IGNORECASE,
)
"""What x, y and z are the place of: `tool_x`. Others may be joints: `hip_x`, `hip_y`."""
_ENTRY = re.compile(r"(?P<group>.*?)[_\[ ]*(?P<part>[0-4][,_]?[0-4])\]?")
_POSE = re.compile(
    r"(?P<group>(.*[^a-z])?(pose|(?P<place>(ee|eef|tcp|tool|(end_?)?effector|cartesian)"
    r"[_ ]?(pos(ition)?|xyz))))[_.\[ ]*(?P<part>\d)\]?",
    re.IGNORECASE,
)
_PARTS_OF_POSE = {
    size: (Kind.PLACE,) * 3 + (attitude,) * (size - 3)
    for size, attitude in ((3, Kind.PLACE), (6, Kind.ROTATION), (7, Kind.QUATERNION))
}
"""A whole pose that is numbered, by its size: `actual_TCP_pose_0` to `actual_TCP_pose_5`. Three are
a place only where they are called so: `eef_pos_0` to `eef_pos_2`."""
_OPENING = re.compile(
    r"(.*[^a-z])?(gripper|jaw|claw|finger)s?([ _./-]*(width|pos(ition)?|q(pos)?|opening|state|value"
    r"|joint\d*))*",
    re.IGNORECASE,
)
"""Names of a gripper's opening: the only one, `gripper_width`, is the plan's `gripper`."""
_COMMANDED = re.compile(
    r"(^|[^a-z])(cmd|command(ed)?|actions?|target|des(ired)?|ref(erence)?|goal|set(point)?|leader"
    r"|soll|(?<=q_)d)($|[^a-z])",
    re.IGNORECASE,
)
_MEASURED = re.compile(
    r"(^|[^a-z])(act(ual)?|meas(ured)?|real|state|curr(ent)?|ist|obs(ervation)?|feedback|follower)"
    r"($|[^a-z])",
    re.IGNORECASE,
)
"""Words of what was commanded, and of what was measured."""


def kinds(names: Sequence[str]) -> tuple[Kind, ...]:
    """Return what each of a recording's channels is."""
    of_group = {name: Kind.PLACE for name in _grouped(names, _COORDINATE, _are_place)}
    of_group |= {name: Kind.MATRIX for name in _grouped(names, _ENTRY, _are_matrix)}
    poses: dict[str, list[str]] = {}
    for name in names:
        match = _POSE.fullmatch(name.strip())
        if match and (
            match["place"] or _by_word(match["group"]) is not Kind.ANGLE
        ):  # `joint_pose_0`
            poses.setdefault(match["group"], []).append(name)
    for pose in poses.values():
        match = _POSE.fullmatch(pose[0].strip())
        if len(pose) > 3 or (match and match["place"]):
            of_group |= zip(sorted(pose), _PARTS_OF_POSE.get(len(pose), ()), strict=False)
    for group in attitudes(names):
        of_group |= dict.fromkeys(group, Kind.QUATERNION if len(group) == 4 else Kind.ROTATION)
    found = [of_group.get(name) or _by_word(name) for name in names]
    for i in [*_place_beside_attitude(names, found)]:
        found[i] = Kind.PLACE
    return tuple(found)


def zero_at_rest(names: Sequence[str], units: Sequence[str | None]) -> list[int]:
    """Return the columns that are 0 at rest: increments, and speeds by their name or their unit."""
    form = PlanFormat(tuple(names), tuple(unit or "1" for unit in units), 1.0)
    speeds, increments = (Kind.VELOCITY, Kind.TURN_RATE), form.increments
    each = enumerate(zip(form.units, kinds(names), strict=True))
    return [i for i, (u, kind) in each if i in increments or kind in speeds or is_rate(u)]


def one_for_all(
    unit: str, names: Sequence[str], plan_units: Sequence[str] | None = None
) -> list[str | None]:
    """Return one unit for each channel that can be in it, and None for the others.

    No gripper and no place is in degrees. Where the plan has channels of that unit's kind, these.
    """
    base = base_of(unit)[0]
    fits = [base_of(own)[0] == base for own in plan_units or (base,) * len(names)]
    angles = (Kind.ANGLE, Kind.SLIDE, Kind.ROTATION, Kind.UNKNOWN)
    each = zip(kinds(names), fits, strict=True)
    return [
        unit if (kind in angles or base not in TURN) and (fit or not any(fits)) else None
        for kind, fit in each
    ]


def _by_word(name: str) -> Kind:
    for pattern, kind in _BY_NAME:
        if pattern.fullmatch(name.strip()) and not re.search(_TOOL, name, re.IGNORECASE):
            return kind
    spaced = re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", name)  # `baseYaw` as `base_Yaw`
    return next((kind for pattern, kind in _BY_WORD if pattern.search(spaced)), Kind.UNKNOWN)


def _place_beside_attitude(names: Sequence[str], found: Sequence[Kind]) -> Iterator[int]:
    """Where three names, and not more, next to an attitude say nothing else: `px`, `x_tcp`, `p_0`.

    Beside roll, pitch and yaw, which a wrist's joints are called too, they say x, y, z.
    """
    sure = attitudes(names)
    for group in (*sure, *euler_angles(names, ("rad",) * len(names))):
        at = [names.index(name) for name in group]
        for beside in (range(min(at))[::-1], range(max(at) + 1, len(names))):
            place = sorted(takewhile(lambda i: found[i] is Kind.UNKNOWN, beside))
            says = all(letter in names[i].lower() for letter, i in zip("xyz", place, strict=False))
            if len(place) == 3 and (says or group in sure):
                yield from place


def _grouped(
    names: Sequence[str], pattern: re.Pattern[str], are: Callable[[str, set[str]], bool]
) -> Iterator[str]:
    """Names that a pattern splits into a group and a part of it, of the groups that `are` so."""
    matches = {name: match for name in names if (match := pattern.fullmatch(name.strip()))}
    groups: dict[str, set[str]] = {}
    for match in matches.values():
        groups.setdefault(match["group"], set()).add(match["part"].lower())
    for name, match in matches.items():
        if are(match["group"], groups[match["group"]]):
            yield name


def _are_place(group: str, parts: set[str]) -> bool:
    """Two or three coordinates of a place."""
    return len(parts) > 1 and _OF_PLACE.fullmatch(group) is not None


def _are_matrix(_: str, parts: set[str]) -> bool:
    """Three rows and columns or more, of which every entry is there."""
    rows, columns = ({part[k] for part in parts} for k in (0, -1))
    return min(len(rows), len(columns)) >= 3 and len(parts) == len(rows) * len(columns)


def is_opening(name: str) -> bool:
    """Whether a name is of how far a gripper is open: `gripper`, `robot0_gripper_qpos`."""
    return _OPENING.fullmatch(name) is not None


def measured_of(stems: Sequence[str]) -> str | None:
    """Return the one of several readings of a motion that was measured; None if none says so."""
    for left in (
        [stem for stem in stems if not _COMMANDED.search(stem)],
        [stem for stem in stems if _MEASURED.search(stem)],
    ):
        if len(left) == 1:
            return left[0]
    return None
