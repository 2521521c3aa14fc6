"""The kind of a channel by its name: one table for reading, judging, aligning, moving and checking.

The name determines a kind, and the kind the possible units. Some kinds follow from neighbouring
names: `x` is a place beside `y`, and an entry of a matrix has eight others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from itertools import takewhile

from prior_reinforce.plans.whole_turns import ATTITUDE, CIRCLES, TURN, attitudes, euler_angles
from prior_reinforce.units import base_of, is_rate, per_time


class Kind(Enum):
    """Kind of a channel; it limits the units, unless one is stated."""

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
        """Whether it is part of a pose, and no joint."""
        return self in (Kind.ROTATION, Kind.QUATERNION, Kind.PLACE)

    def usual_unit(self, largest: float) -> str:
        """Return the unit of its numbers if none is stated, by the largest of them."""
        if self in _USUAL:
            return _USUAL[self]
        share = self is Kind.TOOL and largest <= 1
        return "1" if share or self in (Kind.QUATERNION, Kind.MATRIX) else "rad"


_USUAL = {Kind.PLACE: "m", Kind.LENGTH: "m", Kind.VELOCITY: "m/s", Kind.TURN_RATE: "rad/s"}
"""Units that do not depend on the numbers."""
RATES = (Kind.VELOCITY, Kind.TURN_RATE)
_ANGLES = rf"{CIRCLES}|pitch|theta|phi|psi"
_INCREMENT = re.compile(
    rf"\b(d(r?[xyz]|{_ANGLES}|angle|pos|rot|joint|grip(per)?)"
    r"|delta(?! \d+$)|incr?|increments?|world vector)\b|^d (?!\d|q\b)"
)
"""Names of increments, in `_words`; `world_vector` is that of RT-1 (Open X-Embodiment), and
`delta_1` a joint of a delta robot."""
_LOAD = r"force|torque|wrench|effort|\bloads?\b|\b(f|tau) ext\b"
"""Names of loads; `O_F_ext_hat_K` and `tau_ext` are libfranka's."""
_TOOL = (
    r"grip|jaw|finger|width|claw|opening|suction|robotiq|wsg|greifer|pince|夹爪|夹具|vacuum|valve"
    r"|magnet|trigger|\b(pump|pinch|tong)s?\b|drive joint|tool d[io]\b"
)
"""Words of a gripper or another tool, in `_words`: `drive_joint` is the xArm's gripper."""
_OF_TOOL = re.compile(rf"{_TOOL}|knuckle|thumb|\bhand( \d+)?$")
_OF_BASE = r"\b(base|platform|odom(etry)?|rover|agv)\b"
"""Names of what carries an arm."""
_OF_COORDINATE = re.compile(r"(?<!\b[qr] )\bd?[xyz]( \d+| delta)?$|world vector")
_OF_ATTITUDE = re.compile(rf"{ATTITUDE}|\brot|\bangle")
_IN_SPACE = rf"\b([dvr]?[xyz]|q[wxyz])\b|{ATTITUDE}|\b(rot\w*|pose) (\w+ )*\d|\bd?({_ANGLES})\b"
"""Names of coordinates and attitudes, in `_words`; a tool's one angle is its opening."""
_OF_POSE = re.compile(rf"{_IN_SPACE}|\brot|\bpose\b|\bd?angle\b")

