"""The manifest of a workspace: a commented TOML file that a person writes and can read.

Every message names the file, the line, the value and the remedy.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta, Struct, structs

from prior_reinforce.arm.executing import EXECUTORS
from prior_reinforce.arm.executing.base import ArmSettings
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import RobotLimits, match_joints, missing_joints, with_turns
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.workspace.declared import DeclaredSymmetry
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    PriorReinforceError,
)
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.interpolation import RATE
from prior_reinforce.plans.kinematics import Chain, Pose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry
from prior_reinforce.registry import build
from prior_reinforce.settings import tomllib
from prior_reinforce.terminal import plain

T = TypeVar("T")
MANIFEST_FILE = "workspace.toml"
UNKNOWN = ("?",)
"""Action names where the arm is not known yet: the first import replaces them by the recorded."""
# Ours: no motion is sampled at 1 Hz.
_IMPLAUSIBLE_SECONDS = 1.0


@dataclass(frozen=True)
class Manifest:
    """What a workspace is about."""

    name: str
    """Name of the task."""
    format: PlanFormat
    """What a frame of a plan means."""
    outcome_format: OutcomeFormat
    """What the k numbers of an outcome mean, with the tolerance."""
    robot: RobotLimits | None
    """Limits that every plan is held against; None where the manifest says `none`."""
    gate: GateSettings
    """The gate's own lines."""
    arm: str = ""
    """Name of the arm, where this computer moves several: one motion at a time is made on each."""
    driven_by: ArmSettings | None = None
    """What drives it, for `ask --execute`; None where the manifest does not say."""
    symmetry: DeclaredSymmetry | None = None
    """How motions may be moved; None where the manifest does not say."""

    def declared(self, form: PlanFormat) -> Symmetry | None:
        """Return the symmetry of plans of a format, if one is declared.

        ConfigurationError if such plans cannot be moved so.
        """
        if self.symmetry is None:
            return None
        return self.symmetry.symmetry(form, self.outcome_format, self.robot)

    def check_fit(self, demonstrations: Demonstrations, source: str, path: Path) -> None:
        """Do nothing if demonstrations mean what this manifest, which stands at `path`, says.

        InvalidDemonstrationsError if they do not.
        """
        form, expected = demonstrations.format, self.format
        outcomes = demonstrations.outcome_format
        for what, given, wanted in (
            ("action names", form.names, expected.names),
            ("action units", form.units, expected.units),
            ("outcome names", outcomes.names, self.outcome_format.names),
            ("outcome units", outcomes.units, self.outcome_format.units),
            # A picosecond is rounding; anything more is another tempo.
            ("dt", round(form.dt, 12), round(expected.dt, 12)),
        ):
            if given != wanted:
                raise InvalidDemonstrationsError(
                    f"{source} has {what} {given}, but {path} says "
                    f"{wanted}; change the manifest, or import again"
                )
        if demonstrations.symmetry is not None and demonstrations.symmetry.rival is not None:
            raise InvalidDemonstrationsError(
                f"{source} states a rival of its symmetry, and the gate compares plans by one; "
                "leave it out: with_symmetry(dataclasses.replace(symmetry, rival=None))"
            )
        if not self.agrees(demonstrations):
            raise InvalidDemonstrationsError(
                f"[symmetry] of {path} is another one than when {source} was learned from; run: "
                "prior-reinforce learn"
            )

    def agrees(self, demonstrations: Demonstrations, *, in_range: bool = False) -> bool:
        """Whether demonstrations carry the symmetry that is declared, where one is.

        With `in_range` also the joints' ranges of now, which a person may narrow between trials.
        """
        declared, carried = self.declared(demonstrations.format), demonstrations.symmetry
        if declared is None or carried is None:
            return declared is None
        declared = declared.around(demonstrations.outcomes_seen)
        return declared == carried if in_range else declared.endless == carried.endless


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
    held: dict[str, float] = {}
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
    vlm: dict[str, Any] | None = None
    symmetry: DeclaredSymmetry | None = None


