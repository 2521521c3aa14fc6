"""The manifest of a workspace: a commented TOML file that a person writes and can read.

Every message names the file, the line, the value and the remedy.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import msgspec
import numpy as np

from prior_reinforce.bench.robots import (
    GateSettings,
    RobotLimits,
    match_joints,
    missing_joints,
    robot_limits,
)
from prior_reinforce.bench.robots.kinematics import Chain
from prior_reinforce.errors import ConfigurationError, FileFormatError, PriorReinforceError
from prior_reinforce.plans.interpolation import RATE
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.wording import plain

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")
MANIFEST_FILE = "workspace.toml"
TEMPLATE = Path(__file__).with_name("template.toml").read_text(encoding="utf-8")
"""The manifest that `new` writes, for `format` to fill in."""
# Ours: every throw within a metre would count as reached, and no swing is told a frame a second.
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
    tolerance: float
    """epsilon, in the outcome's units."""
    robot: RobotLimits | None
    """Limits that every plan is held against; None where the manifest says `none`."""
    gate: GateSettings
    """The gate's own lines."""


_TEXTS, _NUMBERS = tuple[str, ...], tuple[float, ...]
_ROWS = tuple[tuple[float, float, float, float, float, float, float, float, float], ...]
_SIX = tuple[float, float, float, float, float, float]
_REQUIRED = ("lower", "upper", "velocity")
_LISTS = (*_REQUIRED, "acceleration", "jerk")
_GIVEN = ("joint_names", *_LISTS, "kinematics", "flange", "source")
"""Keys that go with an arm whose numbers stand in the manifest."""
_LARGEST_PLAUSIBLE = {"lower": 13.0, "upper": 13.0, "velocity": 50.0}
"""In [rad] and [rad/s]; ours: two turns either way, and twice what the fastest small joints do."""
_LENGTH_OF_AXIS = 1e-3
"""By how much an axis may differ from length 1: three written digits."""
_BOX, _BOX_KEY = "box_", "workspace_"
"""How the two corners of the tool tip's box begin in `GateSettings` and in the file."""
_SECTIONS: Mapping[str, Mapping[str, Any]] = {
    "task": {"name": str},
    "plan": {"names": _TEXTS, "units": _TEXTS, "dt": float},
    "outcome": {"names": _TEXTS, "units": _TEXTS, "tolerance": float},
    "robot": {"model": str, "firmware": str, "joint_names": _TEXTS, "source": str}
    | dict.fromkeys(_LISTS, _NUMBERS)
    | {"kinematics": _ROWS, "flange": _SIX},
    "gate": {k.replace(_BOX, _BOX_KEY): v for k, v in get_type_hints(GateSettings).items()},
}
_WANTED = {
    str: "a text in quotes",
    float: "a number",
    _TEXTS: 'a list of texts, such as ["x", "y"]',
    _NUMBERS: "a list of finite numbers",
    _ROWS: "a list with nine finite numbers a joint: x, y, z, roll, pitch, yaw and the axis",
    _SIX: "six finite numbers: x, y, z, roll, pitch, yaw",
}


def filled_in(
    *,
    name: str,
    names: Sequence[str],
    units: Sequence[str],
    dt: float,
    outcome_names: Sequence[str],
    outcome_units: Sequence[str],
    tolerance: float,
    robot: str | RobotLimits,
) -> str:
    """Return a manifest's text, the template filled in.

    Args:
        name: Of the task.
        names: Of the action dimensions.
        units: Of the action dimensions.
        dt: Time between two frames of a plan, in [s].
        outcome_names: Of the outcome's components.
        outcome_units: Of the outcome's components.
        tolerance: In the outcome's units.
        robot: Name of a preset, `none`, or the limits of an arm, which are written out.
    """
    given = robot if isinstance(robot, RobotLimits) else None
    text = TEMPLATE.format(
        name=_quoted(name)[1:-1],
        names=_list(names),
        units=_list(units),
        dt=dt,
        outcome_names=_list(outcome_names),
        outcome_units=_list(outcome_units),
        tolerance=tolerance,
        robot="given" if given is not None else robot,
    )
    if given is None:
        return text
    start, end = text.index("# joint_names ="), text.index("# The program's own lines")
    return text[:start] + _written_out(given) + "\n" + text[end:]


