"""Limits and kinematics of any serial arm from its URDF: which of its joints are the arm's."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from prior_reinforce.arm.robots.limits import ENDLESS, PerJoint, RobotLimits
from prior_reinforce.arm.robots.urdf_file import LARGEST, TURNING, TYPES, Joint, read_joints
from prior_reinforce.errors import ConfigurationError, FileFormatError, UnclearFlangeError
from prior_reinforce.plans.kinematics import UPRIGHT, Chain, Pose, rotation
from prior_reinforce.wording import listed

_MOST_NAMED, _MOST_JOINTS = 40, 100
"""Links in a message, and turning joints of one arm (ours)."""
_TIPS = ("tool0", "flange", "link_eef")
"""Links that are the flange by ROS's conventions (REP 199) and UFACTORY's; the first there is."""
_PREFIXED_TIPS = tuple(f"_{tip}" for tip in _TIPS)
_ROUNDING = 1e-9
"""What is left of a level link's z beside the root's by rounding, [1] (ours)."""
_SAME_AXES = 0.01
"""By how much axes of two frames may differ and be called the same, [rad] (ours): 1 cm in 1 m."""
_FLAT = 0.5
"""Least level part of a link's x that is a heading, [1]. Ours: within 60 degrees of level; of a
mount that is calibrated to a degree it then turns by 2 degrees at most."""
_JAW = re.compile("grip|jaw|finger|claw|knuckle|thumb|pinch|tong", re.IGNORECASE)
_JAW_MESH = re.compile("jaw|finger|claw|thumb|pinch", re.IGNORECASE)
"""Of a mesh's file name, which may be the only one that a CAD program's export leaves telling."""
_OF_AN_ARM = re.compile("wrist|elbow|shoulder|arm|roll|pitch|yaw|rotat", re.IGNORECASE)
_LONGEST_LINK = 3.0
"""Between two joints of an arm, in [m]. Ours: the largest on the market have 1.7."""


def read_urdf(
    path: Path,
    tip: str | None = None,
    base: str | None = None,
    hold: Mapping[str, float] | None = None,
) -> RobotLimits:
    """Read the limits and the kinematics of an arm.

    Soft limits of a `safety_controller` narrow a joint's range.

    Args:
        path: Of a URDF; meshes that it names are not read.
        tip: The link that is the flange; None takes `tool0`, `flange` or `link_eef`, else the link
            that the last turning joint of the longest chain moves.
        base: The link at which the base frame stands, for instance above a lift; None takes the
            root. Its z is the root's, and its x the link's, laid flat; see `_upright`.
        hold: Joints that stand still, and where, in [rad] and [m].

    Returns:
        Its limits; of accelerations and jerks where the file states every joint's.

    Raises:
        FileFormatError: No URDF, a damaged one, or one without such a chain.
        ConfigurationError: No such link, or a joint without limits.
        UnclearFlangeError: A gripper's joint may be one of the arm's, or there are several arms.
    """
    name, joints, links, meshes = read_joints(path)
    moving, hold, unsaid = {joint.child: joint for joint in joints}, dict(hold or {}), tip is None
    try:
        if unknown := hold.keys() - {joint.name for joint in joints}:
            raise ConfigurationError(f"it has no joint {min(unknown)!r} to hold")
        for joint in joints:
            if joint.name in hold:
                joint.check_held(hold[joint.name])
        for link in {tip, base} - {None, *links}:
            few = ", ".join(links[:_MOST_NAMED])
            raise ConfigurationError(f"it has no link {link!r}; it has {few}")
        tip = _flange(links, moving, base, hold, meshes) if tip is None else tip
        chain = _path(tip, moving, base)
        if base is not None and (not chain or chain[0].parent != base):
            raise ConfigurationError(f"link {base} is not on the way to {tip}; say another --base")
        turning = [joint for joint in chain if joint.name not in hold and joint.type in TURNING]
        _refuse_other(chain, turning, tip, hold)
        velocity, acceleration, jerk = (_largest(key, turning) for key in LARGEST)
        assert velocity is not None  # it is needed
        lower, upper = np.array([joint.range() for joint in turning]).T
        upright = _upright(_path(chain[0].parent, moving), hold)
        kinematics = _chain(chain, hold, upright)
    except (ConfigurationError, FileFormatError) as error:
        error.args = (f"{path}: {error}",)
        raise
    tilted = bool(upright[2, 2] < math.cos(UPRIGHT))
    source = f"{path.name}, from {chain[0].parent}{f' (z as in {links[0]})' * tilted} to {tip}"
    source += "".join(f", {name} held at {position:g}" for name, position in hold.items())
    source += ", soft limits too" * any("safety_controller" in joint.parts for joint in turning)
    # A convention's link is the flange, and what is behind it a tool.
    behind = _fixed_behind(tip, links, moving) if unsaid and not tip.endswith(_TIPS) else []
    source += f"; fixed behind it: {listed(behind)} (--tip NAME takes one)" * bool(behind)
    capped = [j for j in turning if j.type == "continuous" and 0 < np.ptp(j.ends()) < 2 * ENDLESS]
    over = [f"lower and upper of joint {joint.name}, which is continuous" for joint in capped]
    over += [f"{what} of joint {joint.name}" for joint in joints for what in joint.unknown]
    source += f"; passed over: {listed(over, most=3)}" * bool(over)
    return RobotLimits(
        robot=name,
        firmware="any",
        source=source,
        joint_names=tuple(joint.name for joint in turning),
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
        chain=kinematics,
        held={joint.name: hold[joint.name] for joint in chain if joint.name in hold},
    )


def bases_on_axis(
    path: Path,
    tip: str | None,
    base: str | None,
    hold: Mapping[str, float],
    within: float,
) -> tuple[str, list[str]]:
    """Return the base link, and others by which the first joint's axis passes within [m].

    These stand still against the base link, and their frames have the same axes, so that each may
    be the `base` of `read_urdf` instead.
    """
    _, joints, links, _ = read_joints(path)
    arm, moving = read_urdf(path, tip, base, hold), {joint.child: joint for joint in joints}
    first = next(joint for joint in joints if joint.name == arm.joint_names[0])
    found = list[str]()
    for joint in _path(first.parent, moving, base):
        x, y, _, *turned = _first_origin(read_urdf(path, tip, joint.child, hold))
        same = np.allclose(turned, _first_origin(arm)[3:], atol=_SAME_AXES)
        if same and math.hypot(x, y) <= within:
            found.append(joint.child)
    return base or links[0], found


def _first_origin(arm: RobotLimits) -> Pose:
    assert arm.chain is not None  # a URDF has one
    return arm.chain.origins[0]


def _path(link: str, moving: Mapping[str, Joint], base: str | None = None) -> list[Joint]:
    """The joints from the base, or the root, to a link."""
    found = list[Joint]()
    while link in moving and link != base:
        found.append(moving[link])
        link = found[-1].parent
    return found[::-1]


def _flange(
    links: Sequence[str],
    moving: Mapping[str, Joint],
    base: str | None,
    hold: Mapping[str, float],
    meshes: Mapping[str, str],
) -> str:
    """The link that `read_urdf` takes for the flange.

    Raises:
        UnclearFlangeError: Several may be it, or a gripper's joint turns as the arm's own do.
    """
    plain = next((tip for tip in _TIPS if tip in links), None)
    if plain is not None:
        own = {joint.name for joint in _path(plain, moving, base) if joint.free}
        for other in (link for link in links if link.endswith(_PREFIXED_TIPS)):
            turned = {joint.name for joint in _path(other, moving, base) if joint.free}
            if turned and own.isdisjoint(turned):
                raise UnclearFlangeError(
                    f"it has several arms, which end in {plain} and {other}; say whose is meant "
                    "with --tip"
                )
        return plain
    start = links[0] if base is None else base
    turns, of_jaw, jaws = {start: 0}, {start: False}, list[str]()
    """How many of the arm's joints turn up to a link; whether a joint called jaw is among them."""
    ends = list[str]()
    for link in links:
        joint = moving.get(link)
        if joint is None or joint.parent not in turns or link == start:
            continue
        free = joint.free and joint.name not in hold
        called = _JAW.search(joint.name) and not _OF_AN_ARM.search(joint.name)
        looks = _JAW_MESH.search(meshes.get(link, ""))
        jaws += [link] if free and (called or looks) else []
        of_jaw[link] = of_jaw[joint.parent] or link in jaws[-1:]
        turns[link] = turns[joint.parent] + (free and not of_jaw[link])
        ends += [link] if free and not of_jaw[link] else []
    most = max(turns.values())
    ends = [link for link in ends if turns[link] == most]
    named = dict[str, str]()
    """The flange by convention, by the prefix of its arm."""
    for tip in _PREFIXED_TIPS:
        for link in turns:
            if turns[link] == most and link.endswith(tip) and not of_jaw[link]:
                named.setdefault(link.removesuffix(tip), link)
    if len(named) == 1:
        return next(iter(named.values()))
    last = [joint for joint in _path(ends[0], moving, start) if joint.free] if ends else []
    if len(ends) == 1:
        followed = {joint.mimics for joint in moving.values()}
        jaw = _JAW.search(last[-1].child) and not _OF_AN_ARM.search(last[-1].name)
        if len(last) > 1 and (jaw or last[-1].name in followed):
            jaws = [last.pop().child]
        elif not any(moving[ends[0]] in _path(link, moving, start) for link in jaws[:_MOST_NAMED]):
            return ends[0]
    else:  # fingers share most of their joints, two arms few
        paths = [{*_path(link, moving, start)} for link in ends[:_MOST_NAMED]]
        last = [joint for joint in last if all(joint in path for path in paths)]
        jaws = ends
        if 2 * len(last) < most or not last:
            ends = [*named.values()] if len(named) == len(ends) else ends
            raise UnclearFlangeError(
                f"it ends in {', '.join(ends[:_MOST_NAMED]) or 'no turning joint'}; say which link "
                "is the flange with --tip"
            )
    proposed = last[-1].child
    fixed = ", ".join(_fixed_behind(proposed, links, moving)[:_MOST_NAMED])
    also = f", or one that is fixed to it: {fixed}" * bool(fixed)
    raise UnclearFlangeError(
        f"joint {moving[jaws[0]].name} looks like a gripper's; say which link is the flange with "
        f"--tip: {proposed}, which the arm's last joint {last[-1].name} moves{also}",
        proposed,
    )


