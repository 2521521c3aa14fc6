"""Arms that LeRobot drives: the SO-101, and any other of its `Robot` interface.

LeRobot takes goals for its servos and follows them as fast as it can; it has no trajectories, and
checks little. So goals are sent at a fixed rate, each after the other, and what is measured comes
back with every one. Such servos lag: `lag` sends goals ahead by as much, so that what is measured
is the plan.
"""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.executing.base import (
    ArmDescription,
    Executor,
    GuidedState,
    Guiding,
    MeasuredPath,
)
from prior_reinforce.arm.executing.result import lag_behind
from prior_reinforce.arm.robots.plan_files import resample_plan
from prior_reinforce.errors import ConfigurationError, RobotLimitError
from prior_reinforce.plans.interpolation import interp_columns, interpolate
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.settings import Checked

_LARGEST_GAP = 0.1
"""What a goal that comes late may leave out of a joint's way, in [rad]; more ends the motion. Ours:
50 ms of a swing at 2 rad/s, which throws elsewhere; at rest or on a slow approach it is little."""
_LEFT_OUT = 0.002
"""By which goals at `rate` may make another motion of a joint than the plan's, in [rad]. Ours: what
a servo at rest is off."""
_PATH_TOLERANCE = 0.35
"""How far a joint may be from where it should, in [rad]. Ours: beyond 20 degrees it is blocked, or
lost its power."""
_CLIPPED = 1e-3
"""Difference of the goal that LeRobot sent from the one that was given, beyond which it clipped it,
in LeRobot's units (degrees, per cent)."""
_LEAST_TRAVEL = 0.2
"""Travel of a joint from which on a motion tells how much the arm lags, in [rad]. Ours: a hundred
steps of an SO-101's encoder."""
_SETTLE = 0.3
"""How long the last goal is held before the arm is let go, beyond five times the lag, in [s]."""
_UNITS = {"degrees": ("rad", math.pi / 180), "range_0_100": ("percent", 1.0)}
"""Our unit of LeRobot's, and its size in it."""


@dataclass(frozen=True)
class LeRobotConfig(Checked):
    """Settings of an arm that LeRobot drives."""

    robot: Mapping[str, Any]
    """LeRobot's own: `type`, `port`, `id` and what else its class has."""
    leader: Mapping[str, Any] = field(default_factory=dict)
    """Its teleoperator, to record with: `type`, `port`, `id`; none for an arm guided by hand."""
    python: str = sys.executable
    """A Python that has LeRobot."""
    rate: Annotated[float, msgspec.Meta(ge=1, le=1000)] = 100.0
    """Goals and measurements a second."""
    lag: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    """How far behind its goals the arm is at constant speed, in [s]."""
    goals: Literal["ahead", "as planned"] = "ahead"
    """Ahead of the plan by the lag, so that the measured motion is the plan; or the plan itself,
    where commanded motions were recorded: the measured motion is then later by the lag."""
    units: Mapping[str, str] = field(default_factory=dict)
    """LeRobot's unit by column, `degrees` or `range_0_100`, for a robot that does not say."""
    clock: Literal["wall", "cycles"] = "wall"
    """`cycles` is for a simulated arm whose time passes with every goal."""

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if "type" not in self.robot:
            raise ConfigurationError('robot needs LeRobot\'s type, as {type = "so101_follower"}')


