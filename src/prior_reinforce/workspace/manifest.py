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
from prior_reinforce.feedback import WORDS
from prior_reinforce.motions import PlanFormat
from prior_reinforce.robots import GateSettings, RobotLimits, robot_limits

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MANIFEST_FILE = "workspace.toml"
# Ours: every throw within a metre would count as reached, and no swing is told a frame a second.
_IMPLAUSIBLE_METRES = 1.0
_IMPLAUSIBLE_SECONDS = 1.0

TEMPLATE = """\
# A task for Prior Reinforce. Lengths are metres, angles radians, times seconds.

[task]
name = "{name}"

# What one frame of a plan means; dt is the time between two frames.
[plan]
names = {names}
units = {units}
dt = {dt}

# Where the object ends, measured in the table frame: x points from the robot's base over the
# table, y to its left. A goal is reached within the tolerance.
[outcome]
names = {outcome_names}
units = {outcome_units}
tolerance = {tolerance}

# Every plan is held against these limits before it is handed out. The model is "panda", "fr3",
# "given" (with the lists below, one number a joint) or "none". The firmware is that of an FR3's
# system image: ">=5.9", "<5.9" or "any".
[robot]
model = "{robot}"
firmware = "any"
# joint_names = ["joint1", "joint2"]
# lower = [-2.0, -2.0]            # [rad]
# upper = [2.0, 2.0]              # [rad]
# velocity = [2.0, 2.0]           # [rad/s]
# acceleration = [10.0, 10.0]     # [rad/s^2]
# jerk = [5000.0, 5000.0]         # [rad/s^3]

# The program's own lines beside the robot's; all optional.
[gate]
# tool_tip = [0.0, 0.0, 0.1]         # tool tip in the flange's frame [m]
# workspace_low = [0.2, -0.6, 0.0]   # box that the tool tip must stay in [m], base frame
# workspace_high = [0.9, 0.6, 1.2]
# beyond_refuse = 0.5                # how far beyond the demonstrations refuses, in joint ranges
"""

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

    @property
    def in_words(self) -> bool:
        """Whether the words of `feedback` (long, left, high) describe this task's outcomes."""
        return len(self.outcome_names) <= len(WORDS) and set(self.outcome_units) == {"m"}


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
        return Manifest(
            name=name,
            format=self._checked("plan", self._format),
            outcome_names=outcome_names,
            outcome_units=outcome_units,
            tolerance=tolerance,
            robot=self._checked("robot", self._robot),
            gate=self._checked("gate", self._gate),
        )

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
            if isinstance(value, list):
                content[key] = tuple(self._numbers("gate", key))
            else:
                content[key] = self._number("gate", key)
        return GateSettings(**content)

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