def _written_out(robot: RobotLimits) -> str:
    """An arm's numbers as lines of the manifest."""
    lines = [f"source = {_quoted(robot.source)}", f"joint_names = {_list(robot.joint_names)}"]
    for key in _LISTS:
        values = getattr(robot, key)
        if values is None:
            lines.append(
                f"# {key} = []  # not published; the gate compares with the demonstrations"
            )
        else:
            lines.append(f"{key} = {[float(f'{v:.9g}') for v in values]}")
    if robot.chain is not None:
        lines.append(
            "# Of each joint: x, y, z [m], roll, pitch, yaw [rad] in the frame before, axis."
        )
        pairs = zip(robot.chain.origins, robot.chain.axes, strict=True)
        rows = [[float(f"{v:.12g}") for v in (*o, *a)] for o, a in pairs]
        lines += ["kinematics = [", *(f"  {row}," for row in rows), "]"]
        lines.append(f"flange = {[float(f'{v:.12g}') for v in robot.chain.flange]}")
    return "".join(f"{line}\n" for line in lines)


def _quoted(text: str) -> str:
    """A text in quotes, as TOML wants it: JSON's, but for one control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _list(values: Sequence[str]) -> str:
    return "[" + ", ".join(_quoted(value) for value in values) + "]"


def load_manifest(path: Path) -> Manifest:
    """Read and check a manifest.

    Raises:
        FileFormatError: The file is missing or is no TOML.
        ConfigurationError: A value is missing, unknown, of the wrong kind, or out of range.
    """
    return parse_manifest(read_manifest(path), path)


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
    return _Reader(path, text.splitlines(), data).manifest()


@dataclass(frozen=True)
class _Reader:
    """Reads sections, and says where a wrong value stands."""

    path: Path
    lines: list[str]
    data: dict[str, Any]

    def manifest(self) -> Manifest:
        """Everything, checked."""
        for section in self.data:
            if section not in _SECTIONS:
                raise self.error(section, None, f"unknown; sections are {', '.join(_SECTIONS)}")
        task, plan, outcome, robot, gate = map(self.section, _SECTIONS)
        if not task["name"].strip():
            raise self.error("task", "name", "must not be empty")
        if plan["dt"] > _IMPLAUSIBLE_SECONDS:
            raise self.error("plan", "dt", "looks like milliseconds or a rate; give seconds")
        if robot["model"] != "none" and plan["dt"] < (1 - 1e-9) / RATE:
            cycle = (
                f"is less than an arm's cycle of {1 / RATE:g} s, within which nothing is checked"
            )
            raise self.error("plan", "dt", f"{cycle}; give more")
        names, units, tolerance = outcome["names"], outcome["units"], outcome["tolerance"]
        if len(names) != len(units):
            raise self.error("outcome", "units", f"must name one unit for each of {list(names)}")
        if len(set(names)) < len(names):
            raise self.error("outcome", "names", "must differ from each other")
        if tolerance <= 0:
            raise self.error("outcome", "tolerance", "must be more than 0")
        if set(units) == {"m"} and tolerance >= _IMPLAUSIBLE_METRES:
            raise self.error("outcome", "tolerance", "looks like centimetres; give metres")
        form = self.made("plan", lambda: PlanFormat(**plan))
        limits = self.made("robot", lambda: self.limits(robot, task["name"]))
        gate = {key.replace(_BOX_KEY, _BOX): value for key, value in gate.items()}
        settings = self.made("gate", lambda: GateSettings(**gate))
        if limits is not None:
            self.check_joints(form, limits, settings)
        elif settings.box_low is not None:
            why = "with no robot there is no tool tip to check; take it out, or name the robot"
            raise self.error("gate", f"{_BOX_KEY}low", why)
        if limits is not None and limits.chain is None and settings.box_low is not None:
            why = (
                f"cannot be checked, since the kinematics of {limits.robot} are not known; take it "
                "out, or make the workspace with: prior-reinforce new --robot path/to/arm.urdf"
            )
            raise self.error("gate", f"{_BOX_KEY}low", why)
        return Manifest(task["name"], form, names, units, tolerance, limits, settings)

    def limits(self, robot: dict[str, Any], task: str) -> RobotLimits | None:
        """Limits of the robot's model; None where there is none."""
        if robot["model"] != "given":
            for key in _GIVEN:
                if key in robot:
                    raise self.error("robot", key, 'goes with model = "given"; take it out')
        if robot["model"] == "none":
            return None
        if robot["model"] != "given":
            return robot_limits(robot["model"], robot.get("firmware", "any"))
        missing = [key for key in ("joint_names", *_REQUIRED) if key not in robot]
        if missing:
            also = f" (and {', '.join(missing[1:])})" if missing[1:] else ""
            raise self.error(
                "robot", missing[0], f"missing{also}; add it, `prior-reinforce new` shows how"
            )
        for key, largest in _LARGEST_PLAUSIBLE.items():
            if np.abs(robot[key]).max() > largest:
                raise self.error("robot", key, "looks like degrees; give radians")
        numbers: dict[str, Any] = {k: np.array(robot[k]) for k in _LISTS if k in robot}
        return RobotLimits(
            robot=task,
            firmware="as given",
            source=robot.get("source", str(self.path)),
            joint_names=robot["joint_names"],
            chain=self.chain(robot),
            **numbers,
        )

    def chain(self, robot: dict[str, Any]) -> Chain | None:
        """Kinematics that are given."""
        if "kinematics" not in robot:
            if "flange" in robot:
                raise self.error(
                    "robot", "flange", "goes with kinematics; add them, or take it out"
                )
            return None
        rows = np.array(robot["kinematics"])
        lengths = np.linalg.norm(rows[:, 6:], axis=1)
        if np.any(np.abs(lengths - 1) > _LENGTH_OF_AXIS):
            raise self.error("robot", "kinematics", "axes (the last three) must have length 1")
        axes = [(x, y, z) for x, y, z in (rows[:, 6:] / lengths[:, None]).tolist()]
        origins = tuple(row[:6] for row in robot["kinematics"])
        return Chain(origins, tuple(axes), robot.get("flange", (0.0,) * 6))

    def check_joints(self, form: PlanFormat, robot: RobotLimits, gate: GateSettings) -> None:
        """Refuse a plan format that lacks joints of the robot: nothing of them would be checked."""
        columns = self.made("plan", lambda: match_joints(form, robot))
        missing = self.made("gate", lambda: missing_joints(columns, robot, gate.absent_joints))
        if missing:
            raise self.error(
                "plan",
                "names",
                f"lacks {', '.join(missing)} of {robot.robot}, whose limits could then not be "
                "checked; give the joints these names (`import --joints` takes the recorded "
                "ones), name those that stay still in [gate] absent_joints, or choose "
                '[robot] model = "none"',
            )

    def section(self, name: str) -> dict[str, Any]:
        """Values of one section, each of its type; numbers are finite."""
        content, types = self.data.get(name, {}), _SECTIONS[name]
        if not isinstance(content, dict):
            raise self.error(name, None, f"must be a section, [{name}]")
        for key in content:
            if key not in types:
                raise self.error(name, key, f"unknown; keys are {', '.join(sorted(types))}")
        required = {"robot": ["model"], "gate": []}.get(name, types)
        for key in required:
            if key not in content:
                raise self.error(name, key, "missing; add it, `prior-reinforce new` shows how")
        return {key: self.value(name, key, content[key], types[key]) for key in content}

    def value(self, section: str, key: str, given: Any, kind: Any) -> Any:
        """A value of the kind that is wanted; an empty list is of no kind."""
        wanted = _WANTED.get(kind, "a list of three finite numbers")
        try:
            value = msgspec.convert(given, kind)
        except msgspec.ValidationError:
            value = ()
        texts = (value,) if kind is str else value if kind == _TEXTS else ()
        if any(plain(text) != text for text in texts):
            raise self.error(section, key, "must hold no control characters")
        if value == ():
            raise self.error(section, key, f"must be {wanted}")
        if kind not in (str, _TEXTS) and not np.all(np.isfinite(value)):
            finite = "finite" if kind is float else wanted
            raise self.error(section, key, f"must be {finite}")
        return value

    def made(self, section: str, make: Callable[[], T]) -> T:
        """What a function makes of a section; where it finds a value wrong, say where it stands."""
        try:
            return make()
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
        inside = False
        found = None
        for number, line in enumerate(self.lines, start=1):
            header = re.match(r"\s*\[\s*([\w-]+)\s*\]", line)
            if header:
                inside = header[1] == section
                found = number if inside else found
            elif (inside or key is None) and wanted.match(line):
                return number
        return found