_TURN = rf"{CIRCLES}|pitch|rotation|angle|winkel"
_ALWAYS = rf"{_TURN}|d(r[xyz]|{_ANGLES})|mcp|pip|dip|cmc|flex(ion)?|abd(uction)?"
_ALONE = "j|q|a"
_WITHIN = (
    rf"{_TURN}|joint|axis|achse|gelenk|rot|turn|twist|swing|steer|theta|phi|psi|alpha|beta|gamma"
    r"|base|basis|waist|torso|shoulder|schulter|elbow|ellbogen|arm|wrist|hand|hip|knee|ankle|neck"
    r"|head|pan|tilt"
)
"""Words of angles: outweighing a gripper's, standing alone, or within others (`Handgelenk`)."""
_RAIL = r"rail|track|linear|slider?|gantry|prismatic|carriage"
_SLIDE = r"(^|\bscara )[de] ?\d|\baxis e \d|(^|\b(?!d*q|tau|theta|ee|elbow)\w+ )[de]\d"
"""`d3` and `E1`; but `joint_d_3` and Franka's `tau_J_d_3` are desired values."""
_STRAIGHT = r"[xyz]|lin(ear)?"
_ALONG = rf"{_STRAIGHT}|{_RAIL}|belt|conveyor|(tcp|eef?)(?!.* [3-5]$)"
"""Names of what moves at m/s; the last three of a tool's six speeds (UR) are angular."""
_OMEGA = r"omega(?! \d+ joint)"
_SPEED = (
    rf"((?<!(?<!ang)le|\b(?:be|mo|ni|no))(?<!tra|gra|mar|swi|sho)vel(s|o|cmd|ang|{_STRAIGHT})?\b"
    rf"|\bvel(?!vet|cro)|veloc|speed|geschwind|vitesse|速|{_OMEGA}|(?<!d)dot(?=( \d+)?$)"
    rf"|\btwist(?= (ang(ular)?|{_STRAIGHT})\b))"
)
"""Names of speeds, `cmdvel` and `xdot` too; `swivel`, `level`, UR's `movel`, `wrist_twist` and
`omega7_joint1` are none."""
_ACCELERATION = r"accel|\b(ang|lin)?acc\b|ddot\b|jerk|beschleun"
_POSITION = r"(q ?(pos)?|pos(itions?)?|angles?)\b"
_NO_POSITION = re.compile(
    rf"{_SPEED}|{_LOAD}|{_ACCELERATION}|tau|(?<!pos )(?<!position )(?<!positions )(?<!\bq )current"
    rf"(?! (\w+ )*{_POSITION})|temperature|voltage|cartesian|tcp|pose"
    r"|delta|increment|relative|residual|derivative|moment|couple|力矩|扭矩|トルク|增量|増分"
    r"|\b(d+ ?q|qd+|q ?dot|dot|temp|tool|ee|eef|rate|inc|incr|diff|rel|err|error|offset|step"
    r"|change|noise|std|var|gain|k ?[pid])\b"
)
"""Words of rates, torques, increments and others that are no joint position, in `_words`. Ours, and
broad on purpose: a column that is not taken for a joint is reported, and can be renamed."""
_NO_CHANNEL = re.compile(
    r"\b(offset|bias|latency|jitter|(control|sampl\w*|command|update|loop|frame|refresh|recording"
    r"|success) (\w+ )*(rate|freq(uency)?|hz|fps)|fps)\b"
)
"""Words of what is no part of a motion at all, in `_words`: `q_offset`, `control_rate`."""
_DERIVED = re.compile(r"(^|[/.:])(d(?!\W?_?\d)|dd+|v|dv|dt)($|[^a-z])", re.IGNORECASE)
"""Prefixes of derivatives: `d_joint1`; `q_d` is desired, `d3` slides."""
_BY_NAME = (
    (r"\bd ?[xyz]$|torso ?lift", Kind.LENGTH),
    (rf"\bw[xyz]$|{_OMEGA}|\b(dq|qd|d q|q ?dot)\b|\b({_ANGLES}|turn) rate\b", Kind.TURN_RATE),
    (rf"\b(ang|rot).*{_SPEED}|{_SPEED}.*\bang", Kind.TURN_RATE),
    (rf"\bv[xyz]$|\b({_ALONG}) ?{_SPEED}", Kind.VELOCITY),
    (rf"{_SPEED}\w* ({_STRAIGHT})\b|vel({_STRAIGHT})\b", Kind.VELOCITY),
    (_SPEED, Kind.TURN_RATE),
    (r"quat(ernion)? \d$", Kind.QUATERNION),
    (r"(rot ?vec|axis ?angle) \d$", Kind.ROTATION),
    (r"rot(ation)? ?6 ?d\d*\b", Kind.MATRIX),
)
"""Kinds by patterns in `_words`, unless the name is of a tool; the first match counts."""
_BY_WORD = (
    (rf"\b({_ALWAYS})s?\b", Kind.ANGLE),
    (rf"{_TOOL}|{_LOAD}|pressure|voltage|temperature", Kind.TOOL),
    (rf"\b({_RAIL}|ext(ernal)?( ?axis)?)s?\b|{_SLIDE}", Kind.SLIDE),
    (rf"\b({_ALONE})s?\b|{_WITHIN}", Kind.ANGLE),
)
"""Kinds by a word in the name; the first match counts."""
_COORDINATE = re.compile(r"(?P<group>|.*[^a-z0-9])(?P<part>[xyz])([ _-]?ax[ei]s)?", re.IGNORECASE)
_OF_PLACE = re.compile(
    r"|(.*[^a-z])?(p|pos|positions?|place|trans(lation)?|cart(esian)?|tcp|tool|tip|ee|eef|pose|xyz"
    r"|(end_?)?effector|flange|hand|location|ax[ei]s|base|state|action)[^a-z]*",
    re.IGNORECASE,
)
"""Names of what has a place x, y and z: `tool_x`. Others may be joints: `hip_x`, `hip_y`."""
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
"""Kinds of a numbered pose, by its size: `actual_TCP_pose_0` to `actual_TCP_pose_5`. Three numbers
are a place only if they are called so: `eef_pos_0` to `eef_pos_2`."""
_OPENING = (
    r"\b(gripper|jaw|claw|finger)s?"
    r"( ?(width|pos(ition)?|q(pos)?|opening|state|value|joint( \d+)?))*$"
)
"""Names of a gripper's opening; the only one in a recording is the plan's `gripper`."""
_COMMANDED = (
    r"\b(cmd|command(ed)?|actions?|target|des(ired)?|plan(ned)?|ref(erence)?|goal|set(point)?"
    r"|leader|soll"
    r"|(?<=q )d)\b"
)
_MEASURED = (
    r"\b(act(ual)?|meas(ured)?|real|state|curr(ent)?|present|ist|obs(ervation)?|feedback"
    r"|follower)\b"
)
"""Words of commanded, and of measured, values."""


