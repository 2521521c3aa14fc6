"""Limits and kinematics of any serial arm from its URDF, read with yourdfpy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.bench.robots.kinematics import Chain, Pose
from prior_reinforce.bench.robots.limits import RobotLimits
from prior_reinforce.errors import ConfigurationError, FileFormatError, MissingExtraError

_TURNING = ("revolute", "continuous")
_ENDLESS = 4 * math.pi
"""What a joint without ends may turn either way, in [rad]. Ours: two turns, since a throw that
needs more is a wrong unit."""
_TIPS = ("tool0", "flange", "link_eef")
"""Links that are the flange by ROS's conventions (REP 199) and UFACTORY's; the first there is."""


def read_urdf(path: Path, tip: str | None = None) -> RobotLimits:
    """Read the limits and the kinematics of an arm.

    Args:
        path: Of a URDF; meshes that it names are not read.
        tip: The link that is the flange; None takes `tool0`, `flange` or `link_eef`, else the link
            that the last turning joint of the longest chain moves.

    Returns:
        Its limits, the root link being the base frame; no accelerations, which URDF does not have.

    Raises:
        FileFormatError: No URDF, or one without such a chain.
        ConfigurationError: No such link, or a joint without limits.
        MissingExtraError: yourdfpy is not installed.
    """
    robot = _parsed(path)
    parent = {joint.child: joint for joint in robot.joints}
    names = [link.name for link in robot.links]
    if tip is None:
        tip = next((name for name in _TIPS if name in names), None) or _longest(path, names, parent)
    elif tip not in names:
        raise ConfigurationError(f"{path} has no link {tip!r}; it has {', '.join(names[:40])}")
    chain = _to_root(path, tip, parent)
    turning = [joint for joint in chain if joint.type in _TURNING]
    if not turning:
        raise FileFormatError(f"{path}: no joint turns between the base and {tip}; say --tip")
    for joint in chain:
        if joint.type not in (*_TURNING, "fixed"):
            raise FileFormatError(
                f"{path}: {joint.name} is {joint.type}, and arms of turning joints are known only; "
                "say --tip for a link before it"
            )
    limits = [_limits(path, joint) for joint in turning]
    lower, upper, velocity = (np.array(values) for values in zip(*limits, strict=True))
    return RobotLimits(
        robot=robot.name or path.stem,
        firmware="any",
        source=f"{path.name}, from {chain[0].parent} to {tip}",
        joint_names=tuple(joint.name for joint in turning),
        lower=lower,
        upper=upper,
        velocity=velocity,
        chain=_chain(chain),
    )


def _parsed(path: Path) -> Any:
    try:
        import yourdfpy
    except ImportError as error:
        raise MissingExtraError(
            "yourdfpy is not installed, which reading a URDF needs; run: pip install "
            '"prior-reinforce[urdf]"'
        ) from error
    if not path.is_file():
        raise FileFormatError(f"no URDF at {path}; give the path of a .urdf file")
    if path.name.endswith(".xacro"):
        raise FileFormatError(f"{path} is a xacro; make a URDF of it: xacro {path} > arm.urdf")
    try:
        model = yourdfpy.URDF.load(
            str(path), build_scene_graph=False, load_meshes=False, load_collision_meshes=False
        )
    except Exception as error:  # lxml and yourdfpy raise a dozen kinds on damaged files
        words = str(error).split("\n")[0][:200] or "no reason given"
        raise FileFormatError(
            f"cannot read {path} as URDF ({type(error).__name__}: {words}); export it again"
        ) from error
    if not model.robot.joints:
        raise FileFormatError(f"{path} is no URDF of an arm: it has no joint; export it again")
    return model.robot


def _to_root(path: Path, link: str, parent: dict[str, Any]) -> list[Any]:
    """Joints from the root to a link."""
    chain: list[Any] = []
    while link in parent:
        chain.append(parent[link])
        link = parent[link].parent
        if len(chain) > len(parent):
            raise FileFormatError(f"{path}: its joints form a loop; export it again")
    return chain[::-1]


def _longest(path: Path, links: list[str], parent: dict[str, Any]) -> str:
    """The link behind the last turning joint of the chain that has most of them."""
    turning = {
        link: sum(joint.type in _TURNING and joint.mimic is None for joint in chain)
        for link in links
        if (chain := _to_root(path, link, parent))
    }
    most = max(turning.values(), default=0)
    moved = [link for link in links if turning.get(link) == most and parent[link].type in _TURNING]
    if len(moved) != 1:
        raise ConfigurationError(
            f"{path} ends in {', '.join(moved) or 'no turning joint'}; say which link is the "
            "flange with --tip"
        )
    return moved[0]


def _limits(path: Path, joint: Any) -> tuple[float, float, float]:
    limit = joint.limit
    velocity = None if limit is None else limit.velocity
    if not velocity or not velocity > 0:
        raise ConfigurationError(
            f"{path}: joint {joint.name} has no velocity limit; write the maker's into its <limit>"
        )
    if joint.type == "continuous":
        return -_ENDLESS, _ENDLESS, float(velocity)
    if limit.lower is None or limit.upper is None or not limit.lower < limit.upper:
        raise ConfigurationError(
            f"{path}: joint {joint.name} has no range; write lower and upper into its <limit>"
        )
    return float(limit.lower), float(limit.upper), float(velocity)


def _chain(joints: list[Any]) -> Chain:
    """Origins of the turning joints, with the fixed ones before each taken in."""
    origins: list[Pose] = []
    axes: list[tuple[float, float, float]] = []
    since = np.eye(4)
    for joint in joints:
        since = since @ (np.eye(4) if joint.origin is None else np.asarray(joint.origin))
        if joint.type in _TURNING:
            origins.append(_pose(since))
            axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis)
            x, y, z = (axis / np.linalg.norm(axis)).tolist()
            axes.append((x, y, z))
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