def _fixed_behind(link: str, links: Sequence[str], moving: Mapping[str, Joint]) -> list[str]:
    """Links that are fixed to a link, and to these, from it outwards."""
    rigid = {link: None}
    for other in links:
        if other in moving and moving[other].type == "fixed" and moving[other].parent in rigid:
            rigid[other] = None
    return [*rigid][1:]


def _refuse_other(
    chain: Sequence[Joint], turning: Sequence[Joint], tip: str, hold: Mapping[str, float]
) -> None:
    """Refuse a chain without turning joints, or with others that are not held."""
    if not turning:
        raise FileFormatError(f"no joint turns between the base and {tip}; say --tip")
    for joint in turning:
        if joint.mimics is not None:
            raise joint.error(
                f"follows another (<mimic> of {joint.mimics}), and so is no joint of its own; say "
                "a --tip before it, or, where the arm goes on behind it, --robot none: no limits "
                "are then checked"
            )
    if len(turning) > _MOST_JOINTS:
        raise FileFormatError(
            f"{len(turning)} joints turn between the base and {tip}, and an arm has at most "
            f"{_MOST_JOINTS}; say --base or --tip"
        )
    other = [j for j in chain if j.type in TYPES[3:] and j.name not in hold]
    if other:
        first, last = chain.index(other[0]), chain.index(other[-1])
        before, behind = (any(j in turning for j in part) for part in (chain[:first], chain[last:]))
        says = [f"--tip {other[0].parent} for what is before"] * before
        # What carries the arm may stand still; an arm's own joints do not.
        says += [f"--base {other[-1].child} for what is behind it"] * (behind and not before)
        holds = "--hold " + " ".join(f"{j.name}={j.nearest(0.0):.4g}" for j in other)
        raise FileFormatError(
            f"{other[-1].name} is {other[-1].type}, and arms of turning joints are known only; say "
            f"{', or '.join([*says, holds])} if it stands still"
        )


