"""The program that lets an executor move an arm: what the supervisor runs for `ask --execute`.

    python -m prior_reinforce.arm.executing.drive REQUEST PLAN RESULT

Once for all executors: a plan's columns become the arm's, where it stands is compared with the
plan's first frame, the arm's limits are asked for, and a slow approach, a rehearsal and a trial are
made as plans of the same kind. RESULT is the folder for what came of it: `result.json` and
`executed.npz`, as any driver writes them, or `look.json` where nothing was to move.
"""

from __future__ import annotations

import math
import shlex
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.executing import EXECUTORS
from prior_reinforce.arm.executing.base import (
    ArmDescription,
    ArmSettings,
    Executor,
    Guiding,
    MeasuredPath,
    Motion,
    begin_at,
)
from prior_reinforce.arm.executing.result import (
    NOT_MOVED_STATUS,
    PATH_FILE,
    RESULT_FILE,
    DriverResult,
)
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import RobotLimits, joint_of, with_turns
from prior_reinforce.arm.robots.plan_files import read_plan
from prior_reinforce.arm.robots.presets import PRESETS
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidPlanError,
    PriorReinforceError,
    RobotLimitError,
)
from prior_reinforce.extras import missing_extra
from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.registry import build
from prior_reinforce.units import Kind, in_unit

LOOK_FILE = "look.json"
_SLOW: Mapping[Kind, float] = {"angle": 0.3, "length": 0.1, "share": 0.5}
"""Largest speed of an approach, in [rad/s], [m/s] and [1/s]. Ours: a ninth of what the slowest
joints of an FR3 do, at which a person steps back in time."""
_WAY = "the way from where the arm stands to the plan's first frame"
_PLAN = "the plan from where the arm stands"
_APPROACH_DT, _SHORTEST = 0.02, 0.5
"""Between frames of an approach, and its shortest duration, in [s]."""
_START_TOLERANCE: Mapping[Kind, float] = {"angle": 0.002, "length": 0.0005, "share": 0.005}
"""Distance from the first frame, in [rad], [m] and [1], up to which a plan is made to begin where
the arm stands (`begin_at`); from farther off, the arm goes to the first frame slowly. Ours: what a
servo at rest is off."""


