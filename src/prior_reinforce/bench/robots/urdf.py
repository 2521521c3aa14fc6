"""Limits and kinematics of any serial arm from its URDF, read strictly.

Ours rather than a library's: yourdfpy, urdfdom and MuJoCo pass over what they do not understand and
take defaults for what is missing; with one character gone, an arm has another axis or fewer joints.
Here, XML that is not well formed is an error, and so is whatever in a joint is unknown, missing or
no number (elements and attributes: wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from prior_reinforce.bench.robots.kinematics import Chain, Pose, rotation
from prior_reinforce.bench.robots.limits import RobotLimits
from prior_reinforce.errors import ConfigurationError, FileFormatError

_TURNING = ("revolute", "continuous")
_TYPES = (*_TURNING, "fixed", "prismatic", "floating", "planar")
_ATTRIBUTES = {
    "parent": {"link"},
    "child": {"link"},
    "origin": {"xyz", "rpy"},
    "axis": {"xyz"},
    "limit": {"lower", "upper", "effort", "velocity"},
    "mimic": {"joint", "multiplier", "offset"},
    "safety_controller": {"soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"},
}
"""What a joint may say that matters to its motion."""
_ELSEWHERE = ("dynamics", "calibration")
"""What else it may say, whatever that is."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_LENGTH_OF_AXIS = 0.01
"""By how much an axis may differ from length 1: two written digits."""
_LONGEST_NAME, _LONGEST_PROBLEM = 200, 400
_ENDLESS = 4 * math.pi
"""What any joint may turn either way, in [rad]. Ours: two turns, since a throw that needs more is a
wrong unit, and a range beyond it a lost decimal point."""
_FASTEST, _FARTHEST = 30.0, 10.0
"""What no joint does, in [rad/s], and how long no link is, in [m]. Ours: several times what is on
the market; a lost decimal point is mostly more."""
_TIPS = ("tool0", "flange", "link_eef")
"""Links that are the flange by ROS's conventions (REP 199) and UFACTORY's; the first there is."""


def read_urdf(path: Path, tip: str | None = None) -> RobotLimits:
    """Read the limits and the kinematics of an arm.

    Soft limits of a `safety_controller` narrow a joint's range.

    Args:
        path: Of a URDF; meshes that it names are not read.
        tip: The link that is the flange; None takes `tool0`, `flange` or `link_eef`, else the link
            that the last turning joint of the longest chain moves.

    Returns:
        Its limits, the root link being the base frame; no accelerations, which URDF does not have.

    Raises:
        FileFormatError: No URDF, a damaged one, or one without such a chain.
        ConfigurationError: No such link, or a joint without limits.
    """
    if not path.is_file():
        raise FileFormatError(f"no URDF at {path}; give the path of a .urdf file")
    if path.name.endswith(".xacro"):
        raise FileFormatError(f"{path} is a xacro; make a URDF of it: xacro {path} > arm.urdf")
    try:
        robot = ElementTree.parse(path, ElementTree.XMLParser(target=_Builder())).getroot()
        joints = _joints(robot)
        links = _links(robot, joints)
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        problem = str(error)[:_LONGEST_PROBLEM]
        raise FileFormatError(f"cannot read {path} as URDF: {problem}; export it again") from error
    try:
        chain = _joints_before(tip, joints, links)
        turning = [joint for joint in chain if joint.type in _TURNING]
        limits = np.array([joint.limits() for joint in turning])
        kinematics = _chain(chain)
    except (ConfigurationError, FileFormatError) as error:
        raise type(error)(f"{path}: {error}") from error
    source = f"{path.name}, from {chain[0].parent} to {chain[-1].child}"
    source += ", soft limits too" * any("safety_controller" in joint.parts for joint in turning)
    names = tuple(joint.name for joint in turning)
    lower, upper, velocity = limits.T
    name = robot.get("name") or path.stem
    return RobotLimits(name, "any", source, names, lower, upper, velocity, chain=kinematics)


