"""Writing the manifest of a new workspace, and the columns that its first import brings."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.arm.robots.presets import GRIPPERS, PRESETS, robot_limits
from prior_reinforce.arm.robots.urdf import read_urdf
from prior_reinforce.arm.workspace.declared import read_object
from prior_reinforce.arm.workspace.manifest import LIMIT_LISTS, UNKNOWN
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.plans.channels import kinds
from prior_reinforce.registry import parse_choice
from prior_reinforce.settings import tomllib
from prior_reinforce.units import factor

TEMPLATE = Path(__file__).with_name("template.toml").read_text(encoding="utf-8")
"""The manifest that `new` writes, for `format` to fill in."""
_TOLERANCE = 0.015
"""What a new workspace of lengths counts as reached, in [m]."""


@dataclass(frozen=True, kw_only=True)
class NewWorkspace:
    """What a new workspace is about."""

    name: str | None = None
    """Name of the task; the folder's name if not given."""
    robot: str | RobotLimits = "panda"
    """Whose limits hold: a preset, the path of a .urdf, limits, or none."""
    tip: str | None = None
    """Link of the URDF that is the flange; tool0, flange or the last that turns if not given."""
    base: str | None = None
    """Link of the URDF at which the base frame stands, for instance above a lift, upright as its
    root is; the root if not given."""
    hold: tuple[str, ...] = ()
    """Joints of the URDF that stand still, and where, in [rad] or [m]: lift=0.2."""
    action_names: tuple[str, ...] | None = None
    """Names of the action dimensions; the robot's joints if not given, with no robot those that
    the first import has."""
    action_units: tuple[str, ...] = ()
    """Unit of each action dimension; a single one holds for all; rad if not given, and of what is
    called a speed rad/s or m/s, a place m."""
    gripper: str | None = None
    """Unit of a gripper's opening, one more dimension: percent, m, steps, ..., or none; an SO-101
    has one in percent if not given."""
    dt: float = 0.0125
    """Time between two frames of a plan, in seconds."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the outcome's components."""
    outcome_units: tuple[str, ...] = ("m",)
    """Unit of each component; a single one holds for all."""
    tolerance: float | Sequence[float] = ()
    """Largest distance from the goal that counts as reached, in the outcome's units: one number,
    or one for each component, which mixed units need; 1.5 cm of lengths if not given."""
    symmetry: str | None = None
    """Where the object is before it leaves, so that one demonstration is enough: carried (by the
    arm, a throw), a place such as "0.43 0" (it lies there, pushed or struck), anywhere (the motion
    may happen anywhere on the table; poses alone), or none."""
    box: tuple[float, float, float, float, float, float] | None = None
    """Two corners, x y z x y z in metres, of the box that the tool tip must stay in: a turned
    motion sweeps other parts of the room."""
    no_box: bool = False
    """No such box is wanted."""
    arm: str | None = None
    """What drives the arm, with its settings ([arm] of the manifest): fr3,host=172.16.0.2,
    ur,host=192.168.1.10 or lerobot,robot.type=so101_follower,robot.port=/dev/ttyACM0."""

    def manifest(self, folder: str) -> str:
        """Return the text of its manifest; the folder's name is the task's if it has none.

        Raises:
            ConfigurationError: A setting that has no use, or an unknown robot.
            FileFormatError: The URDF cannot be read.
        """
        robot = self.robot
        known = robot if isinstance(robot, str) else robot.robot
        is_file = known.lower().endswith((".urdf", ".xml", ".xacro", ".sdf"))
        if not is_file and (self.tip, self.base, self.hold) != (None, None, ()):
            raise ConfigurationError(
                f"--tip, --base and --hold are of a URDF, and --robot is {known}; drop them"
            )
        if isinstance(robot, str) and robot != "none":
            robot = self.described(Path(robot)) if is_file else robot_limits(robot)
        own, unit = GRIPPERS.get(known.lower(), ("gripper", "none"))
        unit = self.gripper or (unit if self.action_names is None else "none")
        names: Sequence[str] | None = self.action_names
        if names is None:
            names = UNKNOWN if isinstance(robot, str) else robot.joint_names
        if tuple(names) == UNKNOWN and unit != "none":
            raise ConfigurationError(
                "--gripper adds a column to an arm's joints, and --robot is none; name all columns "
                "with --action-names, or drop it: the first import then takes what was recorded"
            )
        units: Sequence[str] = ("rad",) * len(names)
        if self.action_units:
            units = _spread(self.action_units, len(names))
        elif self.action_names is not None:
            units = [kind.usual_unit(math.inf) for kind in kinds(names)]
        if unit != "none":
            names, units = (*names, own), (*units, unit)
        given = None
        if isinstance(robot, RobotLimits) and (is_file or robot.robot not in PRESETS):
            given = robot
        outcome_units = _spread(self.outcome_units, len(self.outcome_names))
        numbers = np.atleast_1d(self.tolerance).tolist() or _usual_tolerance(outcome_units)
        text = TEMPLATE.format(
            name=_toml(self.name or folder)[1:-1],
            names=_toml(names),
            units=_toml(units),
            dt=self.dt,
            outcome_names=_toml(self.outcome_names),
            outcome_units=_toml(outcome_units),
            tolerance=numbers[0] if len(numbers) == 1 else numbers,
            robot="given" if given is not None else known,
        )
        text = self._with_symmetry(text)
        if self.arm is not None:
            text = text[: text.index("# [arm]")] + _section_of(self.arm)
        if given is None:
            return text
        start, end = text.index("# joint_names ="), text.index("# The program's own lines")
        return text[:start] + _written_out(given) + "\n" + text[end:]

    def described(self, path: Path) -> RobotLimits:
        """Read the URDF that is the robot.

        Raises:
            ConfigurationError: `hold` is not name=number, or the URDF's flange is not clear.
            FileFormatError: The URDF cannot be read.
        """
        return read_urdf(path, self.tip, self.base, self.held())

    def held(self) -> dict[str, float]:
        """Return the joints that stand still, and where.

        Raises:
            ConfigurationError: One is not name=number, or is said twice.
        """
        held = dict[str, float]()
        for said in self.hold:
            name, _, position = said.rpartition("=")
            if name in held:
                raise ConfigurationError(f"--hold says twice where {name} stands; say it once")
            try:
                held[name] = float(position)
            except ValueError:
                held[name] = math.nan
            if not (name and math.isfinite(held[name])):
                raise ConfigurationError(f"--hold must be a joint and where: lift=0.2; got {said}")
        return held

    def _with_symmetry(self, text: str) -> str:
        """The text with what was said of the object and the box."""
        said: dict[str, object] = {}
        if self.box is not None:
            low, high = [*self.box[:3]], [*self.box[3:]]
            said = {"workspace_low": low, "workspace_high": high}
        where = None if self.symmetry is None else read_object(self.symmetry)
        # Neither a turn nor a shift: what is left is the tempo, which says one number.
        if where is not None and (where != "none" or len(self.outcome_names) == 1):
            text = text.replace("# [symmetry]", "[symmetry]")
            said["object"] = json.dumps(where)
            if len(self.outcome_names) > 2:  # tempo and amplitude move x and y alone
                said["distance"] = '"learned"'
            if self.no_box:  # else nothing asks for a box
                said["no_box"] = "true"
        for key, value in said.items():
            text = re.sub(rf"^# {key} = \S.*?(?=\s*(#|$))", f"{key} = {value}", text, flags=re.M)
        return text


