"""Limits and kinematics of any serial arm from its URDF."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from prior_reinforce.arm.robots.flange import (
    MOST_JOINTS,
    Tree,
    arms_own,
    joints_to,
)
from prior_reinforce.arm.robots.limits import ENDLESS, PerJoint, RobotLimits
from prior_reinforce.arm.robots.urdf_file import BESIDE, LARGEST, TURNING, TYPES, Joint, read_joints
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.plans.kinematics import UPRIGHT, Chain, Pose, leaning, rotation
from prior_reinforce.wording import listed

_MOST_NAMED = 40
"""Links in a message (ours)."""
_ROUNDING = 1e-9
"""What is left of a level link's z beside the root's by rounding, [1] (ours)."""
_SAME_AXES = 0.01
"""By how much axes of two frames may differ and be called the same, [rad] (ours): 1 cm in 1 m."""
_FLAT = 0.5
"""Least level part of a link's x that is a heading, [1]. Ours: within 60 degrees of level; of a
mount that is calibrated to a degree it then turns by 2 degrees at most."""
_BRISK = 12.0
"""What some joint of an arm stays below, [rad/s]. Ours: the quickest of small servos do 11, and a
fast wrist hangs on slower shoulders; of Unitree's G1, every joint of an arm does 22 to 37."""
_LONGEST_LINK = 3.0
"""Between two joints of an arm, in [m]. Ours: the largest on the market have 1.7."""


def read_urdf(
    path: str | os.PathLike[str],
    tip: str | None = None,
    base: str | None = None,
    hold: Mapping[str, float] | None = None,
) -> RobotLimits:
    """Read the limits and the kinematics of an arm.

    Soft limits of a `safety_controller` narrow a joint's range.

    Args:
        path: Of a URDF; meshes that it names are not read.
        tip: The link that is the flange; None takes `tool0`, `flange` or `link_eef` behind any
            prefix, else the link that the last turning joint moves, where one arm alone ends so.
        base: The link at which the base frame stands, for instance above a lift; None takes the
            root. Its z is the root's, and its x the link's, laid flat.
        hold: Joints that stand still, and where, in [rad] and [m]; what follows one stands too.

    Returns:
        Its limits; of accelerations and jerks where the file states every joint's.

    Raises:
        FileFormatError: No URDF, a damaged one, or one without such a chain.
        ConfigurationError: No such link, or a joint without limits.
        UnclearFlangeError: A joint may be the arm's or a tool's, or there are several arms.
    """
    path = Path(path)
    name, joints, links, meshes = read_joints(path)
    moving, said = {joint.child: joint for joint in joints}, dict(hold or {})
    named = {joint.name: joint for joint in joints}
    try:
        still = _still(named, said)
        for link in {tip, base} - {None, *links}:
            few = ", ".join(links[:_MOST_NAMED])
            raise ConfigurationError(f"it has no link {link!r}; it has {few}")
        tree = None
        if tip is None:
            tree = Tree(links, moving, base or links[0], still, meshes)
            tip = tree.flange()
        chain, way = joints_to(tip, moving, base), joints_to(tip, moving)
        if base is not None and (not chain or chain[0].parent != base):
            raise ConfigurationError(f"link {base} is not on the way to {tip}; say another --base")
        # What stands behind the flange is none of the arm's, and may be wrong.
        hold = {joint.name: _place(joint, named, said) for joint in way if joint.name in still}
        turning = [joint for joint in chain if joint.name not in hold and joint.type in TURNING]
        _refuse_other(chain, turning, named, tip, hold)
        velocity, acceleration, jerk = (_largest(key, turning) for key in LARGEST)
        assert velocity is not None  # it is needed
        lower, upper = np.array([joint.range() for joint in turning]).T
        upright = _upright(way[: way.index(chain[0])], named, hold)
        kinematics = _chain(chain, hold, upright)
    except (ConfigurationError, FileFormatError) as error:
        error.args = (f"{path}: {error}",)
        raise
    tilted, steep = bool(upright[2, 2] < math.cos(UPRIGHT)), _is_steep(upright)
    axes = f" ({'x and z' if steep else 'z'} as in {links[0]})" * tilted
    source = f"{path.name}, from {chain[0].parent}{axes} to {tip}"
    source += "".join(f", {name} held at {position:g}" for name, position in said.items())
    stops = [key for joint in turning for key in joint.parts.get("safety_controller", ())]
    source += ", soft limits too" * any(key.startswith("soft_") for key in stops)
    if tree is not None:
        source += tree.said_behind(turning[-1].child)
    if velocity.min() > _BRISK:
        source += f"; velocities of {velocity.min():g} rad/s and more, are they in deg/s?"
    unsaid = [what for joint in chain if joint.has_axis for what in joint.unsaid()]
    source += f"; as parsers of URDF take it: {listed(unsaid, most=3)}" * bool(unsaid)
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
    for joint in joints_to(first.parent, moving, base):
        with suppress(ConfigurationError):  # a joint that is not held would turn this one
            x, y, _, *turned = _first_origin(read_urdf(path, tip, joint.child, hold))
            same = np.allclose(turned, _first_origin(arm)[3:], atol=_SAME_AXES)
            if same and math.hypot(x, y) <= within:
                found.append(joint.child)
    return base or links[0], found