class LeRobotArm(Executor):
    """An arm behind LeRobot's `Robot` interface, in a process of LeRobot's Python."""

    config_type = LeRobotConfig

    def __init__(self, config: LeRobotConfig) -> None:
        """Start LeRobot and connect; nothing moves."""
        self._config, self._stop = config, False
        bridge = Path(__file__).with_name("lerobot_bridge.py")
        settings = {"robot": dict(config.robot), "leader": dict(config.leader)}
        try:
            self._process = subprocess.Popen(
                [config.python, str(bridge), json.dumps(settings)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        except OSError as error:
            raise ConfigurationError(
                f"cannot start {config.python!r} ({error.strerror}); give the path of the Python "
                "in which LeRobot is installed as python in [arm]"
            ) from error
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        try:
            said = self._answer()
            self._columns = tuple(said["columns"])
            units = said["units"] | dict(config.units)
            for name in self._columns:
                if units.get(name) not in _UNITS:
                    raise ConfigurationError(
                        f"{name} is in {units.get(name, 'a unit that LeRobot does not say')}; set "
                        f"use_degrees = true in robot, or name it in units ({', '.join(_UNITS)})"
                    )
            self._units = tuple(_UNITS[units[name]][0] for name in self._columns)
            self._sizes = np.array([_UNITS[units[name]][1] for name in self._columns])
            # A gripper's per cent end at its range by their own meaning.
            half = [said["half_ranges"].get(n, math.inf) for n in self._columns]
            percent = np.array(self._units) == "percent"
            self._high = np.where(percent, 100.0, half * self._sizes)
            self._low = np.where(percent, 0.0, -self._high)
        except BaseException:
            self.close()
            raise

    def describe(self) -> ArmDescription:
        """See `Executor`."""
        return ArmDescription(
            model=str(self._config.robot["type"]),
            firmware="",
            columns=self._columns,
            units=self._units,
            rate=self._config.rate,
            checked=("the calibrated range of every joint", "how far off its path it goes"),
            unchecked=("torque", "temperature", "self-collision", "the table", "people"),
        )

    def where(self) -> Float[np.ndarray, " d"]:
        """See `Executor`."""
        return self._vector(self._ask("observe")["measured"])

    @classmethod
    def guiding(cls, config: LeRobotConfig) -> Guiding:
        """See `Executor`."""
        return "led" if config.leader else "let go"

    def guide(self) -> Iterator[GuidedState]:
        """See `Executor`: a leader leads the arm; without one, its torque is switched off."""
        self._ask("release")
        wall, period, start = self._config.clock == "wall", 1 / self._config.rate, time.monotonic()
        for cycle in itertools.count():
            if wall:
                time.sleep(max(0.0, start + cycle * period - time.monotonic()))
            said = self._ask("guide")
            measured = self._vector(said["measured"])
            commanded = self._vector(said["sent"]) if "sent" in said else measured
            t = time.monotonic() - start if wall else cycle * period
            yield GuidedState(t, commanded, measured)

    def check(self, plan: Plan) -> None:
        """See `Executor`: the goals, and that they come often enough to make the motion."""
        joints = [i for i, unit in enumerate(self._units) if unit == "rad"]
        form = plan.format
        of_joints = PlanFormat(
            tuple(form.names[i] for i in joints), ("rad",) * len(joints), form.dt
        )
        if joints:
            moved = Plan(plan.actions[:, joints], of_joints)
            resample_plan(moved, self._config.rate, within=_LEFT_OUT)
        _, goals = self._expected_and_goals(plan)
        for column, name in enumerate(self._columns):
            sent, low, high = goals[:, column], self._low[column], self._high[column]
            beyond = np.maximum(sent - high, low - sent)
            if beyond.max() > 0:
                raise RobotLimitError(
                    f"{name} would be sent to {sent[beyond.argmax()]:.4g} {self._units[column]}, "
                    f"beyond its calibrated range of {low:.4g} to {high:.4g}"
                )

    def _expected_and_goals(
        self, plan: Plan
    ) -> tuple[Float[np.ndarray, "T d"], Float[np.ndarray, "T d"]]:
        """Where the arm is expected, and what it is sent, at every cycle."""
        config = self._config
        settle = _SETTLE + 5 * config.lag
        fine = interpolate(plan.actions, plan.format.dt, rate=config.rate, hold_after=settle)
        if config.goals == "ahead":
            return fine.q, fine.q + config.lag * fine.dq
        return interp_columns(fine.t - config.lag, fine.t, fine.q), fine.q

    def run(self, plan: Plan) -> MeasuredPath:
        """See `Executor`."""
        expected, goals = self._expected_and_goals(plan)
        wall, period = self._config.clock == "wall", 1 / self._config.rate
        # What lags a plan on purpose is that plan, later.
        shift = self._config.lag if self._config.goals == "as planned" else 0.0
        joints = np.array(self._units) == "rad"
        rows: list[tuple[float, list[float]]] = []
        sent: list[int] = []
        fault, moved, cycle, start = "", False, 0, time.monotonic()
        try:
            while cycle < len(goals):
                due = cycle * period
                if wall:
                    time.sleep(max(0.0, start + due - time.monotonic()))
                    late = time.monotonic() - start - due
                    # What is overdue is left out: sent in a burst, the arm would jerk after it.
                    now = min(cycle + int(late / period), len(goals) - 1)
                    if np.any(np.abs(goals[now] - goals[cycle])[joints] > _LARGEST_GAP):
                        fault = f"a goal was {late * 1e3:.0f} ms late; the computer is too busy"
                    cycle = now
                if self._stop:
                    fault = "it was asked to stop"
                if fault:
                    break
                moved = True
                asked = self._named(goals[cycle])
                said = self._ask("move", goal=asked)
                here = self._vector(said["measured"])
                if not np.isfinite(here).all():  # nor is it known where to hold the arm then
                    name = self._columns[int(np.isfinite(here).argmin())]
                    fault = f"LeRobot does not say where {name} is"
                    break
                rows.append(((time.monotonic() - start if wall else due) - shift, here.tolist()))
                sent.append(cycle)
                worst = max(asked, key=lambda name: abs(said["sent"][name] - asked[name]))
                if abs(said["sent"][worst] - asked[worst]) > _CLIPPED:
                    fault = (
                        f"LeRobot sent {worst} {said['sent'][worst]:.4g} instead of "
                        f"{asked[worst]:.4g}; take max_relative_target out of robot"
                    )
                deviation = np.where(joints, np.abs(here - expected[cycle]), 0.0)
                if deviation.max() > _PATH_TOLERANCE:
                    name = self._columns[int(deviation.argmax())]
                    fault = f"{name} is {deviation.max():.2f} rad from where it should be"
                cycle += 1
            if fault and rows:  # held where it was seen last
                self._ask("move", goal=self._named(np.array(rows[-1][1])))
        except ConfigurationError as error:
            fault = str(error) if not fault else f"{fault}; {error}"
        path = MeasuredPath.of(rows, len(self._columns), fault, moved)
        if not fault and np.ptp(goals[:, joints], axis=0).max() > _LEAST_TRAVEL:
            behind = lag_behind(path.t, goals[sent][:, joints], path.q[:, joints])
            print(f"the arm followed its goals {behind * 1e3:.0f} ms behind", flush=True)
        return path

    def stop(self) -> None:
        """See `Executor`."""
        self._stop = True

    def close(self) -> None:
        """See `Executor`: the end of its input lets LeRobot let go."""
        self._requests.close()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._answers.close()

    def _vector(self, values: Mapping[str, float]) -> Float[np.ndarray, " d"]:
        """LeRobot's values as ours; one that is missing is no number."""
        return np.array([values.get(n, math.nan) for n in self._columns]) * self._sizes

    def _named(self, values: Float[np.ndarray, " d"]) -> dict[str, float]:
        """Ours as LeRobot's."""
        return dict(zip(self._columns, (values / self._sizes).tolist(), strict=True))

    def _ask(self, do: str, **given: Any) -> dict[str, Any]:
        with suppress(OSError):  # it has ended; its last answer says why
            print(json.dumps({"do": do, **given}), file=self._requests, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        """The next answer of LeRobot's process; ConfigurationError says what went wrong there."""
        line = self._answers.readline()
        if not line:
            raise ConfigurationError(
                f"LeRobot's process ended without a word; try {self._config.python} -c 'import "
                "lerobot.robots'"
            )
        said: dict[str, Any] = json.loads(line)
        if "error" in said:
            raise ConfigurationError(f"LeRobot: {said['error']}")
        return said