def _section_of(arm: str) -> str:
    """What drives the arm, as the manifest says it."""
    name, settings = parse_choice(arm)
    lines = ["[arm]", f"executor = {_toml(name)}"]
    for key, value in settings.items():
        try:
            tomllib.loads(f"{key} = {value}")
        except tomllib.TOMLDecodeError:  # a word
            value = _toml(value)
        lines.append(f"{key} = {value}")
    return "".join(f"{line}\n" for line in lines)


def with_columns(text: str, names: Sequence[str], units: Sequence[str]) -> str:
    """Return a manifest's text with the columns of a plan that were not known when it was made.

    FileFormatError if the section has no line of its own.
    """
    said = {"names": f"names = {_toml(names)}", "units": f"units = {_toml(units)}"}
    if (section := re.search(r"^[ \t]*\[[ \t]*plan[ \t]*\]", text, re.M)) is None:
        raise FileFormatError(
            f"the manifest has no line [plan]; write one, and below it {', '.join(said.values())}"
        )
    head, plan = text[: section.start()], text[section.start() :]
    for key, line in said.items():
        line = line.replace("\\", r"\\")
        plan = re.sub(rf"^[ \t]*{key}[ \t]*=[^\[]*\[[^\]]*\]", line, plan, count=1, flags=re.M)
    return head + plan


def _usual_tolerance(units: Sequence[str]) -> list[float]:
    """1.5 cm in each unit; one number where all are one unit.

    ConfigurationError if some are no lengths.
    """
    numbers = [factor("m", unit) for unit in units]
    if None in numbers:
        raise ConfigurationError(
            f"outcomes are in {', '.join(units)}: say how near to its goal an outcome counts as "
            "reached, one number for each unit: --tolerance"
        )
    each = [float(f"{_TOLERANCE * number:.6g}") for number in numbers if number is not None]
    return each[:1] if len({*units}) == 1 else each


def _spread(values: Sequence[str], n: int) -> tuple[str, ...]:
    return tuple(values) * n if len(values) == 1 else tuple(values)


def _written_out(robot: RobotLimits) -> str:
    """An arm's numbers as lines of the manifest."""
    lines = [f"source = {_toml(robot.source)}", f"joint_names = {_toml(robot.joint_names)}"]
    for key in LIMIT_LISTS:
        values = getattr(robot, key)
        if values is None:
            lines.append(
                f"# {key} = []  # not published; the gate compares with the demonstrations"
            )
        else:
            lines.append(f"{key} = {_rounded(values, 9)}")
    if robot.chain is not None:
        lines.append(
            "# Of each joint: x, y, z [m], roll, pitch, yaw [rad] in the frame before, axis."
        )
        pairs = zip(robot.chain.origins, robot.chain.axes, strict=True)
        rows = [f"  {_rounded((*origin, *axis), 12)}," for origin, axis in pairs]
        lines += ["kinematics = [", *rows, "]", f"flange = {_rounded(robot.chain.flange, 12)}"]
    if robot.held:
        each = ", ".join(f"{_toml(name)} = {at:g}" for name, at in robot.held.items())
        lines.append(f"held = {{ {each} }}  # joints that stand still, as the kinematics have them")
    return "".join(f"{line}\n" for line in lines)


def _rounded(values: Iterable[float], digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]


def _toml(value: str | Sequence[str]) -> str:
    """A text, or a list of them, as TOML wants it: JSON's, but for one control character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
