"""The manifest of a workspace: a commented TOML file that a person writes and can read.

Every message names the file, the line, the value and the remedy.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta, Struct, structs

from prior_reinforce.bench.robots import (
    GateSettings,
    RobotLimits,
    match_joints,
    missing_joints,
    robot_limits,
)
from prior_reinforce.bench.robots.executors import EXECUTORS
from prior_reinforce.bench.robots.executors.base import ArmSettings
from prior_reinforce.bench.robots.kinematics import Chain, Pose
from prior_reinforce.bench.robots.presets import GRIPPERS, PRESETS
from prior_reinforce.bench.robots.urdf import read_urdf
from prior_reinforce.errors import ConfigurationError, FileFormatError, PriorReinforceError
from prior_reinforce.plans.interpolation import RATE
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.readings import as_tolerance
from prior_reinforce.registry import build, own_class
from prior_reinforce.wording import plain

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")
MANIFEST_FILE = "workspace.toml"
TEMPLATE = Path(__file__).with_name("template.toml").read_text(encoding="utf-8")
"""The manifest that `new` writes, for `format` to fill in."""
UNKNOWN = ("?",)
"""Action names where the arm is not known yet: the first import replaces them by the recorded."""
# Ours: every throw within a metre would count as reached, and no motion is sampled at 1 Hz.
_IMPLAUSIBLE_METRES = 1.0
_IMPLAUSIBLE_SECONDS = 1.0


@dataclass(frozen=True)
class Manifest:
    """What a workspace is about."""

    name: str
    """Name of the task."""
    format: PlanFormat
    """What a frame of a plan means."""
    outcome_names: tuple[str, ...]
    """Names of the k components of an outcome."""
    outcome_units: tuple[str, ...]
    """Unit of each component."""
    tolerance: tuple[float, ...]
    """epsilon of each component, in its unit."""
    robot: RobotLimits | None
    """Limits that every plan is held against; None where the manifest says `none`."""
    gate: GateSettings
    """The gate's own lines."""
    arm: str = ""
    """Name of the arm, where this computer moves several: one motion at a time is made on each."""
    driven_by: ArmSettings | None = None
    """What drives it, for `ask --execute`; None where the manifest does not say."""


_Texts = Annotated[tuple[str, ...], Meta(min_length=1)]
_Numbers = Annotated[tuple[float, ...], Meta(min_length=1)]
_Positive = Annotated[tuple[Annotated[float, Meta(gt=0)], ...], Meta(min_length=1)]
_Nine = tuple[float, float, float, float, float, float, float, float, float]


class _Section(Struct, frozen=True, forbid_unknown_fields=True):
    """A section of the file; keys with defaults may be left out."""


class _Task(_Section, frozen=True):
    name: Annotated[str, Meta(pattern=r"\S")]


class _Plan(_Section, frozen=True):
    names: _Texts
    units: _Texts
    dt: float


class _Outcome(_Section, frozen=True):
    names: _Texts
    units: _Texts
    tolerance: Annotated[float, Meta(gt=0)] | _Positive


class _Robot(_Section, frozen=True):
    model: str
    firmware: str = "any"
    joint_names: _Texts | None = None
    lower: _Numbers | None = None
    upper: _Numbers | None = None
    velocity: _Numbers | None = None
    acceleration: _Numbers | None = None
    jerk: _Numbers | None = None
    kinematics: Annotated[tuple[_Nine, ...], Meta(min_length=1)] | None = None
    flange: Pose | None = None
    source: str = ""
    arm: str = ""


_BOX = {"box_low": "workspace_low", "box_high": "workspace_high"}
"""Corners of the tool tip's box, in `GateSettings` and in the file."""
_Gate = msgspec.defstruct(
    "_Gate",
    [(f.name, get_type_hints(GateSettings)[f.name], f.default) for f in fields(GateSettings)],
    bases=(_Section,),
    rename=_BOX,
    frozen=True,
)


class _File(_Section, frozen=True):
    task: _Task
    plan: _Plan
    outcome: _Outcome
    robot: _Robot
    gate: _Gate = _Gate()  # type: ignore[valid-type]
    arm: dict[str, Any] | None = None


_LISTS = ("lower", "upper", "velocity", "acceleration", "jerk")
_REQUIRED = ("joint_names", "lower", "upper", "velocity")
"""Keys that an arm needs whose numbers stand in the manifest."""
_LARGEST_PLAUSIBLE = {"lower": 13.0, "upper": 13.0, "velocity": 50.0}
"""In [rad] and [rad/s]; ours: two turns either way, and twice what the fastest small joints do."""
_LENGTH_OF_AXIS = 1e-3
"""By how much an axis may differ from length 1: three written digits."""


