"""Universal Robots' e-Series through ur_rtde's servo loop, as joint positions at 500 Hz.

Set points are indexed by the controller's time stamps, as the FR3's are: what a busy computer did
not send in time is left out, and the controller's `servoj` smooths over it. `servoj` lags its set
points; `lag` sends them ahead by as much, so that what is measured is the plan.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.executing.base import (
    START_TOLERANCE,
    ArmDescription,
    Executor,
    MeasuredPath,
)
from prior_reinforce.arm.executing.result import lag_behind
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.plan_files import resample_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError, RobotLimitError
from prior_reinforce.plans.interpolation import interp_columns, interpolate
from prior_reinforce.plans.motions import Plan
from prior_reinforce.settings import Checked

if TYPE_CHECKING:
    import rtde_control

_RATE = 500.0
"""Cycles of an e-Series controller a second."""
_STATES = ["timestamp", "actual_q", "robot_mode", "safety_mode", "runtime_state"]
_RUNNING, _NORMAL, _PLAYING = 7, 1, 2
"""Robot mode, safety mode and runtime state of Universal Robots' RTDE guide."""
_SAFETY_MODES = {2: "reduced mode", 3: "a protective stop", 5: "a safeguard stop"}
_SILENCE = 0.5
"""Without a new state or set point, in [s], after which either end gives up: this one, and the
controller's watchdog, which stops the program. Ours: an arm is at its last set point by then."""
_HOLD = 0.3
"""How long the last pose is held before the motion is said to have ended, in [s]: the arm comes to
rest in it. Ours, beyond five times the lag."""
_POLL = 1e-4


@dataclass(frozen=True)
class URConfig(Checked):
    """`[arm]` with `executor = "ur"`."""

    host: str
    """Address of the robot's controller."""
    model: Literal["ur5e", "ur10e"] = "ur5e"
    """Whose limits hold."""
    lookahead: Annotated[float, msgspec.Meta(ge=0.03, le=0.2)] = 0.03
    """Time over which `servoj` smooths set points, in [s]; its least."""
    gain: Annotated[float, msgspec.Meta(ge=100, le=2000)] = 300.0
    """`servoj`'s proportional gain; that of ur_rtde's own example."""
    lag: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    """How far behind its set points the arm is at constant speed, in [s]; said after a motion."""


