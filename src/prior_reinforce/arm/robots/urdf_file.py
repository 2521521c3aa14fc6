"""Joints and links of a URDF, read strictly where they are of the arm.

Ours rather than a library's: yourdfpy, urdfdom and MuJoCo pass over what they do not understand;
with one character gone, an arm has another axis or fewer joints. Here, XML that is not well formed
is an error, and so is a joint of the arm that lacks what has no default, or has a word that is
nearly one of URDF's (wiki.ros.org/urdf/XML), or an unknown one in what places it. Defaults that
count are named; what else is unknown, and whatever stands in other joints, is passed over, and
named.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers.expat import errors

import numpy as np

from prior_reinforce.arm.robots.limits import ENDLESS
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import refuse_pointers
from prior_reinforce.plans.kinematics import rotation, rotations_about
from prior_reinforce.units import UNITS

TURNING = ("revolute", "continuous")
TYPES = (*TURNING, "fixed", "prismatic", "floating", "planar")
RATES = {"acceleration": 1e3, "jerk": 5e5}
"""Limits that some files state beside URDF's own (Drake, newer urdfdom), and what no joint does, in
[rad/s^2] and [rad/s^3]. Ours: more than those of a joint at `_FASTEST` by the gate's own rule."""
_ATTRIBUTES = {
    "parent": {"link"},
    "child": {"link"},
    "origin": {"xyz", "rpy", "quat_xyzw"},
    "axis": {"xyz"},
    "limit": {"lower", "upper", "effort", "velocity", *RATES},
    "mimic": {"joint", "multiplier", "offset"},
    "safety_controller": {"soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"},
}
"""What a joint may say that matters to its motion."""
_PLACING = ("origin", "axis")
"""What says where a joint is and how it moves: an unknown attribute may say that otherwise."""
_PASSED_OVER = {"deceleration"}
"""Attributes of newer URDFs that no rule here reads."""
_ELSEWHERE = ("dynamics", "calibration")
"""What else URDF lets it say."""
_NEARLY = 0.74
"""Share of two words' letters that agree from which one is a slip of the other (ours): `axs`."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_OFF_LENGTH = 0.01
"""By how much a quaternion may differ from length 1: two written digits."""
_LONGEST_NAME, _LONGEST_PROBLEM, _LONGEST_WORD = 200, 400, 40
_LARGEST_FILE = 20_000_000
"""Bytes (ours): several times what the largest humanoids have."""
_FASTEST, _FARTHEST = 40.0, 10.0
"""What no joint does, in [rad/s], and how long no link is, in [m]. Ours: Unitree states 37 rad/s of
the G1's shoulders, and no link has half of that; a lost decimal point is mostly more."""
LARGEST = {"velocity": _FASTEST, **RATES}
"""What no joint does, in rad and s."""
BESIDE = 0.01
"""By how much a joint may be held beyond its range, [rad] or [m] (ours): two written digits."""
_UNBOUND = errors.codes[errors.XML_ERROR_UNBOUND_PREFIX]
_PREFIX = re.compile(rb"[\s<]([A-Za-z_][\w.-]*):[A-Za-z_]")
_DECLARED = re.compile(rb"xmlns:([\w.-]+)")
"""Prefixes that are used, and those that are declared."""
_WEB_PAGE = (b"<!doctype html", b"<html")
"""Beginnings of what a browser saves in the place of a file, in lower case."""
_OTHER_FORMATS = {"mujoco": "MuJoCo's format", "sdf": "SDF"}
"""By the element with which a file begins."""
_ASK = "give the URDF of the arm, as its maker's ROS package has it"
_XACRO = "make a URDF of its xacro: xacro arm.urdf.xacro > arm.urdf"