@dataclass(frozen=True, kw_only=True)
class NewWorkspace:
    """What a new workspace is about."""

    name: str | None = None
    """Name of the task; the folder's name if not given."""
    robot: str | RobotLimits = "panda"
    """Whose limits hold: a preset, the path of a .urdf, limits, or none."""
    tip: str | None = None
    """Link of the URDF that is the flange; tool0, flange or the last that turns if not given."""
    action_names: tuple[str, ...] | None = None
    """Names of the action dimensions; the robot's joints if not given, with no robot those that
    the first import has."""
    action_units: tuple[str, ...] = ("rad",)
    """Unit of each action dimension; a single one holds for all."""
    gripper: str | None = None
    """Unit of a gripper's opening, one more dimension: percent, m, steps, ..., or none; an SO-101
    has one in percent if not given."""
    dt: float = 0.0125
    """Time between two frames of a plan, in seconds."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the outcome's components."""
    outcome_units: tuple[str, ...] = ("m",)
    """Unit of each component; a single one holds for all."""
    tolerance: float | Sequence[float] = 0.015
    """Largest distance from the goal that counts as reached, in the outcome's units: one number,
    or one for each component, which mixed units need."""

    def manifest(self, folder: str) -> str:
        """Return the text of its manifest; the folder's name is the task's if it has none.

        Raises:
            ConfigurationError: A setting that has no use, or an unknown robot.
            FileFormatError: The URDF cannot be read.
        """
        robot = self.robot
        known = robot if isinstance(robot, str) else robot.robot
        is_file = known.lower().endswith((".urdf", ".xml", ".xacro"))
        if self.tip is not None and not is_file:
            raise ConfigurationError(f"--tip is a link of a URDF, and --robot is {known}; drop it")
        if isinstance(robot, str) and robot != "none":
            robot = read_urdf(Path(robot), self.tip) if is_file else robot_limits(robot)
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
        units = _spread(self.action_units, len(names))
        if unit != "none":
            names, units = (*names, own), (*units, unit)
        given = robot if isinstance(robot, RobotLimits) and robot.robot not in PRESETS else None
        numbers = np.atleast_1d(self.tolerance).tolist()
        text = TEMPLATE.format(
            name=_toml(self.name or folder)[1:-1],
            names=_toml(names),
            units=_toml(units),
            dt=self.dt,
            outcome_names=_toml(self.outcome_names),
            outcome_units=_toml(_spread(self.outcome_units, len(self.outcome_names))),
            tolerance=numbers[0] if len(numbers) == 1 else numbers,
            robot="given" if given is not None else known,
        )
        if given is None:
            return text
        start, end = text.index("# joint_names ="), text.index("# The program's own lines")
        return text[:start] + _written_out(given) + "\n" + text[end:]


def with_columns(text: str, names: Sequence[str], units: Sequence[str]) -> str:
    """Return a manifest's text with the columns of a plan that were not known when it was made."""
    start = text.index("[plan]")
    head, plan = text[:start], text[start:]
    for key, values in (("names", names), ("units", units)):
        said = f"{key} = {_toml(values)}".replace("\\", r"\\")
        plan = re.sub(rf"^[ \t]*{key}[ \t]*=[^\[]*\[[^\]]*\]", said, plan, count=1, flags=re.M)
    return head + plan


def without_arm(text: str) -> str:
    """Return a manifest's text without what drives the arm, which is each machine's own.

    Raises:
        ConfigurationError: It says so elsewhere than in a section.
    """
    kept = re.sub(r"^[ \t]*\[\s*arm\b.*\n(?:(?![ \t]*\[).*(?:\n|\Z))*", "", text, flags=re.M)
    if "arm" in tomllib.loads(kept):
        raise ConfigurationError(f"{MANIFEST_FILE}: write what drives the arm as a section, [arm]")
    return kept


def _spread(values: Sequence[str], n: int) -> tuple[str, ...]:
    return tuple(values) * n if len(values) == 1 else tuple(values)


def _written_out(robot: RobotLimits) -> str:
    """An arm's numbers as lines of the manifest."""
    lines = [f"source = {_toml(robot.source)}", f"joint_names = {_toml(robot.joint_names)}"]
    for key in _LISTS:
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
    return "".join(f"{line}\n" for line in lines)


def _rounded(values: Iterable[float], digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]