def _first_origin(arm: RobotLimits) -> Pose:
    assert arm.chain is not None  # a URDF has one
    return arm.chain.origins[0]


def _still(named: Mapping[str, Joint], said: Mapping[str, float]) -> set[str]:
    """Names of the joints that stand still: as is said, or as what they follow (<mimic>).

    Raises:
        ConfigurationError: There is no such joint, or it cannot stand where it is said to.
    """
    if unknown := said.keys() - named.keys():
        raise ConfigurationError(f"it has no joint {min(unknown)!r} to hold")
    for name in said:
        _place(named[name], named, said)
    still = set(said)
    while follow := {name for name, joint in named.items() if joint.mimics in still} - still:
        still |= follow
    return still


def _place(joint: Joint, named: Mapping[str, Joint], said: Mapping[str, float]) -> float:
    """Where a joint stands still, in [rad] or [m]: as is said, or where what it follows takes it.

    Raises:
        ConfigurationError: It does not stand still, or cannot there.
    """
    leader, *followers = _led(joint, named)
    if leader.name not in said:
        raise joint.error(
            f"follows {joint.mimics} (<mimic>), and does not stand still; hold {leader.name} where "
            "both do"
        )
    position = said[leader.name]
    leader.check_held(position)
    for follower in followers:
        position = follower.followed(position)
        if follower.nearest(position) != position:
            low, high = follower.places()
            raise follower.error(
                f"follows {follower.mimics} to {position:.4g}, and its range is {low:.4g} to "
                f"{high:.4g}; hold {leader.name} elsewhere"
            )
        if abs(said.get(follower.name, position) - position) > BESIDE:
            raise follower.error(
                f"follows {follower.mimics} to {position:.4g}; take it out of --hold, or say that"
            )
    return position


def _led(joint: Joint, named: Mapping[str, Joint]) -> list[Joint]:
    """Return the joints from the one that leads it, and follows none, to itself.

    Raises:
        ConfigurationError: It follows one that there is not, or in a circle.
    """
    found = [joint]
    while (followed := found[0].mimics) is not None:
        if followed not in named or named[followed] in found:
            raise joint.error(
                f"follows {joint.mimics} (<mimic>), and no joint leads it; correct the joint in "
                f"the <mimic> of {found[0].name} in the file"
            )
        found.insert(0, named[followed])
    return found