class Request(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked of the program."""

    arm: ArmSettings
    gate: GateSettings
    """How far the arm may stand from the plan's first frame, and the box for its tool tip."""
    motion: Motion | Literal["look"]
    speed: float = 1.0
    """Share of the plan's own speed."""
    limits: RobotLimits | None = None
    """Of the workspace's robot; the way to the plan's first frame is held against them too."""
    stood: dict[str, float] = {}
    """Where each of the arm's channels stood when a person was asked (`Look.pose`); empty where
    nobody looked."""


class Look(msgspec.Struct, frozen=True):
    """`look.json`: the arm before anything moves."""

    arm: ArmDescription
    pose: dict[str, float]
    """Where each of its channels stands."""
    there: bool
    """Whether that is near enough to the plan's first frame."""
    said: str
    """How near, in words."""
    approach: float
    """How long a slow approach takes, in [s]."""
    refused: str = ""
    """Why this arm refuses the plan; empty if it does not."""
    approach_refused: str = ""
    """Why the gate refuses the slow approach."""


def drive_command(request: Request) -> str:
    """The command that fulfils a request, with `{plan}` and `{result}` to be filled in."""
    text = msgspec.json.encode(request, enc_hook=lambda array: array.tolist()).decode()
    return f"{shlex.join([*program(__name__), text])} {{plan}} {{result}}"


def program(module: str) -> list[str]:
    """Program and arguments that call a module's `main`, which reads what is added to them."""
    # Without the folder that the user happens to stand in: nothing there may be taken for a module.
    start = f"import sys; sys.path[:] = filter(None, sys.path); import {module}; {module}.main()"
    return [sys.executable, "-c", start]


def read_look(folder: Path) -> Look:
    """Read `look.json`; FileFormatError if the program did not write it."""
    try:
        return msgspec.json.decode((folder / LOOK_FILE).read_bytes(), type=Look)
    except (OSError, ValueError) as error:
        raise FileFormatError(f"the arm's executor said nothing ({error}); ask again") from error


def make_executor(settings: ArmSettings) -> Executor:
    """Connect to an arm.

    ConfigurationError if there is no such executor or setting, or the arm does not answer;
    MissingExtraError if its library is not installed.
    """
    kind, config = _class_and_config(settings)
    try:
        return kind(config)
    except ImportError as error:
        raise missing_extra(error) or error from error


def guiding_of(settings: ArmSettings) -> Guiding:
    """What being guided would do to an arm; it is not connected to.

    ConfigurationError if there is no such executor or setting.
    """
    kind, config = _class_and_config(settings)
    return kind.guiding(config)


def _class_and_config(settings: ArmSettings) -> tuple[type[Executor], Any]:
    kind = EXECUTORS.resolve(settings.executor)
    return kind, build(kind.config_type, settings.options, f"[arm] {settings.executor}")


def arms_columns(form: PlanFormat, arm: ArmDescription) -> list[int]:
    """The arm's channel for each of a plan's columns.

    InvalidPlanError if a column is no channel of the arm, is in another unit, or two are one.
    """
    channels = []
    for name, unit in zip(form.names, form.units, strict=True):
        own = arm.columns
        channel = own.index(name) if name in own else joint_of(name, own)
        if channel is None or arm.units[channel] != unit:
            has = ", ".join(map("{} [{}]".format, arm.columns, arm.units))
            raise InvalidPlanError(
                f"{arm.model} has no channel for {name} [{unit}]; it has {has}: name [plan]'s "
                "columns so"
            )
        channels.append(channel)
    if len(set(channels)) < len(channels):
        raise InvalidPlanError(f"two of {form.names} are one channel of {arm.model}; drop one")
    return channels


def approach(
    pose: Float[np.ndarray, " d"], first: Float[np.ndarray, " d"], arm: ArmDescription
) -> Plan:
    """The slow way from one pose to another: a minimum-jerk motion of all channels together.

    InvalidPlanError if a channel is to move in a unit in which no slow speed is known.
    """
    far = np.abs(first - pose)
    duration = _SHORTEST
    for unit, distance in zip(arm.units, far, strict=True):
        speed = in_unit(_SLOW, unit)
        if distance > 0 and speed is None:
            raise InvalidPlanError(
                f"no slow speed is known in {unit}; move the arm to the plan's first frame"
            )
        # A minimum-jerk motion's peak is 15/8 of its mean speed.
        duration = max(duration, 15 / 8 * float(distance) / (speed or 1.0))
    n = math.ceil(duration / _APPROACH_DT)
    s = np.arange(n + 1)[:, None] / n
    frames = pose + minimum_jerk(s) * (first - pose)
    return Plan(frames, PlanFormat(arm.columns, arm.units, _APPROACH_DT))


def say_distance(
    off: Float[np.ndarray, " D"],
    form: PlanFormat,
    settings: GateSettings,
    place: str = "the start pose",
) -> tuple[str, bool]:
    """Say what is off most in each unit from a place, and whether all is near enough to it.

    `settings` allow so much (`errors_of`); a unit of which they say nothing is named, and must not
    be off at all.
    """
    worst: dict[str, tuple[float, str]] = {}
    off = np.nan_to_num(off, nan=np.inf, posinf=np.inf)  # what is no number may be anywhere
    for name, unit, distance in zip(form.names, form.units, off.tolist(), strict=True):
        worst[unit] = max((distance, name), worst.get(unit, (0.0, name)))
    said, there = [], True
    for unit, (distance, name) in worst.items():
        allowed = settings.errors_of(unit)
        seen = round(distance, 4)  # what is less is a rounding error or an encoder's noise
        text = f"{seen:.3g} {unit} ({name}) from {place}"
        if allowed is None:
            text += f", which is held against nothing: add {unit} to errors in [gate]"
            there = there and seen == 0
        elif distance > allowed[0]:
            text, there = f"{text}; {allowed[0]:g} is allowed", False
        said.append(text)
    return f"the arm is {', '.join(said)}", there


def _pose(executor: Executor, arm: ArmDescription) -> Float[np.ndarray, " d"]:
    """Return an arm's pose as floats: a plan that is written into whole numbers is rounded.

    ConfigurationError if it does not give a finite number for each of its channels.
    """
    pose = np.asarray(executor.where(), dtype=np.float64)
    if pose.shape != (len(arm.columns),):
        raise ConfigurationError(
            f"{arm.model} must say where each of {', '.join(arm.columns)} stands, got {pose}"
        )
    if missing := [n for n, q in zip(arm.columns, pose, strict=True) if not math.isfinite(q)]:
        raise ConfigurationError(f"{arm.model} does not say where {', '.join(missing)} stands")
    return pose


class _Prepared:
    """A plan in an arm's columns, and how the arm stands to it; nothing moves here."""

    def __init__(self, executor: Executor, plan: Plan, request: Request) -> None:
        self._executor, self._request, self._form = executor, request, plan.format
        arm = executor.describe()
        pose = _pose(executor, arm)
        robot = arm.model if request.limits is None else request.limits.robot
        if arm.model != robot and {arm.model, robot} <= {*PRESETS}:
            raise ConfigurationError(
                f"the arm is driven as a {arm.model}, but the robot in workspace.toml is {robot}: "
                "name the same one in [robot] and in [arm]"
            )
        self.arm, self._pose, self.channels = arm, pose, arms_columns(plan.format, arm)
        """The arm, where it stands, and its channel of each of the plan's columns."""
        self._turns = form = with_turns(plan.format, request.limits)
        plan = Plan(form.toward(plan.actions, pose[self.channels]), form)
        frames = np.tile(pose, (plan.horizon, 1))
        frames[:, self.channels] = plan.actions
        own = PlanFormat(arm.columns, arm.units, plan.format.dt / request.speed)
        self.plan = Plan(frames, own)
        """Channels that the plan leaves out are held where they stand."""
        off = np.abs(pose[self.channels] - plan.actions[0])
        self._said, self._there = say_distance(off, plan.format, request.gate)

    @property
    def to_start(self) -> Plan:
        return approach(self._pose, self.plan.actions[0], self.arm)

    @property
    def near(self) -> bool:
        """Whether the plan can begin where the arm stands."""
        far = np.abs(self.plan.actions[0] - self._pose)
        return bool(
            np.all(far <= [in_unit(_START_TOLERANCE, unit) or 0.0 for unit in self.arm.units])
        )

    @property
    def from_here(self) -> Plan:
        """The plan as it is sent: from where the arm stands, if that is near."""
        return begin_at(self.plan, self._pose) if self.near else self.plan

    def check(self, name: str, motion: Plan) -> None:
        """Hold a motion against the arm and, in the plan's own columns, the gate, box and all.

        RobotLimitError, which begins with its name, if it is refused.
        """
        self._executor.check(motion)
        if self._request.limits is None:
            return
        own = Plan(motion.actions[:, self.channels], replace(self._form, dt=motion.format.dt))
        refused = check_plan(own, self._request.limits, settings=self._request.gate).refusals
        if refused:
            raise RobotLimitError(
                f"{name}: {refused}; move it nearer by hand or with its own program, then ask again"
            )

    def motions(self) -> dict[str, Plan]:
        """What is to be executed, one after the other, by name; limits hold for all of it."""
        self._require_unmoved()
        if self._request.motion == "approach":
            return {_WAY: self.to_start}
        if not self._there:
            raise ConfigurationError(f"{self._said}; move it there, or ask again with --approach")
        whole = {_PLAN: self.from_here}
        return whole if self.near else {_WAY: self.to_start, **whole}

    def _require_unmoved(self) -> None:
        """Refuse a motion if the arm was moved since a person was asked about it.

        An approach begins where it stood; a plan begins at its own first frame, and holds the
        channels that it leaves out. ConfigurationError says what is elsewhere.
        """
        stood, form = self._request.stood, self.plan.format
        if not stood:
            return
        if stood.keys() != {*form.names}:
            raise ConfigurationError("a person was asked about another arm: ask again")
        was, gate = np.array([stood[name] for name in form.names]), self._request.gate
        here = self._pose[self.channels]
        was[self.channels] = self._turns.toward(was[None, self.channels], here)[0]
        off = np.abs(was - self._pose)
        if self._request.motion != "approach":
            off[self.channels] = 0.0
        off[[gate.errors_of(unit) is None for unit in form.units]] = 0.0
        said, same = say_distance(off, form, gate, "where it stood when a person was asked")
        if not same:
            raise ConfigurationError(f"{said}: ask again")

    def look(self) -> Look:
        """How the arm stands to the plan."""

        def refusal(check: Callable[[], None]) -> str:
            try:
                check()
            except PriorReinforceError as error:
                return str(error)
            return ""

        return Look(
            arm=self.arm,
            pose=dict(zip(self.arm.columns, self._pose.tolist(), strict=True)),
            there=self._there,
            said=self._said,
            approach=float(self.to_start.times[-1]),
            refused=refusal(lambda: self.check(_PLAN, self.from_here)),
            approach_refused=refusal(lambda: self.check(_WAY, self.to_start)),
        )


def _keep(path: MeasuredPath, prepared: _Prepared, folder: Path) -> str:
    """Write the measured path in the plan's columns; return why that failed, or an empty text.

    A failure raises nothing: the motion was made, whatever its executor says of it.
    """
    d, arm = len(prepared.arm.columns), prepared.arm.model
    try:
        t, q = np.asarray(path.t, dtype=np.float64), np.asarray(path.q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        return f"what {arm} measured is not kept, since it holds no numbers ({error})"
    if t.size == q.size == 0:
        return ""  # nothing was measured
    if t.ndim != 1 or q.shape != (len(t), d):
        return (
            f"what {arm} measured is not kept: t must be (T,) and q (T, {d}), got {t.shape} and "
            f"{q.shape}"
        )
    if not (np.isfinite(t).all() and np.isfinite(q).all()):
        return f"what {arm} measured is not kept, since not all of it is finite"
    try:
        np.savez(folder / PATH_FILE, t=t, q=q[:, prepared.channels])
    except OSError as error:
        return f"what {arm} measured is not kept: {error}"
    return ""


def _close(executor: Executor) -> str:
    """Let go of the arm; return why that failed, or an empty text."""
    try:
        executor.close()
    except Exception as error:
        return f"it was not let go: {error!r}"
    return ""


def drive(request: Request, plan: Plan, folder: Path) -> DriverResult:
    """Make one motion, or look; write what came of it."""
    executor: Executor | None = None
    asked_to_stop = moved = False

    def stop(*_: object) -> None:
        nonlocal asked_to_stop
        asked_to_stop = True
        if executor is not None:
            executor.stop()

    signal.signal(signal.SIGTERM, stop)  # whenever it comes
    try:
        executor = make_executor(request.arm)
        try:
            prepared = _Prepared(executor, plan, request)
            if request.motion == "look":
                (folder / LOOK_FILE).write_bytes(msgspec.json.encode(prepared.look()))
                return DriverResult("done")
            motions = prepared.motions()
            for name, motion in motions.items():
                prepared.check(name, motion)
            for motion in motions.values():
                if asked_to_stop:
                    raise ConfigurationError("it was asked to stop before it moved; ask again")
                print(f"{prepared.arm.model} moves for {motion.times[-1]:.2f} s", flush=True)
                moved_before, moved = moved, True  # whatever happens now, it may have
                path = executor.run(motion)
                moved = moved_before or path.moved
                if path.fault:
                    break
            last = motion is [*motions.values()][-1]
            not_kept = _keep(path, prepared, folder) if last else ""
        finally:
            not_closed = _close(executor)
    except Exception as error:
        why = str(error) if isinstance(error, PriorReinforceError) else repr(error)
        result = DriverResult("aborted" if moved else "not_moved", why)
    else:
        outcome: Any = "done" if not path.fault else "aborted" if moved else "not_moved"
        result = DriverResult(outcome, "; ".join(filter(None, [path.fault, not_kept, not_closed])))
    (folder / RESULT_FILE).write_bytes(msgspec.json.encode(result))
    return result


def main() -> None:
    """Fulfil the request of the command line."""
    request = msgspec.json.decode(
        sys.argv[1], type=Request, dec_hook=lambda _, numbers: np.array(numbers)
    )
    result = drive(request, read_plan(sys.argv[2]), Path(sys.argv[3]))
    if result.reason:
        print(result.reason, file=sys.stderr)
    statuses = {"done": 0, "not_moved": NOT_MOVED_STATUS}
    sys.exit(statuses.get(result.outcome, 1))


if __name__ == "__main__":
    main()