def _largest(key: str, turning: Sequence[Joint]) -> PerJoint | None:
    """The speeds, accelerations or jerks that the file states; None where it states none.

    Speeds it has to state, and 0 is none.
    """
    needed = key == "velocity"
    values = {joint.name: joint.number("limit", key) for joint in turning}
    said = {name: value for name, value in values.items() if value or (value == 0 and not needed)}
    if not (said or needed):
        return None
    remedy = "write the maker's, in rad and s, into <limit>"
    if lacking := [name for name in values if name not in said]:
        others = ", ".join(f"{name} ({value:g})" for name, value in said.items())
        remedy += f", or take {key} out of the others': {others}" * (not needed)
        raise ConfigurationError(f"no {key} limit of {', '.join(lacking)}; {remedy}")
    beyond = [f"{at:g} ({name})" for name, at in said.items() if not 0 < at <= LARGEST[key]]
    if beyond:
        raise ConfigurationError(f"unlikely {key} limit of {', '.join(beyond)}; {remedy}")
    return np.array([*said.values()])


def _upright(before: Sequence[Joint], hold: Mapping[str, float]) -> np.ndarray:
    """Attitude of a base link in the frame that has its heading and the root's z, 3 x 3.

    So what is vertical, and where a box is high, stays what the file says of a mount on a ceiling
    or a wall. Where the link's x is steep and so no heading, the frame's axes are the root's.

    Args:
        before: Joints from the root to the link; those that move are at 0.
        hold: Joints that stand still, and where.

    Raises:
        ConfigurationError: One that turns cannot be at 0, and is not held.
    """
    link = np.eye(3)
    for joint in before:
        stands = joint.nearest(0.0)
        if joint.free and joint.name not in hold and stands:
            low, high = joint.places()
            raise joint.error(
                f"stands before the base, and its range, {low:.4g} to {high:.4g} rad, is without "
                f"0; say where in that it stands: --hold {joint.name}={stands:.4g}"
            )
        link = link @ joint.pose(hold.get(joint.name))[:3, :3]
    if math.hypot(link[0, 2], link[1, 2]) < _ROUNDING and link[2, 2] > 0:
        return np.eye(3)
    flat = math.hypot(link[0, 0], link[1, 0])
    yaw = math.atan2(link[1, 0], link[0, 0]) if flat > _FLAT else 0.0
    return np.asarray(rotation(0.0, 0.0, -yaw) @ link)