@dataclass(frozen=True)
class _Joint:
    """A joint of which every element and attribute is known."""

    name: str
    type: str
    parts: dict[str, dict[str, str]]
    """Attributes by element."""

    @property
    def parent(self) -> str:
        return self.parts["parent"]["link"]

    @property
    def child(self) -> str:
        return self.parts["child"]["link"]

    @property
    def free(self) -> bool:
        """Whether it turns by itself."""
        return self.type in _TURNING and "mimic" not in self.parts

    def error(self, problem: str) -> ConfigurationError:
        return ConfigurationError(f"joint {self.name} {problem}")

    def number(self, part: str, key: str) -> float | None:
        """One number; None where it is not said."""
        return self.vector(part, key, 1)[0] if key in self.parts.get(part, {}) else None

    def vector(self, part: str, key: str, n: int = 3) -> list[float]:
        """So many numbers; zeros where they are not said."""
        text = self.parts.get(part, {}).get(key, "0 " * n)
        words = text.split()
        values = [float(word) for word in words if _NUMBER.fullmatch(word)]
        if not (len(values) == len(words) == n and np.all(np.isfinite(values))):
            wants = "a finite number" if n == 1 else f"{n} finite numbers"
            raise self.error(f'has <{part} {key}="{text[:80]}">; give {wants}')
        return values

    def pose(self) -> np.ndarray:
        """Pose of the joint's frame in the frame before, 4 x 4."""
        if self.type in _TURNING and "origin" not in self.parts:
            raise self.error('has no <origin>; write <origin xyz="0 0 0" rpy="0 0 0"/> if it is so')
        pose = np.eye(4)
        roll, pitch, yaw = self.vector("origin", "rpy")
        pose[:3, :3], pose[:3, 3] = rotation(roll, pitch, yaw), self.vector("origin", "xyz")
        if np.abs(pose[:3, 3]).max() > _FARTHEST or max(map(abs, (roll, pitch, yaw))) > 7:
            raise self.error(f"has an <origin> beyond {_FARTHEST:g} m or a turn; look for its dots")
        return pose

    def axis(self) -> tuple[float, float, float]:
        """About which it turns."""
        x, y, z = self.vector("axis", "xyz")
        length = math.hypot(x, y, z)
        if abs(length - 1) > _LENGTH_OF_AXIS:
            raise self.error('needs an axis of length 1, such as <axis xyz="0 0 1"/>')
        return x / length, y / length, z / length

    def limits(self) -> tuple[float, float, float]:
        """Lowest and highest position, and largest speed."""
        if "mimic" in self.parts:
            raise self.error("follows another (<mimic>), and so is no joint of its own; say --tip")
        velocity = self.number("limit", "velocity")
        if not velocity or not 0 < velocity <= _FASTEST:
            says = "no velocity limit" if not velocity else f"a velocity limit of {velocity:g}"
            raise self.error(f"has {says}; write the maker's, in [rad/s], into its <limit>")
        low, high = self.number("limit", "lower"), self.number("limit", "upper")
        if self.type == "continuous":
            low, high = -_ENDLESS, _ENDLESS
        soft = [self.number("safety_controller", f"soft_{end}_limit") for end in ("lower", "upper")]
        if low is not None and high is not None:
            low = low if soft[0] is None else max(low, soft[0])
            high = high if soft[1] is None else min(high, soft[1])
        if low is None or high is None or not -_ENDLESS <= low < high <= _ENDLESS:
            raise self.error(
                f"has no range within {_ENDLESS:.4g} rad; write lower and upper into its <limit>"
            )
        return low, high, velocity