def _toml(value: str | Sequence[str]) -> str:
    """A text, or a list of them, as TOML wants it: JSON's, but for one control character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def read_manifest(path: Path) -> str:
    """Read a manifest's text.

    Raises:
        FileFormatError: The file is missing, or is no text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileFormatError(
            f"no manifest at {path} ({error.strerror}); make a workspace with: prior-reinforce new"
        ) from error
    except ValueError as error:
        raise FileFormatError(f"{path} is not a text in UTF-8: {error}; save it as one") from error


def parse_manifest(text: str, path: Path) -> Manifest:
    """Check a manifest's text; `path` is where messages say it stands.

    Raises:
        FileFormatError: It is no TOML.
        ConfigurationError: A value is missing, unknown, of the wrong kind, or out of range.
    """
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path} is not a TOML file: {error}; mend that line") from error
    return _Reader(path, text, data).manifest()


@dataclass(frozen=True)
class _Reader:
    """Checks what sections say together, and says where a wrong value stands."""

    path: Path
    text: str
    data: dict[str, Any]

    def manifest(self) -> Manifest:
        """Everything, checked."""
        self.check_values()
        try:
            file = msgspec.convert(self.data, _File)
        except msgspec.ValidationError as error:
            raise self.explained(str(error)) from error
        task, plan, outcome, robot = file.task.name, file.plan, file.outcome, file.robot
        if plan.dt > _IMPLAUSIBLE_SECONDS:
            raise self.error("plan", "dt", "looks like milliseconds or a rate; give seconds")
        if robot.model != "none" and plan.dt < (1 - 1e-9) / RATE:
            cycle = f"an arm's cycle of {1 / RATE:g} s, within which nothing is checked"
            raise self.error("plan", "dt", f"is less than {cycle}; give more")
        names, units = outcome.names, outcome.units
        if len(names) != len(units):
            raise self.error("outcome", "units", f"must name one unit for each of {list(names)}")
        if len(set(names)) < len(names):
            raise self.error("outcome", "names", "must differ from each other")
        tolerance = self.made("outcome", as_tolerance, outcome.tolerance, names, units)
        if np.any(tolerance[np.array(units) == "m"] >= _IMPLAUSIBLE_METRES):
            raise self.error("outcome", "tolerance", "looks like centimetres; give metres")
        form = self.made("plan", PlanFormat, plan.names, plan.units, plan.dt)
        limits = self.made("robot", self.limits, robot, task)
        gate = self.made("gate", GateSettings, **structs.asdict(file.gate))
        if unknown := {name for name, *_ in gate.ranges} - {*form.names}:
            named = f"names {', '.join(sorted(unknown))}, and plans have {', '.join(form.names)}"
            raise self.error("gate", "ranges", f"{named}; correct it")
        if limits is not None:
            self.check_joints(form, limits, gate)
        if gate.box_low is not None and (limits is None or limits.chain is None):
            why = "with no robot there is no tool tip to check; take it out, or name the robot"
            if limits is not None:
                why = (
                    f"cannot be checked, since the kinematics of {limits.robot} are not known; "
                    "take it out, or make the workspace with: prior-reinforce new --robot "
                    "path/to/arm.urdf"
                )
            raise self.error("gate", _BOX["box_low"], why)
        numbers, arm = tuple(tolerance.tolist()), self.driven_by(file.arm)
        return Manifest(task, form, names, units, numbers, limits, gate, robot.arm, arm)

    def driven_by(self, arm: dict[str, Any] | None) -> ArmSettings | None:
        """What drives the arm; settings of one's own executor are checked where it is used."""
        if arm is None:
            return None
        options = dict(arm)
        name = options.pop("executor", None)
        if not isinstance(name, str):
            raise self.error("arm", "executor", f"must be one of {', '.join(EXECUTORS.members)}")
        if not self.made("arm", own_class, name):
            kind = self.made("arm", EXECUTORS.resolve, name)
            self.made("arm", build, kind.config_type, options, name)
        return ArmSettings(name, options)

    def check_values(self) -> None:
        """Refuse what a type does not say: numbers that are not finite, control characters."""
        for section, content in self.data.items():
            for key, given in content.items() if isinstance(content, dict) else ():
                for value in _flat(given):
                    if isinstance(value, float) and not math.isfinite(value):
                        raise self.error(section, key, "must be finite")
                    if isinstance(value, str) and plain(value) != value:
                        raise self.error(section, key, "must hold no control characters")

    def explained(self, message: str) -> ConfigurationError:
        """What msgspec found wrong, with its place."""
        problem, _, path = message.partition(" - at `$")
        place = re.findall(r"\.(\w+)", path)
        if lacking := re.search(r"required field `(.*)`", problem):
            problem = "missing; add it, `prior-reinforce new` shows how"
            place += [lacking[1]]
        elif unknown := re.search(r"unknown field `(.*)`", problem):
            kind = next((f.type for f in structs.fields(_File) if [f.name] == place), _File)
            known = ", ".join(sorted(f.encode_name for f in structs.fields(kind)))
            problem = f"unknown; {'keys' if place else 'sections'} are {known}"
            place += [unknown[1]]
        else:
            problem = f"{problem[0].lower()}{problem[1:]}; mend it, `prior-reinforce new` shows how"
        section, key, *_ = (*place, None)
        return self.error(str(section), key, problem)

    def limits(self, robot: _Robot, task: str) -> RobotLimits | None:
        """Limits of the robot's model; None where there is none."""
        if robot.model != "given":
            for key in self.data["robot"]:
                if key not in ("model", "firmware", "arm"):
                    raise self.error("robot", key, 'goes with model = "given"; take it out')
            return None if robot.model == "none" else robot_limits(robot.model, robot.firmware)
        missing = [key for key in _REQUIRED if getattr(robot, key) is None]
        if missing:
            also = f" (and {', '.join(missing[1:])})" if missing[1:] else ""
            raise self.error(
                "robot", missing[0], f"missing{also}; add it, `prior-reinforce new` shows how"
            )
        for key, largest in _LARGEST_PLAUSIBLE.items():
            if np.abs(getattr(robot, key)).max() > largest:
                raise self.error("robot", key, "looks like degrees; give radians")
        given = {key: getattr(robot, key) for key in ("joint_names", *_LISTS)}
        source, chain = robot.source or str(self.path), self.chain(robot)
        return RobotLimits(task, firmware="as given", source=source, chain=chain, **given)

    def chain(self, robot: _Robot) -> Chain | None:
        """Kinematics that are given."""
        if robot.kinematics is None:
            if robot.flange is not None:
                raise self.error(
                    "robot", "flange", "goes with kinematics; add them, or take it out"
                )
            return None
        rows = np.array(robot.kinematics)
        lengths = np.linalg.norm(rows[:, 6:], axis=1)
        if np.any(np.abs(lengths - 1) > _LENGTH_OF_AXIS):
            raise self.error("robot", "kinematics", "axes (the last three) must have length 1")
        axes = [(x, y, z) for x, y, z in (rows[:, 6:] / lengths[:, None]).tolist()]
        origins = tuple(row[:6] for row in robot.kinematics)
        return Chain(origins, tuple(axes), robot.flange or (0.0,) * 6)

    def check_joints(self, form: PlanFormat, robot: RobotLimits, gate: GateSettings) -> None:
        """Refuse a plan format that lacks joints of the robot: nothing of them would be checked."""
        columns = self.made("plan", match_joints, form, robot)
        missing = self.made("gate", missing_joints, columns, robot, gate.absent_joints)
        if missing:
            raise self.error(
                "plan",
                "names",
                f"lacks {', '.join(missing)} of {robot.robot}, whose limits could then not be "
                "checked; give the joints these names (`import --joints` takes the recorded "
                "ones), name those that stay still in [gate] absent_joints, or choose "
                '[robot] model = "none"',
            )

    def made(self, section: str, make: Callable[..., T], *args: Any, **settings: Any) -> T:
        """What is made of a section; where it stands, if it cannot be."""
        try:
            return make(*args, **settings)
        except PriorReinforceError as error:
            if str(self.path) in str(error):
                raise
            raise self.error(section, None, str(error)) from error

    def error(self, section: str, key: str | None, problem: str) -> ConfigurationError:
        """One line on a wrong value: file, line, value, problem and remedy."""
        content = self.data.get(section)
        value = content.get(key) if isinstance(content, dict) and key is not None else None
        shown = "" if value is None else f" = {value!r}"
        where = f"[{section}]" if key is None else f"[{section}] {key}{shown}"
        line = self.line(section, key)
        place = f"{self.path}:{line}" if line else f"{self.path}"
        return ConfigurationError(f"{place}: {where}: {problem}")

    def line(self, section: str, key: str | None) -> int | None:
        """Line of a key, of its section's head where the key is not there, from 1."""
        name = re.escape(section if key is None else key)
        wanted = re.compile(rf"\s*\"?{name}\"?\s*=")
        inside, found = False, None
        for number, line in enumerate(self.text.splitlines(), start=1):
            if header := re.match(r"\s*\[\s*([\w-]+)\s*\]", line):
                inside = header[1] == section
                found = number if inside else found
            elif (inside or key is None) and wanted.match(line):
                return number
        return found


def _flat(value: Any) -> list[Any]:
    """All that lists within lists hold."""
    return [x for each in value for x in _flat(each)] if isinstance(value, list) else [value]
