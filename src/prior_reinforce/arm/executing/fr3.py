"""Franka Research 3 through libfranka's own Python client, as joint positions at 1 kHz.

The plan's spline is indexed by the robot's clock, not by this computer's: a cycle that was lost is
skipped, as the robot extrapolates over it, and none is made up for (measured on a loaded computer:
advancing by cycles instead asks for 294 rad/s^2 after 3 ms were lost).
"""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.executing.base import (
    GUIDED_RATE,
    START_TOLERANCE,
    ArmDescription,
    Executor,
    GuidedState,
    MeasuredPath,
    begin_at,
)
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.interpolation import RATE, interpolate
from prior_reinforce.plans.motions import Plan
from prior_reinforce.settings import Checked, Positive

if TYPE_CHECKING:
    import pylibfranka

_HOLD = 0.15
"""How long the last pose is held before the motion is said to have ended, in [s]: the arm comes to
rest in it. Ours; the simulated arm needs a tenth of it."""
_SAME = 1e-9
"""Distance of a joint that is rounding, in [rad]."""
_USUAL_THRESHOLDS = 20.0, 20.0
"""In [Nm] and [N]: `setDefaultBehavior` of libfranka's examples."""
_REALTIME = Path("/sys/kernel/realtime")
"""Says 1 on a kernel with PREEMPT_RT, which is what libfranka looks at."""


@dataclass(frozen=True)
class FR3Config(Checked):
    """`[arm]` with `executor = "fr3"`."""

    host: str
    """Address of the robot's controller."""
    firmware: str = "any"
    """Of its system image, `>=5.9` or `<5.9`; `any` holds plans against the narrower of both."""
    collision_thresholds: tuple[Positive, Positive] | None = None
    """External torque of any joint in [Nm], and force of the end effector in [N], at which the arm
    stops in a motion; libfranka's usual 20 are set after it, since what was set cannot be read.
    None leaves what is set. A fast swing with a tool that the robot does not know trips 20."""

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        robot_limits("fr3", self.firmware)