class UR(Executor):
    """A UR5e or UR10e in remote control."""

    config_type = URConfig

    def __init__(self, config: URConfig) -> None:
        """Connect to its state only: no program is started before a motion."""
        import rtde_receive

        self._config, self._stopping = config, False
        self._limits = robot_limits(config.model)
        try:
            self._state = rtde_receive.RTDEReceiveInterface(config.host, _RATE, _STATES)
        except RuntimeError as error:
            raise ConfigurationError(
                f"cannot reach the robot at {config.host} ({error}); switch it on, and see that "
                "this is its address and RTDE is not disabled in its security settings"
            ) from error

    def describe(self) -> ArmDescription:
        """See `Executor`."""
        return ArmDescription(
            model=self._config.model,
            firmware="",
            columns=self._limits.joint_names,
            units=("rad",) * 6,
            rate=_RATE,
            checked=("position", "velocity", "rest"),
            unchecked=("acceleration", "torque", "payload", "self-collision", "the table"),
        )

    def where(self) -> Float[np.ndarray, "6"]:
        """See `Executor`: what its encoders measure."""
        safety = self._state.getSafetyMode()
        if safety != _NORMAL:
            why = _SAFETY_MODES.get(safety, f"safety mode {safety}")
        elif self._state.getRobotMode() != _RUNNING:
            why = f"robot mode {self._state.getRobotMode()}, not {_RUNNING} (brakes released)"
        elif self._state.getRuntimeState() == _PLAYING:
            why = "another program, which runs; stop it on the teach pendant"
        else:
            return np.array(self._state.getActualQ())
        raise ConfigurationError(
            f"the robot cannot move, it is in {why}; see to it, then ask again"
        )

    def check(self, plan: Plan) -> None:
        """See `Executor`: the plan as it is sampled, and the set points that run ahead of it.

        `servoj` smooths the set points, so that only their positions and velocities count.
        """
        check_plan(resample_plan(plan, _RATE), self._limits).require()
        ahead = Plan(self._set_points(plan)[1], replace(plan.format, dt=1 / _RATE))
        lines = check_plan(ahead, self._limits).lines
        for line in lines:
            if line.check in ("position", "velocity") and line.status == "refuse":
                raise RobotLimitError(
                    f"set points that run {self._config.lag:g} s ahead of the plan: {line.check}: "
                    f"{line.text}; set a smaller lag in [arm], or choose another goal"
                )

    def _set_points(self, plan: Plan) -> tuple[Float[np.ndarray, " T"], Float[np.ndarray, "T 6"]]:
        """Times and set points, ahead of the plan by the lag."""
        lag = self._config.lag
        fine = interpolate(plan.actions, plan.format.dt, rate=_RATE, hold_after=_HOLD + 5 * lag)
        return fine.t, fine.q + lag * fine.dq

    def run(self, plan: Plan) -> MeasuredPath:
        """See `Executor`: uploads ur_rtde's program, servoes, and ends the program."""
        import rtde_control

        before = self.where()
        if (far := np.abs(before - plan.actions[0]).max()) > START_TOLERANCE:
            return MeasuredPath.of([], 6, f"it stands {far:.4f} rad off the plan", moved=False)
        times, goals = self._set_points(plan)
        rows: list[tuple[float, list[float]]] = []
        try:
            control = rtde_control.RTDEControlInterface(self._config.host)
        except RuntimeError as error:
            return MeasuredPath.of([], 6, str(error), moved=False)
        try:
            control.setWatchdog(1 / _SILENCE)
            fault = self._servo(control, goals.tolist(), rows)
            if not control.servoStop() and not fault:
                fault = self._why()
            after = np.array(self._state.getActualQ())
            control.stopScript()
        except RuntimeError as error:  # the watchdog brings the arm to rest
            return MeasuredPath.of(rows, 6, f"the robot does not answer: {error}")
        finally:
            control.disconnect()
        path = MeasuredPath.of(rows, 6, fault)
        if not fault and rows:
            behind = lag_behind(path.t, interp_columns(path.t, times, goals), path.q)
            print(f"the arm followed its set points {behind * 1e3:.0f} ms behind", flush=True)
        return replace(path, moved=path.left(before, after))

    def _servo(
        self,
        control: rtde_control.RTDEControlInterface,
        goals: list[list[float]],
        rows: list[tuple[float, list[float]]],
    ) -> str:
        """Send set points by the controller's clock, and note where it is; why it ended early.

        RuntimeError if the connection is lost.
        """
        state, config = self._state, self._config
        start, last, heard = math.inf, state.getTimestamp(), time.monotonic()
        while not self._stopping:
            t, q = state.getTimestamp(), state.getActualQ()
            if t == last or state.getTimestamp() != t:  # nothing new, or of two cycles
                # Nothing may be asked of ur_rtde then: it waits for an answer for minutes.
                if time.monotonic() > heard + _SILENCE or not state.isConnected():
                    raise RuntimeError("no state came any more")
                time.sleep(_POLL)
                continue
            last, heard, start = t, time.monotonic(), min(start, t)
            k = round((t - start) * _RATE)
            rows.append((k / _RATE, q))
            if k >= len(goals):
                return ""
            if not control.servoJ(goals[k], 0, 0, 1 / _RATE, config.lookahead, config.gain):
                return self._why()
        return "stopped on request"

    def _why(self) -> str:
        """Why the controller takes no set points any more."""
        mode = self._state.getSafetyMode()
        if mode != _NORMAL:
            return f"it is in {_SAFETY_MODES.get(mode, f'safety mode {mode}')}"
        return "its program was stopped"

    def stop(self) -> None:
        """See `Executor`: the controller brakes the arm."""
        self._stopping = True

    def close(self) -> None:
        """Disconnect."""
        self._state.disconnect()