def _chain(joints: Sequence[Joint], hold: Mapping[str, float], upright: np.ndarray) -> Chain:
    """Origins of the turning joints, with the fixed ones before each taken in.

    Args:
        joints: From the base link to the flange.
        hold: Joints that stand still, and where.
        upright: The base link in the base frame.
    """
    origins: list[Pose] = []
    axes: list[tuple[float, float, float]] = []
    since = np.eye(4)
    since[:3, :3] = upright
    for joint in joints:
        since = since @ joint.pose(hold.get(joint.name))
        if joint.type in TURNING and joint.name not in hold:
            if origins and np.linalg.norm(since[:3, 3]) > _LONGEST_LINK:
                raise joint.error(
                    f"stands {np.linalg.norm(since[:3, 3]):.3g} m from the joint before it, and no "
                    "arm has such a link: URDF is in m, so divide what is in cm or mm"
                )
            origins.append(_pose(since))
            axes.append(joint.axis())
            since = np.eye(4)
    return Chain(tuple(origins), tuple(axes), _pose(since))


def _pose(transform: np.ndarray) -> Pose:
    """Translation, and roll, pitch and yaw of Rz(yaw) Ry(pitch) Rx(roll)."""
    r = transform[:3, :3]
    pitch = math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0]))
    if math.hypot(r[0, 0], r[1, 0]) < 1e-9:  # yaw and roll turn about one axis
        roll, yaw = math.atan2(-r[1, 2], r[1, 1]), 0.0
    else:
        roll, yaw = math.atan2(r[2, 1], r[2, 2]), math.atan2(r[1, 0], r[0, 0])
    x, y, z = transform[:3, 3].tolist()
    return (x, y, z, roll, pitch, yaw)
