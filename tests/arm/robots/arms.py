"""URDFs of arms as their makers' packages give them, without meshes."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from pathlib import Path

Joint = tuple[str, str, Sequence[float], Sequence[float], str]
"""Name, type, xyz, rpy, and the <limit>'s attributes."""

UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def limit(low: float, high: float, speed: float) -> str:
    return f'lower="{low}" upper="{high}" velocity="{speed}" effort="100"'


def ur5e() -> list[Joint]:
    """UniversalRobots/Universal_Robots_ROS2_Description with the nominal lengths."""
    turn, half = limit(-2 * pi, 2 * pi, pi), limit(-pi, pi, pi)
    poses = [
        ((0, 0, 0.1625), (0, 0, 0)),
        ((0, 0, 0), (pi / 2, 0, 0)),
        ((-0.425, 0, 0), (0, 0, 0)),
        ((-0.3922, 0, 0.1333), (0, 0, 0)),
        ((0, -0.0997, 0), (pi / 2, 0, 0)),
        ((0, 0.0996, 0), (pi / 2, pi, pi)),
    ]
    moving = [
        (name, "revolute", xyz, rpy, half if name == "elbow_joint" else turn)
        for name, (xyz, rpy) in zip(UR, poses, strict=True)
    ]
    fixed = (0, 0, 0)
    return [
        ("base_link-base_link_inertia", "fixed", fixed, (0, 0, pi), ""),
        *moving,
        ("wrist_3-flange", "fixed", fixed, (0, -pi / 2, -pi / 2), ""),
        ("flange-tool0", "fixed", fixed, (pi / 2, 0, pi / 2), ""),
    ]


def write_urdf(
    path: Path, joints: Sequence[Joint], *, last: str = "tool0", axis: str = "0 0 1", more: str = ""
) -> Path:
    """A chain of links link0, link1, ..., the last by its name; their meshes are not there."""
    names = [f"link{i}" for i in range(len(joints))] + [last]
    mesh = '<visual><geometry><mesh filename="package://gone/a.stl"/></geometry></visual>'
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    inertial = f'<inertial><mass value="1"/>{inertia}</inertial>'
    lines = [f'<link name="{name}">{inertial}{mesh}</link>' for name in names]
    for i, (name, kind, xyz, rpy, attributes) in enumerate(joints):
        said = f"<limit {attributes}/>" if attributes else ""
        lines.append(
            f'<joint name="{name}" type="{kind}"><parent link="{names[i]}"/>'
            f'<child link="{names[i + 1]}"/><axis xyz="{axis}"/>'
            f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>{said}'
            "</joint>"
        )
    path.write_text(f'<robot name="arm">{"".join(lines)}{more}</robot>')
    return path
