"""URDFs in the forms that makers' packages have, written from a table of joints.

The joints are ours; what real files do with them is what counts here: names, prefixes, grippers,
wheels, lifts, missing and extra words.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

HEAD = '<?xml version="1.0"?>\n'


@dataclass(frozen=True)
class J:
    """A joint; it moves the link `to`, which hangs from the link before unless `of` names one."""

    name: str
    to: str
    kind: str = "revolute"
    of: str | None = None
    xyz: tuple[float, float, float] = (0.0, 0.1, 0.2)
    rpy: tuple[float, float, float] = (0.3, 0.0, -0.2)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    low: float | None = -2.5
    high: float | None = 2.25
    speed: float | None = 2.0
    more: str = ""
    """Further elements."""
    attributes: str = ""
    """Further attributes of the joint."""
    limit: str = 'effort="30"'
    """Further attributes of the <limit>."""

    def text(self, before: str) -> str:
        def numbers(values: Sequence[float]) -> str:
            return " ".join(f"{value:g}" for value in values)

        said = {"lower": self.low, "upper": self.high, "velocity": self.speed}
        if self.kind in ("continuous",):
            del said["lower"], said["upper"]
        limits = " ".join(f'{k}="{v}"' for k, v in said.items() if v is not None)
        parts = [
            f'<origin xyz="{numbers(self.xyz)}" rpy="{numbers(self.rpy)}"/>',
            f'<parent link="{self.of or before}"/>',
            f'<child link="{self.to}"/>',
        ]
        if self.kind != "fixed":
            parts.append(f'<axis xyz="{numbers(self.axis)}"/>')
            parts.append(f"<limit {limits} {self.limit}/>")
        inside = "\n    ".join([*parts, *([self.more] if self.more else [])])
        more = f" {self.attributes}" * bool(self.attributes)
        return f'  <joint name="{self.name}" type="{self.kind}"{more}>\n    {inside}\n  </joint>\n'


def fixed(name: str, to: str, **more: object) -> J:
    return J(name, to, "fixed", **more)  # type: ignore[arg-type]


def arm(names: Sequence[str], links: Sequence[str] | None = None, **more: object) -> list[J]:
    """Turning joints one behind the other, about axes that change."""
    links = links or [f"{name.removesuffix('_joint')}_link" for name in names]
    axes = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)]
    return [
        J(name, link, axis=axes[i % 4], **more)  # type: ignore[arg-type]
        for i, (name, link) in enumerate(zip(names, links, strict=True))
    ]


def fingers(of: str, kind: str = "prismatic", names: Sequence[str] = ("left", "right")) -> list[J]:
    """Fingers that open beside each other, the second following the first."""
    first, *others = names
    follow = f'<mimic joint="{first}_finger_joint" multiplier="1"/>'
    made = [J(f"{first}_finger_joint", f"{first}_finger", kind, of=of, low=0.0, high=0.04)]
    return made + [
        J(f"{n}_finger_joint", f"{n}_finger", kind, of=of, low=0.0, high=0.04, more=follow)
        for n in others
    ]


def wheels(of: str = "base_link", n: int = 4) -> list[J]:
    return [J(f"wheel_{i}_joint", f"wheel_{i}", "continuous", of=of) for i in range(n)]


@dataclass(frozen=True)
class Urdf:
    """A file, how it is read, and what is right."""

    label: str
    joints: Sequence[J]
    options: Mapping[str, str] = field(default_factory=dict)
    root: str = "base_link"
    name: str = 'name="robot"'
    before: str = HEAD
    more: str = ""
    """Further elements of the robot."""
    change: tuple[str, str] = ("", "")
    """A pattern of the text, and what replaces it."""
    says: str = ""
    """What a refusal says; empty for a file that is read."""
    moved: tuple[str, ...] = ()
    """Names of the arm's joints."""
    tip: str = ""
    """The flange."""

    def text(self) -> str:
        links, joints, last = [self.root], [], self.root
        for joint in self.joints:
            joints.append(joint.text(last))
            links.append(joint.to)
            last = joint.to
        said = "".join(f'  <link name="{link}"/>\n' for link in links) + "".join(joints)
        text = f"{self.before}<robot {self.name}>\n{said}{self.more}</robot>\n"
        return re.sub(self.change[0], self.change[1], text) if self.change[0] else text

    def place(self, positions: Mapping[str, float], base: str) -> np.ndarray:
        """Where the flange is in the base's frame, by another way than the reader's."""
        ends, last = {}, self.root
        for joint in self.joints:
            ends[joint.to] = (joint, joint.of or last)
            last = joint.to
        point, link = np.zeros(3), self.tip
        while link in ends and link != base:
            joint, link = ends[link]
            angle = positions.get(joint.name, 0.0) * np.array(joint.axis)
            if joint.kind == "prismatic":
                point = point + angle
            elif joint.kind != "fixed":
                point = Rotation.from_rotvec(angle).apply(point)
            point = Rotation.from_euler("xyz", joint.rpy).apply(point) + joint.xyz
        return np.asarray(point)