def read_joints(path: Path) -> tuple[str, list[Joint], list[str], dict[str, str]]:
    """Read the robot's name, joints, links from the root outwards, and names of links' meshes.

    FileFormatError if it is no URDF, or its links do not all hang from one root.
    """
    if not path.is_file():
        raise FileFormatError(f"no URDF at {path}; give the path of a .urdf file")
    if path.name.lower().endswith(".sdf"):
        raise FileFormatError(f"{path}: SDF is not read; {_ASK}")
    if path.name.endswith(".xacro"):
        raise FileFormatError(f"{path} is a xacro; make a URDF of it: xacro {path} > arm.urdf")
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise ValueError(f"it has more than {_LARGEST_FILE / 1e6:g} MB, as no URDF has")
        refuse_pointers(path)
        with path.open("rb") as file:
            if file.read(_LONGEST_NAME).lstrip().lower().startswith(_WEB_PAGE):
                raise FileFormatError(f"{path} is a web page; download the file that it shows")
        root = _root_of(path.read_bytes())
        joints = _joints_of(root, path)
        links = _links_of(root, joints)
        return root.get("name") or path.stem, joints, links, _meshes_of(root, joints)
    except FileFormatError:
        raise
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        problem = str(error)[:_LONGEST_PROBLEM]
        raise FileFormatError(
            f"cannot read {path} as URDF: {problem}; mend it there, or export it again"
        ) from error


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint, of which only the ends are read before it is known to be of the arm."""

    name: str
    type: str
    parent: str
    child: str
    mimics: str | None
    """Name of the joint that it follows."""
    element: ElementTree.Element
    namespace: str

    @property
    def free(self) -> bool:
        """Whether it turns by itself."""
        return self.type in TURNING and self.mimics is None

    @property
    def has_axis(self) -> bool:
        """Whether it turns about an axis, or slides along one."""
        return self.type in (*TURNING, "prismatic")

    def error(self, problem: str) -> ConfigurationError:
        """Return what to raise where something is wrong with it."""
        return ConfigurationError(f"joint {self.name} {problem}")

    @cached_property
    def parts(self) -> dict[str, dict[str, str]]:
        """Attributes by element, with nothing in it that is nearly known or said twice."""
        for text in (self.element.text, *(part.tail for part in self.element)):
            if text and text.strip():  # an element that lacks its bracket
                raise FileFormatError(f"text in joint {self.name}: {text.strip()[:80]!r}")
        if self.type not in TYPES:
            raise self.error(f"has type {self.type[:80]!r}; give one of {', '.join(TYPES)}")
        found: dict[str, dict[str, str]] = {}
        for tag, attributes in self._elements():
            if tag in found:
                raise self.error(f"has two <{tag}>; take one out")
            found[tag] = attributes
        for tag, attributes in found.items():
            words = _ATTRIBUTES.get(tag, ())
            for key in attributes.keys() - words - _PASSED_OVER:
                self._refuse_slip(key, words - attributes.keys() if words else (), f" in <{tag}>")
                if tag in _PLACING and "}" not in key:
                    raise self.error(
                        f"has an unknown {key} in <{tag}>; take it out, or say it in "
                        f"{', '.join(sorted(words))}"
                    )
            if tag not in (*_ATTRIBUTES, *_ELSEWHERE):
                self._refuse_slip(
                    f"<{tag}>", [f"<{known}>" for known in _ATTRIBUTES.keys() - found]
                )
        return found

    @cached_property
    def unknown(self) -> list[str]:
        """What is said of it that URDF does not know."""
        words = [key for key in self.element.attrib if key not in ("name", "type")]
        for tag, attributes in self._elements():
            if tag not in (*_ATTRIBUTES, *_ELSEWHERE):
                words.append(f"<{tag}>")
            elif tag in _ATTRIBUTES:
                words += [f"{key} in <{tag}>" for key in attributes.keys() - _ATTRIBUTES[tag]]
        return [word.rpartition("}")[2][:80] for word in words]

    def _elements(self) -> Iterable[tuple[str, dict[str, str]]]:
        """Tags and attributes; URDF's own words and those of rates without a namespace."""
        for part in self.element:
            pairs = ((key, key.rpartition("}")[2], value) for key, value in part.items())
            attributes = {word if word in RATES else key: value for key, word, value in pairs}
            yield part.tag.removeprefix(self.namespace), attributes

    def _refuse_slip(self, word: str, known: Iterable[str], where: str = "") -> None:
        if near := _nearly(word, known):
            raise self.error(f"has an unknown {word}{where}; is it {near}?")

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
            wants += f", or {_XACRO}" * _is_of_xacro(text)
            raise self.error(f'has <{part} {key}="{text[:80]}">; give {wants}')
        return values

    def followed(self, position: float) -> float:
        """Return where it stands, [rad] or [m], while the joint that it follows is at a place."""
        multiplier, offset = (self.number("mimic", key) for key in ("multiplier", "offset"))
        return (1.0 if multiplier is None else multiplier) * position + (offset or 0.0)

    def check_held(self, position: float) -> None:
        """Refuse a place that was said, [rad] or [m], at which it cannot stand still."""
        if not self.has_axis:
            if position:
                raise self.error(f"is {self.type}, and can be held at 0 alone")
            return
        nearest = self.nearest(position)
        if nearest == position:
            return
        low, high = self.places()
        unit, others = ("rad", ["deg"]) if self.type in TURNING else ("m", ["cm", "mm"])
        asked = ""
        for other in others if abs(position) > UNITS[unit].largest else []:
            meant = position * UNITS[other].factor
            if not asked and low <= meant <= high:
                asked = f"; in {UNITS[other].plural}? then say --hold {self.name}={meant:.4g}"
        asked = asked or f"; say where in that it stands: --hold {self.name}={nearest:.4g}"
        raise self.error(
            f"is held at {position:g} {unit}, and its range is {low:.4g} to {high:.4g} {unit}"
            f"{asked}"
        )

    def places(self) -> tuple[float, float]:
        """Lowest and highest place at which it can stand still, [rad] or [m]."""
        if not self.has_axis:
            return 0.0, 0.0
        turn = 2 * math.pi
        return (-turn, turn) if self.type == "continuous" else self.ends()

    def nearest(self, position: float) -> float:
        """Return the place nearest to one, [rad] or [m], at which it can stand still.

        That is the place itself where it is beyond the range by no more than rounding.
        """
        low, high = self.places()
        held = low - BESIDE <= position <= high + BESIDE
        return position if held else min(max(position, low), high)

    def pose(self, position: float | None) -> np.ndarray:
        """Pose of the frame behind it in the frame before, 4 x 4, with the joint at 0 or held."""
        if self.type in TURNING and "origin" not in self.parts:
            raise self.error('has no <origin>; write <origin xyz="0 0 0" rpy="0 0 0"/> if it is so')
        pose = np.eye(4)
        roll, pitch, yaw = self.vector("origin", "rpy")
        pose[:3, :3], pose[:3, 3] = rotation(roll, pitch, yaw), self.vector("origin", "xyz")
        if "quat_xyzw" in self.parts.get("origin", {}):
            pose[:3, :3] = self._turned()
        if np.abs(pose[:3, 3]).max() > _FARTHEST or max(map(abs, (roll, pitch, yaw))) > 7:
            raise self.error(
                f"has an <origin> beyond {_FARTHEST:g} m or a turn; URDF is in m and rad: convert "
                "what is in other units, and look for lost dots"
            )
        if position and self.type in TURNING:
            pose[:3, :3] = pose[:3, :3] @ rotations_about(self.axis(), np.array([position]))[0]
        elif position and self.type == "prismatic":
            pose[:3, 3] += pose[:3, :3] @ self.axis() * position
        return pose

    def _turned(self) -> np.ndarray:
        """Attitude of its `quat_xyzw`, 3 x 3 (urdfdom since 2025: x, y, z, w)."""
        if "rpy" in self.parts["origin"]:
            raise self.error("has rpy and quat_xyzw in its <origin>; take one out")
        quaternion = self.vector("origin", "quat_xyzw", 4)
        if abs(math.hypot(*quaternion) - 1) > _OFF_LENGTH:
            raise self.error(
                f"needs a quat_xyzw of length 1, and it has {math.hypot(*quaternion):.3g}; write "
                "x y z w of the turn"
            )
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_quat(quaternion).as_matrix())

    def axis(self) -> tuple[float, float, float]:
        """About which it turns, or along which it slides: a direction, made of length 1."""
        x, y, z = self.vector("axis", "xyz") if "axis" in self.parts else (1.0, 0.0, 0.0)
        if not (length := math.hypot(x, y, z)):
            raise self.error("has an <axis> of length 0; write the one it turns about")
        return x / length, y / length, z / length

    def ends(self) -> tuple[float, float]:
        """Lower and upper end by its <limit>: infinite where it says neither, else 0 for one."""
        low, high = self.number("limit", "lower"), self.number("limit", "upper")
        return (-math.inf, math.inf) if low is None is high else (low or 0.0, high or 0.0)

    def unsaid(self) -> list[str]:
        """What its file leaves to the parsers of URDF, which all take it so."""
        lacks = [] if "axis" in self.parts else ["<axis> 1 0 0"]
        given = {"lower", "upper"} & self.parts.get("limit", {}).keys()
        if self.type != "continuous" and len(given) == 1:
            lacks += [f"{end} 0" for end in ("lower", "upper") if end not in given]
        return [f"{what} of joint {self.name}" for what in lacks]

    def range(self) -> tuple[float, float]:
        """Lowest and highest position of a joint that turns, by its soft limits too."""
        low, high = (-ENDLESS, ENDLESS) if self.type == "continuous" else self.ends()
        if not -ENDLESS <= low < high <= ENDLESS:
            has = f"{low:g} to {high:g}" if high < math.inf else "its <limit> has none"
            has += ", in degrees?" * (ENDLESS < max(abs(low), abs(high)) < math.inf)
            has += ", exchanged?" * (low > high)
            raise self.error(
                f"has no range within {ENDLESS:.4g} rad: {has}; write lower and upper into its "
                "<limit>, in rad"
            )
        soft = [self.number("safety_controller", f"soft_{end}_limit") for end in ("lower", "upper")]
        lowest = low if soft[0] is None else max(low, soft[0])
        highest = high if soft[1] is None else min(high, soft[1])
        if not lowest < highest:
            raise self.error(
                f"has no range left by its <safety_controller>: {lowest:g} to {highest:g}, of "
                f"{low:.4g} to {high:.4g} in its <limit>; mend its soft limits, or take it out"
            )
        return lowest, highest


