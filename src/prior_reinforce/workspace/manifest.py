"""The manifest of a workspace: a commented TOML file that a person writes and can read.

Every message names the file, the line, the value and the remedy.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import ConfigurationError, FileFormatError, PriorReinforceError
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.robots import (
    GateSettings,
    RobotLimits,
    match_joints,
    missing_joints,
    robot_limits,
)
from prior_reinforce.workspace.manifest_template import TEMPLATE  # noqa: F401

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MANIFEST_FILE = "workspace.toml"
# Ours: every throw within a metre would count as reached, and no swing is told a frame a second.
_IMPLAUSIBLE_METRES = 1.0
_IMPLAUSIBLE_SECONDS = 1.0

_SECTIONS: Mapping[str, frozenset[str]] = {
    "task": frozenset({"name"}),
    "plan": frozenset({"names", "units", "dt"}),
    "outcome": frozenset({"names", "units", "tolerance"}),
    "robot": frozenset(
        {
            "model",
            "firmware",
            "joint_names",
            "lower",
            "upper",
            "velocity",
            "acceleration",
            "jerk",
        }
    ),
    "gate": frozenset(GateSettings.__dataclass_fields__),
}


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


def load_manifest(path: Path) -> Manifest:
    """Read and check a manifest.

    Raises:
        FileFormatError: The file is missing or is no TOML.
        ConfigurationError: A value is missing, unknown, of the wrong kind, or out of range.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileFormatError(
            f"no manifest at {path} ({error.strerror}); make a workspace with: prior-reinforce new"
        ) from error
    except ValueError as error:
        raise FileFormatError(f"{path} is not a text in UTF-8: {error}; save it as one") from error
    return parse_manifest(text, path)


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