def kinds(names: Sequence[str]) -> tuple[Kind, ...]:
    """Return the kind of each of a recording's channels."""
    by_group = {name: Kind.PLACE for name in _grouped(names, _COORDINATE, _are_place)}
    by_group |= {name: Kind.MATRIX for name in _grouped(names, _ENTRY, _are_matrix)}
    poses: dict[tuple[str, str | None], list[str]] = {}
    for name in names:
        if match := _POSE.fullmatch(name.strip()):
            poses.setdefault((match["group"], match["place"]), []).append(name)
    for (group, place), pose in poses.items():  # `joint_pose_0` is none
        if place or (len(pose) > 3 and _by_word(group) is not Kind.ANGLE):
            by_group |= zip(sorted(pose), _PARTS_OF_POSE.get(len(pose), ()), strict=False)
    for parts in attitudes(names):
        by_group |= dict.fromkeys(parts, Kind.QUATERNION if len(parts) == 4 else Kind.ROTATION)
    found = [by_group.get(name) or _by_word(name) for name in names]
    for i in [*_place_beside_attitude(names, found)]:
        found[i] = Kind.PLACE
    for rate, position in _rates_beside(names).items():
        i, both = names.index(rate), {found[names.index(rate)], found[names.index(position)]}
        if found[i] is not Kind.TOOL:
            found[i] = Kind.VELOCITY if both & {Kind.PLACE, Kind.LENGTH} else Kind.TURN_RATE
    return tuple(found)