class _Builder(ElementTree.TreeBuilder):
    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Entities stand for other text, which a URDF needs none of."""
        raise ValueError("it has a DOCTYPE, which no URDF has")


def _refuse_text(element: ElementTree.Element, where: str) -> None:
    """Refuse text, which is an element that lacks its bracket."""
    for text in (element.text, *(part.tail for part in element)):
        if text and text.strip():
            raise ValueError(f"text in {where}: {text.strip()[:80]!r}")


def _name(element: ElementTree.Element) -> str:
    name = element.get("name", "")
    if not (name and name.isprintable() and len(name) <= _LONGEST_NAME):
        raise ValueError(f"a <{element.tag}> has no name, or one that is none: {name[:80]!r}")
    return name


def _joints(robot: ElementTree.Element) -> list[_Joint]:
    """Every joint, with nothing in it that is unknown or said twice."""
    if robot.tag != "robot":
        raise ValueError(f"it begins with <{robot.tag[:80]}>, not <robot>")
    _refuse_text(robot, "robot")
    found: dict[str, _Joint] = {}
    for element in robot.findall("joint"):
        name, kind = _name(element), element.get("type", "")
        _refuse_text(element, f"joint {name}")
        if kind not in _TYPES or set(element.attrib) != {"name", "type"}:
            raise ValueError(f"joint {name} has no type, or none of {', '.join(_TYPES)}")
        parts: dict[str, dict[str, str]] = {}
        for part in element:
            unknown = set(part.attrib) - _ATTRIBUTES.get(part.tag, set(part.attrib))
            if part.tag not in (*_ATTRIBUTES, *_ELSEWHERE) or unknown:
                what = f"{min(unknown)[:80]} in <{part.tag}>" if unknown else f"<{part.tag[:80]}>"
                raise ValueError(f"joint {name} has an unknown {what}")
            if part.tag in parts:
                raise ValueError(f"joint {name} has two <{part.tag}>")
            parts[part.tag] = dict(part.attrib)
        if not all(parts.get(end, {}).get("link") for end in ("parent", "child")):
            raise ValueError(f"joint {name} has no <parent link> or <child link>")
        if name in found:
            raise ValueError(f"two joints are called {name}")
        found[name] = _Joint(name, kind, parts)
    if not found:
        raise ValueError("it has no joint, and so is no arm")
    return list(found.values())


def _links(robot: ElementTree.Element, joints: list[_Joint]) -> dict[str, int]:
    """How many joints turn between the root and each link; all links hang from one root."""
    names = {_name(element) for element in robot.findall("link")}
    moved = [joint.child for joint in joints]
    if len(names) < len(robot.findall("link")) or len(set(moved)) < len(moved):
        raise ValueError("two links have one name, or two joints move one link")
    behind: dict[str, list[_Joint]] = {name: [] for name in names}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in names:
                raise ValueError(f"joint {joint.name} names {end[:80]!r}, which is no link")
        behind[joint.parent].append(joint)
    turning = dict.fromkeys(names.difference(moved), 0)
    if len(turning) != 1:
        raise ValueError(f"{len(turning)} links hang from no joint instead of one")
    reached = [*turning]
    for link in reached:
        turning |= {joint.child: turning[link] + joint.free for joint in behind[link]}
        reached += [joint.child for joint in behind[link]]
    if len(turning) < len(names):
        raise ValueError("its joints form a loop")
    return turning


def _joints_before(tip: str | None, joints: list[_Joint], links: dict[str, int]) -> list[_Joint]:
    """The chain from the root to the flange: `tip`, or the link that `read_urdf` takes for it."""
    moving = {joint.child: joint for joint in joints}
    tip = next((name for name in _TIPS if name in links), None) if tip is None else tip
    if tip is None:  # the link behind the last turning joint of the chain that has most of them
        most = max(links.values())
        last = [link for link, n in links.items() if n == most > 0 and moving[link].free]
        if len(last) != 1:
            raise ConfigurationError(
                f"it ends in {', '.join(last[:40]) or 'no turning joint'}; say which link is the "
                "flange with --tip"
            )
        tip = last[0]
    if tip not in links:
        raise ConfigurationError(f"it has no link {tip!r}; it has {', '.join([*links][:40])}")
    chain, link = list[_Joint](), tip
    while link in moving:
        chain.insert(0, moving[link])
        link = chain[0].parent
    if not any(joint.type in _TURNING for joint in chain):
        raise FileFormatError(f"no joint turns between the base and {tip}; say --tip")
    for joint in chain:
        if joint.type not in (*_TURNING, "fixed"):
            raise FileFormatError(
                f"{joint.name} is {joint.type}, and arms of turning joints are known only; "
                "say --tip for a link before it"
            )
    return chain


def _chain(joints: list[_Joint]) -> Chain:
    """Origins of the turning joints, with the fixed ones before each taken in."""
    origins: list[Pose] = []
    axes: list[tuple[float, float, float]] = []
    since = np.eye(4)
    for joint in joints:
        since = since @ joint.pose()
        if joint.type in _TURNING:
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