def _root_of(content: bytes) -> ElementTree.Element:
    """Parse the root element; undeclared prefixes, such as Drake's, are declared first."""
    try:
        return ElementTree.fromstring(content, ElementTree.XMLParser(target=_Builder()))
    except ElementTree.ParseError as error:
        if error.code != _UNBOUND:
            raise
    prefixes = {*_PREFIX.findall(content)} - {b"xml", b"xmlns", *_DECLARED.findall(content)}
    declared = b"".join(b' xmlns:%s="%s"' % (prefix, prefix) for prefix in sorted(prefixes))
    content = content.replace(b"<robot", b"<robot" + declared, 1)
    return ElementTree.fromstring(content, ElementTree.XMLParser(target=_Builder()))


class _Builder(ElementTree.TreeBuilder):
    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Entities stand for other text, which a URDF needs none of."""
        raise ValueError("it has a DOCTYPE, which no URDF has")


def _nearly(word: str, known: Iterable[str]) -> str | None:
    """What a word is a slip of."""
    return next(iter(get_close_matches(word[:_LONGEST_WORD], known, 1, _NEARLY)), None)


def _name(element: ElementTree.Element) -> str:
    name = element.get("name", "")
    if not (name and name.isprintable() and len(name) <= _LONGEST_NAME):
        raise ValueError(f"a <{element.tag}> has no name, or one that is none: {name[:80]!r}")
    if _is_of_xacro(name):
        raise ValueError(f"{name[:80]!r} is left of a xacro: {_XACRO}")
    return name


def _is_of_xacro(text: str) -> bool:
    return "${" in text or "$(" in text


def _refuse_repeated(what: str, names: Sequence[str]) -> None:
    for name, times in Counter(names).most_common(1):
        if times > 1:
            raise ValueError(f"two {what.format(name)}")


def _joints_of(robot: ElementTree.Element, path: Path) -> list[Joint]:
    """Every joint, with its type and its ends."""
    space = "".join(robot.tag.rpartition("}")[:2])
    if robot.tag.removeprefix(space) != "robot":
        problem = f"it begins with <{robot.tag[:80]}>, not <robot>"
        if robot.tag in _OTHER_FORMATS:
            raise FileFormatError(
                f"{path}: {problem}: {_OTHER_FORMATS[robot.tag]} is not read; {_ASK}"
            )
        raise ValueError(problem)
    if any("xacro}" in element.tag for element in robot.iter()):
        raise ValueError(f"it has elements of xacro: {_XACRO}")
    found: list[Joint] = []
    for element in robot.findall(f"{space}joint"):
        name, kind = _name(element), element.get("type", "")
        if not kind or (kind not in TYPES and _nearly(kind, TYPES)):
            raise ValueError(f"joint {name} has no type, or none of {', '.join(TYPES)}")
        parent, child, mimic = (element.find(space + tag) for tag in ("parent", "child", "mimic"))
        ends = [end.get("link", "") for end in (parent, child) if end is not None]
        if len(ends) != 2 or not all(ends):
            raise ValueError(f"joint {name} has no <parent link> or <child link>")
        follows = None if mimic is None else mimic.get("joint", "")
        found.append(Joint(name, kind, ends[0], ends[1], follows, element, space))
    if not found:
        raise ValueError("it has no joint, and so is no arm")
    _refuse_repeated("joints are called {}", [joint.name for joint in found])
    return found


def _meshes_of(robot: ElementTree.Element, joints: list[Joint]) -> dict[str, str]:
    """File names of the meshes of each link; the files are not read."""
    space = joints[0].namespace
    return {
        _name(link): " ".join(
            mesh.get("filename", "").rpartition("/")[2] for mesh in link.iter(f"{space}mesh")
        )
        for link in robot.findall(f"{space}link")
    }


def _links_of(robot: ElementTree.Element, joints: list[Joint]) -> list[str]:
    """Every link, from the root outwards; all hang from one root."""
    names = [_name(element) for element in robot.findall(f"{joints[0].namespace}link")]
    _refuse_repeated("links are called {}", names)
    behind: dict[str, list[str]] = {name: [] for name in names}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in behind:
                raise ValueError(f"joint {joint.name} names {end[:80]!r}, which is no link")
        behind[joint.parent].append(joint.child)
    _refuse_repeated("joints move one link, {}", [joint.child for joint in joints])
    moved = {joint.child for joint in joints}
    reached = [name for name in behind if name not in moved]
    if len(reached) != 1:
        raise ValueError(f"{len(reached)} links hang from no joint instead of one")
    for link in reached:
        reached += behind[link]
    if len(reached) < len(names):
        raise ValueError("its joints form a loop")
    return reached