class FR3(Executor):
    """A Franka Research 3 whose FCI is active."""

    config_type = FR3Config

    def __init__(self, config: FR3Config) -> None:
        """Connect."""
        import pylibfranka

        self._lib, self._config, self._stopping = pylibfranka, config, False
        self._errors = pylibfranka.FrankaException, RuntimeError  # which its others derive from
        self._limits = robot_limits("fr3", config.firmware)
        self._enforced = _REALTIME.exists() and _REALTIME.read_text().strip() == "1"
        kinds = pylibfranka.RealtimeConfig
        try:
            kind = kinds.kEnforce if self._enforced else kinds.kIgnore
            self._robot = pylibfranka.Robot(config.host, kind)
        except self._errors as error:
            raise ConfigurationError(
                f"cannot reach the robot at {config.host} ({_line(error)}); unlock its joints, "
                "activate FCI in Desk, and see that no other program is connected"
            ) from error

    def describe(self) -> ArmDescription:
        """See `Executor`."""
        here = () if self._enforced else ("real time, which this computer's kernel does not give",)
        return ArmDescription(
            model="fr3",
            firmware=self._config.firmware,
            columns=self._limits.joint_names,
            units=("rad",) * 7,
            rate=RATE,
            checked=("position", "velocity at each position", "acceleration", "jerk", "rest"),
            unchecked=("torque", "self-collision", *here),
        )

    def where(self) -> Float[np.ndarray, "7"]:
        """The pose that the arm holds, q_d, from which a motion has to begin."""
        return np.array(self._ready().q_d)

    def check(self, plan: Plan) -> None:
        """Hold a plan against the limits of FR3's firmware, velocities where they depend on it."""
        check_plan(plan, self._limits).require()

    def run(self, plan: Plan) -> MeasuredPath:
        """Stream the plan as joint positions; an error is recovered from once, and named.

        The robot refuses set points that do not begin exactly at the pose that it holds; what is
        made of the plan for that is checked anew.
        """
        rows: list[tuple[float, list[float]]] = []
        state = self._ready()
        before, held = np.array(state.q), np.array(state.q_d)
        if (far := np.abs(held - plan.actions[0]).max()) > START_TOLERANCE:
            return MeasuredPath.of([], 7, f"it stands {far:.4f} rad off the plan", moved=False)
        sent = begin_at(plan, held)
        if far > _SAME and (refused := check_plan(sent, self._limits).refusals):
            return MeasuredPath.of([], 7, f"from where it stands, {refused}", moved=False)
        set_points = interpolate(sent.actions, sent.format.dt, hold_after=_HOLD).q
        gc.collect()
        gc.disable()  # a collection takes longer than a cycle
        try:
            self._set_collision_thresholds(self._config.collision_thresholds)
            fault = self._stream(set_points.tolist(), rows)
        except self._errors as error:
            fault = _line(error)
        finally:
            gc.enable()
        path = MeasuredPath.of(rows, 7, fault)
        try:
            after = np.array(self._recover().q)
            if self._config.collision_thresholds is not None:
                self._set_collision_thresholds(_USUAL_THRESHOLDS)
            return replace(path, moved=path.left(before, after))
        except self._errors as error:
            return replace(path, fault=f"{fault}; then {_line(error)}".removeprefix("; "))

    def _stream(self, set_points: list[list[float]], rows: list[tuple[float, list[float]]]) -> str:
        """Send set points by the robot's clock, and note where it is; why it ended early."""
        last, k = len(set_points) - 1, 0
        mode = self._lib.ControllerMode.JointImpedance
        control = self._robot.start_joint_position_control(mode)
        state, _ = control.readOnce()
        while not self._stopping:
            command = self._lib.JointPositions(set_points[k])
            command.motion_finished = k == last
            rows.append((k / RATE, state.q))
            control.writeOnce(command)
            if k == last:
                return ""
            state, passed = control.readOnce()
            k = min(k + round(passed.to_sec() * RATE), last)
        self._robot.stop()
        return "stopped on request"

    def _set_collision_thresholds(self, thresholds: tuple[float, float] | None) -> None:
        if thresholds is not None:
            torques, forces = [thresholds[0]] * 7, [thresholds[1]] * 6
            self._robot.set_collision_behavior(torques, torques, forces, forces)

    def stop(self) -> None:
        """See `Executor`: the robot brakes by itself."""
        self._stopping = True

    def guide(self) -> Iterator[GuidedState]:
        """What its joints measure, by its clock, in any mode: it is guided by its own buttons."""
        start = last = -math.inf
        while True:
            try:
                state = self._robot.read_once()
            except self._errors as error:
                raise ConfigurationError(f"the robot does not answer: {_line(error)}") from error
            t = state.time.to_sec()
            start = t if start == -math.inf else start
            if t - last > 1 / GUIDED_RATE - 0.5 / RATE:
                last, q = t, np.array(state.q)
                yield GuidedState(t - start, q, q)

    def close(self) -> None:
        """Disconnect: the robot takes one client at a time, and lets others wait without a word."""
        del self._robot

    def _ready(self) -> pylibfranka.RobotState:
        """The robot's state, after one recovery where an error was left; ConfigurationError."""
        modes = self._lib.RobotMode
        try:
            state = self._robot.read_once()
            if state.robot_mode == modes.Reflex:
                state = self._recover()
        except self._errors as error:
            raise ConfigurationError(f"the robot does not answer: {_line(error)}") from error
        if state.robot_mode != modes.Idle:
            why = f"it is in mode {state.robot_mode.name}"
            if state.robot_mode == modes.UserStopped:
                why = "its stop button is pressed"
            raise ConfigurationError(f"the robot cannot move, {why}; see to it, then ask again")
        return state

    def _recover(self) -> pylibfranka.RobotState:
        """Clear an error, once; nothing moves by it."""
        if self._robot.read_once().robot_mode == self._lib.RobotMode.Reflex:
            self._robot.automatic_error_recovery()
        return self._robot.read_once()


def _line(error: Any) -> str:
    """What libfranka says, in one line, without its own name."""
    return " ".join(str(error).split()).removeprefix("libfranka: ")