def _words(name: str) -> str:
    """Return the words of a name in lower case, with blanks between: `joint 1 delta x`."""
    split = re.sub("(?<=[a-z])(?=[A-Z])", " ", re.sub("[Δ∆δ]", " delta ", name))
    return " ".join(re.findall(r"(?<![^\W\d_])[de]\d+|[^\W\d_]+|\d+", split.lower()))


def is_increment(name: str) -> bool:
    """Whether a name is of the change of a pose in a frame: `dx`, `joint1_delta`."""
    return _INCREMENT.search(_words(name)) is not None


def increments(names: Sequence[str], units: Sequence[str]) -> tuple[int, ...]:
    """Return the columns of increments (`PlanFormat.increments`); rates are not among them."""
    rates, each = _rates_beside(names), enumerate(zip(names, units, strict=True))
    return tuple(i for i, (n, u) in each if is_increment(n) and n not in rates and not per_time(u))


def _rates_beside(names: Sequence[str]) -> dict[str, str]:
    """Map rates named like increments, as in exports and states, to positions: `dx` to `x`."""
    own = {name.lower(): name for name in names}
    each = [(name, name.lower().removeprefix(d)) for d in ("d_", "d") for name in names]
    return {rate: own[stem] for rate, stem in each if stem in own and stem != rate.lower()}


def is_of_tool(name: str) -> bool:
    """Whether a name is of a gripper, another tool or a hand: `jaw_x`, `suction`, `panda_hand`."""
    return _OF_TOOL.search(_words(name)) is not None


def is_tool_state(name: str) -> bool:
    """Whether a number does not depend on the tool's place: `jaw_angle`, `magnet`, not `jaw_x`."""
    return is_of_tool(name) and not re.search(_IN_SPACE, _words(name))


def is_of_finger(name: str) -> bool:
    """Whether a name is of a joint of a gripper or a hand: `fr3_finger`, but not `arm_wsg50`."""
    return re.search(r"\b(finger|gripper|thumb)s?\b", _words(name)) is not None


def is_of_base(name: str) -> bool:
    """Whether a name is of the place of what carries the arm, which no joint determines."""
    words = _words(name)
    other = re.search(rf"{_SPEED}|{_ACCELERATION}|{_LOAD}|twist|joint", words)
    is_place = other is None and _by_word(name) is not Kind.TOOL
    return is_place and re.search(_OF_BASE, words) is not None


def is_of_pose(name: str) -> bool:
    """Whether a name is of any part of a pose: a coordinate, an angle of an attitude, a speed."""
    return _OF_POSE.search(_words(name)) is not None


def is_coordinate(name: str) -> bool:
    """Whether a name is of a coordinate, or a displacement along one: `tool_dx`, not `angle_x`."""
    words = _words(name)
    return bool(_OF_COORDINATE.search(words)) and not _OF_ATTITUDE.search(words)


def says_no_position(name: str) -> bool:
    """Whether a name is of a rate, a torque, an increment or anything else but a position."""
    words = f"{_words(name)}; {_words(name.lower())}"
    return bool(_NO_POSITION.search(words) or _DERIVED.search(name)) or is_increment(name)


def says_no_channel(name: str) -> bool:
    """Whether a name says that it is no channel of any plan: an offset, the rate of a control."""
    return re.search(_NO_CHANNEL, _words(name)) is not None


def zero_at_rest(names: Sequence[str], units: Sequence[str | None]) -> list[int]:
    """Return the columns that are 0 at rest: increments, and speeds by their unit or their name.

    A column in a unit of angle is no speed, whatever its name.
    """
    known = [unit or "1" for unit in units]
    summed, each = increments(names, known), enumerate(zip(known, kinds(names), strict=True))
    named = [i for i, (u, kind) in each if kind in RATES and base_of(u)[0] not in TURN]
    return [i for i, u in enumerate(known) if i in summed or i in named or is_rate(u)]