LIMIT_LISTS = ("lower", "upper", "velocity", "acceleration", "jerk")
_REQUIRED = ("joint_names", "lower", "upper", "velocity")
"""Keys that an arm needs whose numbers stand in the manifest."""
_LARGEST_PLAUSIBLE = {"lower": 13.0, "upper": 13.0, "velocity": 50.0}
"""In [rad] and [rad/s]; ours: two turns either way, and twice what the fastest small joints do."""
_LENGTH_OF_AXIS = 1e-3
"""By how much an axis may differ from length 1: three written digits."""


def workspace_around(folder: Path, *, above: bool = True) -> Path | None:
    """Return the workspace that a folder is, or is in, relative to it; None where it is in none.

    Folders `above` it count as far as they have the same owner: what somebody else put into a
    shared folder is nobody's workspace.
    """
    owner = folder.stat().st_uid if above else None
    for up in ("", *([".."] * len(folder.resolve().parts) if above else ())):
        folder = folder / up
        if above and folder.stat().st_uid != owner:
            return None
        if os.path.isfile(folder / MANIFEST_FILE):  # False for a name that is too long
            return folder
    return None


def read_text(path: Path) -> str:
    """Read a manifest's text; FileFormatError if the file is missing, or is no text."""
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

    FileFormatError if it is no TOML; ConfigurationError if a value is missing, unknown, of the
    wrong kind, or out of range.
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
        outcomes = self.made("outcome", OutcomeFormat(names, units).within, outcome.tolerance)
        form = self.made("plan", PlanFormat, plan.names, plan.units, plan.dt)
        limits = self.made("robot", self.limits, robot, task)
        gate = self.made("gate", GateSettings, **structs.asdict(file.gate))
        if unknown := {name for name, *_ in gate.ranges} - {*form.names}:
            named = f"names {', '.join(sorted(unknown))}, and plans have {', '.join(form.names)}"
            raise self.error("gate", "ranges", f"{named}; correct it")
        if limits is not None:
            self.check_joints(form, limits, gate)
        form = with_turns(form, limits)
        if gate.box_low is not None and (limits is None or limits.chain is None):
            why = "with no robot there is no tool tip to check; take it out, or name the robot"
            if limits is not None:
                why = (
                    f"cannot be checked, since the kinematics of {limits.robot} are not known; "
                    "take it out, or make the workspace with: prior-reinforce new --robot "
                    "path/to/arm.urdf"
                )
            raise self.error("gate", _BOX["box_low"], why)
        arm = self.driven_by(file.arm)
        made = Manifest(task, form, outcomes, limits, gate, robot.arm, arm, file.symmetry)
        if form.names != UNKNOWN:
            self.made("symmetry", made.declared, form)
        moved = file.symmetry
        boxed = gate.box_low is not None or limits is None or limits.chain is None
        if moved is not None and moved.turns and not (moved.no_box or boxed):
            why = (
                "a turned motion sweeps other parts of the room: give the tool tip's box in [gate] "
            )
            why += f"({', '.join(_BOX.values())}; `new --box`), or no_box = true here (`--no-box`)"
            raise self.error("symmetry", "object", why)
        return made

    def driven_by(self, arm: dict[str, Any] | None) -> ArmSettings | None:
        """What drives the arm."""
        if arm is None:
            return None
        options = dict(arm)
        name = options.pop("executor", None)
        if not isinstance(name, str):
            raise self.error("arm", "executor", f"must be one of {', '.join(EXECUTORS.members)}")
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
            kinds = {f.name: f.type for f in structs.fields(_File)} | {"symmetry": DeclaredSymmetry}
            kind = kinds[place[0]] if place else _File
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
        given = {key: getattr(robot, key) for key in ("joint_names", *LIMIT_LISTS)}
        source, chain = robot.source or str(self.path), self.chain(robot)
        return RobotLimits(
            task, firmware="as given", source=source, chain=chain, held=robot.held, **given
        )

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
    """All that lists and tables within each other hold."""
    value = [*value, *value.values()] if isinstance(value, dict) else value
    return [x for each in value for x in _flat(each)] if isinstance(value, list) else [value]