class _Reader:
    """Reads values, and says where a wrong one stands."""

    def __init__(self, path: Path, text: str, data: dict[str, Any]) -> None:
        self._path = path
        self._lines = text.splitlines()
        self._data = data

    def manifest(self) -> Manifest:
        """Everything, checked."""
        for section, content in self._data.items():
            if section not in _SECTIONS:
                raise self._error(section, None, f"unknown; sections are {', '.join(_SECTIONS)}")
            if not isinstance(content, dict):
                raise self._error(section, None, f"must be a section, [{section}]")
            for key in content:
                if key not in _SECTIONS[section]:
                    raise self._error(
                        section, key, f"unknown; keys are {', '.join(sorted(_SECTIONS[section]))}"
                    )
        outcome_names = self._texts("outcome", "names")
        outcome_units = self._texts("outcome", "units")
        if len(outcome_names) != len(outcome_units):
            raise self._error(
                "outcome", "units", f"must name one unit for each of {list(outcome_names)}"
            )
        tolerance = self._number("outcome", "tolerance")
        if tolerance <= 0:
            raise self._error("outcome", "tolerance", "must be more than 0")
        if set(outcome_units) == {"m"} and tolerance >= _IMPLAUSIBLE_METRES:
            raise self._error("outcome", "tolerance", "looks like centimetres; give metres")
        name = self._text("task", "name")
        if not name.strip():
            raise self._error("task", "name", "must not be empty")
        manifest = Manifest(
            name=name,
            format=self._checked("plan", self._format),
            outcome_names=outcome_names,
            outcome_units=outcome_units,
            tolerance=tolerance,
            robot=self._checked("robot", self._robot),
            gate=self._checked("gate", self._gate),
        )
        if manifest.robot is not None:
            self._check_joints(manifest, manifest.robot)
        return manifest

    def _format(self) -> PlanFormat:
        dt = self._number("plan", "dt")
        if dt > _IMPLAUSIBLE_SECONDS:
            raise self._error("plan", "dt", "looks like milliseconds or a rate; give seconds")
        return PlanFormat(self._texts("plan", "names"), self._texts("plan", "units"), dt)

    def _robot(self) -> RobotLimits | None:
        model = self._text("robot", "model")
        if model == "none":
            return None
        if model != "given":
            has_firmware = "firmware" in self._data["robot"]
            return robot_limits(model, self._text("robot", "firmware") if has_firmware else "any")
        return RobotLimits(
            robot=self._text("task", "name"),
            firmware="as given",
            source=str(self._path),
            joint_names=self._texts("robot", "joint_names"),
            lower=np.array(self._numbers("robot", "lower")),
            upper=np.array(self._numbers("robot", "upper")),
            velocity=np.array(self._numbers("robot", "velocity")),
            acceleration=np.array(self._numbers("robot", "acceleration")),
            jerk=np.array(self._numbers("robot", "jerk")),
        )

    def _gate(self) -> GateSettings:
        content = dict(self._data.get("gate", {}))
        for key, value in content.items():
            if key == "absent_joints":
                content[key] = self._texts("gate", key)
            elif isinstance(value, list):
                content[key] = tuple(self._numbers("gate", key))
            else:
                content[key] = self._number("gate", key)
        return GateSettings(**content)

    def _check_joints(self, manifest: Manifest, robot: RobotLimits) -> None:
        """Refuse a plan format that lacks joints of the robot: nothing of them would be checked."""
        columns = self._checked("plan", lambda: match_joints(manifest.format, robot))
        absent = manifest.gate.absent_joints
        missing = self._checked("gate", lambda: missing_joints(columns, robot, absent))
        if missing:
            raise self._error(
                "plan",
                "names",
                f"lacks {', '.join(missing)} of {robot.robot}, whose limits could then not be "
                "checked; give the joints these names (`import --joints` takes the recorded "
                "ones), name those that stay still in [gate] absent_joints, or choose "
                '[robot] model = "none"',
            )

    def _checked(self, section: str, read: Any) -> Any:
        """Call a reader; say where a value stands that it finds to be wrong."""
        try:
            return read()
        except PriorReinforceError as error:
            if str(self._path) in str(error):
                raise
            raise self._error(section, None, str(error)) from error

    def _value(self, section: str, key: str) -> Any:
        content = self._data.get(section)
        if content is None or key not in content:
            raise self._error(section, key, "missing; add it, `prior-reinforce new` shows how")
        return content[key]

    def _text(self, section: str, key: str) -> str:
        value = self._value(section, key)
        if not isinstance(value, str):
            raise self._error(section, key, "must be a text in quotes")
        return value

    def _texts(self, section: str, key: str) -> tuple[str, ...]:
        value = self._value(section, key)
        if not isinstance(value, list) or not value or not all(isinstance(v, str) for v in value):
            raise self._error(section, key, 'must be a list of texts, such as ["x", "y"]')
        return tuple(value)

    def _number(self, section: str, key: str) -> float:
        value = self._value(section, key)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self._error(section, key, "must be a number")
        if not math.isfinite(value):
            raise self._error(section, key, "must be finite")
        return float(value)

    def _numbers(self, section: str, key: str) -> list[float]:
        value = self._value(section, key)
        numbers = isinstance(value, list) and all(
            isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v)
            for v in value
        )
        if not numbers:
            raise self._error(section, key, "must be a list of finite numbers")
        return [float(v) for v in value]

    def _error(self, section: str, key: str | None, problem: str) -> ConfigurationError:
        content = self._data.get(section)
        value = content.get(key) if isinstance(content, dict) and key is not None else None
        shown = "" if value is None else f" = {value!r}"
        where = f"[{section}]" if key is None else f"[{section}] {key}{shown}"
        line = self._line(section, key)
        place = f"{self._path}:{line}" if line else f"{self._path}"
        return ConfigurationError(f"{place}: {where}: {problem}")

    def _line(self, section: str, key: str | None) -> int | None:
        """Line of a key, of its section's head where the key is not there, from 1."""
        name = re.escape(section if key is None else key)
        wanted = re.compile(rf"\s*\"?{name}\"?\s*=")
        inside = False
        found = None
        for number, line in enumerate(self._lines, start=1):
            header = re.match(r"\s*\[\s*([\w-]+)\s*\]", line)
            if header:
                inside = header[1] == section
                found = number if inside else found
            elif (inside or key is None) and wanted.match(line):
                return number
        return found