def _refuse_other(
    chain: Sequence[Joint],
    turning: Sequence[Joint],
    named: Mapping[str, Joint],
    tip: str,
    hold: Collection[str],
) -> None:
    """Refuse a chain without turning joints, or with others that are not held."""
    if not turning:
        raise FileFormatError(f"no joint turns between the base and {tip}; say --tip")
    other = [j for j in chain if j.type in TYPES[3:] and j.name not in hold]
    for joint in [*turning, *other]:
        if joint.mimics is not None and {joint, _led(joint, named)[0]} & {*turning}:
            raise joint.error(
                f"follows another (<mimic> of {joint.mimics}), and so is no joint of its own; say "
                "a --tip before it, or, where the arm goes on behind it, --robot none: no limits "
                "are then checked"
            )
    if len(turning) > MOST_JOINTS:
        raise FileFormatError(
            f"{len(turning)} joints turn between the base and {tip}, and an arm has at most "
            f"{MOST_JOINTS}; say --base or --tip"
        )
    if not other:
        return
    first, last = chain.index(other[0]), chain.index(other[-1])
    before, behind = ([j for j in part if j in turning] for part in (chain[:first], chain[last:]))
    says = [f"--tip {other[0].parent} for what is before"] * bool(before)
    base, still = other[-1].child, [*other]
    drives = len(other) > 1 and behind and not before and behind[0].type == "continuous"
    # x, y and a turn without end: a base that drives, which is none of the arm's.
    if drives and arms_own([joint.name for joint in behind[::-1]]) < len(behind):
        base, still = behind[0].child, [*other, behind[0]]
    # What carries the arm may stand still; an arm's own joints do not.
    says += [f"--base {base} for what is behind it"] * (bool(behind) and not before)
    leaders = dict.fromkeys(_led(joint, named)[0] for joint in still)
    holds = "--hold " + " ".join(f"{joint.name}={joint.nearest(0.0):.4g}" for joint in leaders)
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


def _upright(
    before: Sequence[Joint], named: Mapping[str, Joint], hold: Mapping[str, float]
) -> np.ndarray:
    """Attitude of a base link in the frame that has its heading and the root's z, 3 x 3.

    So what is vertical, and where a box is high, stays what the file says of a mount on a ceiling
    or a wall. Where the link's x is steep and so no heading, the frame's axes are the root's.

    Args:
        before: Joints from the root to the link; those that move are at 0.
        named: All joints.
        hold: Joints that stand still, and where.

    Raises:
        ConfigurationError: One that is not held would turn the link in that frame.
    """
    link, leans = np.eye(3), dict[str, float]()
    for joint in before:
        low, high = joint.places()
        stands = hold.get(joint.name, low if low == high else None)
        if joint.type in TURNING and stands is None:
            leans[joint.name] = leaning(link @ joint.pose(None)[:3, :3] @ joint.axis())
        link = link @ joint.pose(stands)[:3, :3]
    steep = _is_steep(link)
    for name, lean in leans.items():
        # About a vertical axis, the link's heading turns with the link.
        if steep or lean > _SAME_AXES:
            leader = _led(named[name], named)[0]
            low, high = leader.places()
            raise leader.error(
                f"stands before the base, and turns it by its range, {low:.4g} to {high:.4g} rad; "
                f"say where in that it stands: --hold {leader.name}={leader.nearest(0.0):.4g}"
            )
    if math.hypot(link[0, 2], link[1, 2]) < _ROUNDING and link[2, 2] > 0:
        return np.eye(3)
    yaw = 0.0 if steep else math.atan2(link[1, 0], link[0, 0])
    return np.asarray(rotation(0.0, 0.0, -yaw) @ link)


def _is_steep(attitude: np.ndarray) -> bool:
    """Whether the x of a frame in one whose z is vertical is no heading."""
    return math.hypot(attitude[0, 0], attitude[1, 0]) <= _FLAT


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
    if np.linalg.norm(since[:3, 3]) > _LONGEST_LINK:
        raise ConfigurationError(
            f"the flange is {np.linalg.norm(since[:3, 3]):.3g} m from the last joint, and no arm "
            "has such a link: say another --tip, or divide what is in cm or mm"
        )
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