def one_for_all(
    unit: str, names: Sequence[str], plan_units: Sequence[str] | None = None
) -> list[str | None]:
    """Return the unit for each channel that can be in it, and None for the others.

    No gripper and no place is in degrees. Only the plan's channels of that kind get it, if any.
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
    if is_increment(name) and is_coordinate(name):
        return Kind.LENGTH
    words = _words(name)
    of_tool = re.search(_TOOL, words) and not re.search(_IN_SPACE, words)
    table = _BY_WORD if of_tool else (*_BY_NAME, *_BY_WORD)
    return next((kind for pattern, kind in table if re.search(pattern, words)), Kind.UNKNOWN)


def _place_beside_attitude(names: Sequence[str], found: Sequence[Kind]) -> Iterator[int]:
    """Yield the columns of a place: exactly three unknown names next to an attitude: `px`, `p_0`.

    Beside roll, pitch and yaw, which may be joints of a wrist, their names must contain x, y, z.
    """
    certain = attitudes(names)
    for group in (*certain, *euler_angles(names, ("rad",) * len(names))):
        columns = [names.index(name) for name in group]
        stem = re.sub("[rq]?[wxyz]$", "", group[0])  # `act_x` beside `act_rx`, whatever else is
        own = [names.index(stem + letter) for letter in "xyz" if stem + letter in names]
        if len(own) == 3 and all(found[i] is Kind.UNKNOWN for i in own):
            yield from own
        for beside in (range(min(columns))[::-1], range(max(columns) + 1, len(names))):
            place = sorted(takewhile(lambda i: found[i] is Kind.UNKNOWN, beside))
            is_xyz = all(axis in names[i].lower() for axis, i in zip("xyz", place, strict=False))
            if len(place) == 3 and (is_xyz or group in certain):
                yield from place


def _grouped(
    names: Sequence[str], pattern: re.Pattern[str], is_whole: Callable[[str, set[str]], bool]
) -> Iterator[str]:
    """Yield the names that a pattern splits into a group and a part, if the group `is_whole`."""
    matches = {name: match for name in names if (match := pattern.fullmatch(name.strip()))}
    groups: dict[str, set[str]] = {}
    for match in matches.values():
        groups.setdefault(match["group"], set()).add(match["part"].lower())
    for name, match in matches.items():
        if is_whole(match["group"], groups[match["group"]]):
            yield name


def _are_place(group: str, parts: set[str]) -> bool:
    """Whether the parts are two or three coordinates of a place."""
    return len(parts) > 1 and _OF_PLACE.fullmatch(group) is not None


def _are_matrix(_: str, parts: set[str]) -> bool:
    """Whether the parts are all entries of a matrix of at least three rows and columns."""
    rows, columns = ({part[k] for part in parts} for k in (0, -1))
    return min(len(rows), len(columns)) >= 3 and len(parts) == len(rows) * len(columns)


def is_opening(name: str) -> bool:
    """Whether a name is of a gripper's opening: `gripper`, `robot0_gripper_qpos`."""
    return re.search(_OPENING, _words(name)) is not None


def commanded(names: Sequence[str]) -> list[str]:
    """Return commands whose measured counterparts are there: `target_elbow` beside `elbow`."""
    poses = [name for name in names if is_of_pose(name) or not says_no_position(name)]
    commands = [name for name in poses if re.search(_COMMANDED, _words(name))]
    measured = [_without(_MEASURED, name) for name in poses if name not in commands]
    return [name for name in commands if (bare := _without(_COMMANDED, name)) and bare in measured]


def _without(pattern: str, name: str) -> list[str]:
    """Split a name into words, without those of a pattern."""
    return re.sub(pattern, "", _words(name)).split()


def measured_of(stems: Sequence[str]) -> str | None:
    """Return the only measured one of several readings of a motion, by their names, or None."""
    not_commanded = [stem for stem in stems if not re.search(_COMMANDED, _words(stem))]
    measured = [stem for stem in stems if re.search(_MEASURED, _words(stem))]
    return next((found[0] for found in (not_commanded, measured) if len(found) == 1), None)
