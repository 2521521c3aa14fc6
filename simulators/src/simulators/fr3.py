"""A simulated FR3 that libfranka's clients connect to: franka-sim's strict server, our physics.

The server speaks the robot's protocol (FCI, version 10) and refuses what the robot refuses: limits
of position, velocity, acceleration and jerk, a wrong start pose, lost cycles. It steps in lock with
its client: a state goes out, the answer comes, physics makes one step. Run freely, as franka-sim
does by itself, its threads drift against the client's clock, and a throw lands elsewhere each time.

The arm is the Panda of our tasks, whose kinematics the FR3 shares; its masses and servo are the
Panda's. The server models no contact, torque or self-collision reflex.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from franka_sim import FrankaSimServer
from franka_sim.control_modes import ControlMode
from franka_sim.franka_protocol import RobotMode
from jaxtyping import Float

from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.simulation.tasks.panda import STEP
from prior_reinforce.simulation.tasks.panda_task import PandaTask
from simulators.stepped import SteppedTask

_ANSWER_WITHIN = 1.0
"""How long a state waits for its answer, in [s]; the cycle then counts as lost, and the motion is
aborted after 20 of them. Ours: the robot waits for 1 ms, which a shared computer cannot keep."""
_POLL = 2e-5
_FAST = 0.5
"""Commanded speed of any joint above which a motion is a throw, in [rad/s]; ours: approaches stay
below 0.3 rad/s."""


class SimulatedFR3:
    """The server, and the physics behind it as franka-sim expects a simulator to be."""

    enable_vis = False

    def __init__(self, task: PandaTask, host: str, ended: Callable[[Rollout], None]) -> None:
        """Put the arm where the task's first demonstration begins.

        Args:
            task: What stands before the arm.
            host: Address to serve on; the port is always 1337.
            ended: Called with what came of each motion that was fast enough to be a throw.

        Raises:
            ConfigurationError: Somebody else serves there, or the address is not this computer's.
        """
        self._ended = ended
        self.target: Float[np.ndarray, "7"] = task.demonstrations("A").plans[0, 0]
        """The last set point, in [rad]."""
        self._stepped = SteppedTask(task, self.target)
        self._after = round(task.lead_out / STEP)
        self._steps_left, self._fastest, self._in_motion = 0, 0.0, False
        self._stepping = threading.Lock()  # states of a connection, and what goes on without one
        self.running = False
        logging.getLogger("franka_sim").setLevel(logging.CRITICAL)
        self._ready: Callable[[], None] = lambda: None
        self._server = _LockStep(
            host=host,
            physics_sim=self,
            enable_gripper=False,
            enforce_motion_limits=True,
            enforce_comm_constraints=True,
        )

    def serve(self, ready: Callable[[], None]) -> None:
        """Serve until `running` is made false; `ready` is called when clients may connect."""
        self._ready = ready
        try:
            self._server.start()
        except OSError as error:
            raise ConfigurationError(
                f"cannot serve on {self._server.host} ({error.strerror}); stop what serves there, "
                "or give another --host, such as 127.0.77.2"
            ) from error
        finally:
            self._server.stop()

    def advance(self) -> None:
        """One cycle: physics follows the last set point."""
        with self._stepping:
            if self._server.states_sent == 0:  # of a new connection
                self._come_down()
            self._advance()

    def _come_down(self) -> None:
        """Let end what the last motion began, and put the objects back."""
        while self._steps_left and not self._in_motion:
            self._advance()

    def _advance(self) -> None:
        moving = self._server.robot_state.state["robot_mode"] == RobotMode.kMove
        if moving and not self._in_motion:
            self._stepped.begin()
            self._fastest, self._steps_left = 0.0, self._after
        self._in_motion = moving
        self._stepped.step(self.target)
        if not moving and self._steps_left:
            self._steps_left -= 1
            if not self._steps_left:
                rollout = self._stepped.end()
                if self._fastest > _FAST:
                    self._ended(rollout)
                self._stepped.load(self.target)

    # What franka-sim calls.

    def initialize_simulation(self) -> None:
        """Nothing is left to be made."""

    def start(self) -> None:
        """Go on where no client is connected: what flies comes down."""
        self.running = True
        self._ready()
        while self.running:
            with self._stepping:
                if not self._server.transmitting_state:
                    self._in_motion = False  # a client that left
                    self._come_down()
            time.sleep(0.01)

    def stop(self) -> None:
        """End `start`."""
        self.running = False

    def set_control_mode(self, mode: ControlMode) -> None:
        """Joint positions are all that is simulated."""
        if mode is not ControlMode.POSITION:
            raise NotImplementedError(f"the simulated FR3 takes joint positions, not {mode}")
        self._stepped.hold(self.target)

    def update_joint_positions(self, positions: Any) -> None:
        """Take a set point, in [rad]."""
        target = np.asarray(positions, dtype=float)
        self._fastest = max(self._fastest, float(np.abs(target - self.target).max()) / STEP)
        self.target = target

    def update_torques(self, torques: Any) -> None:
        """Torques are the servo's own."""

    def get_robot_state(self) -> dict[str, Float[np.ndarray, " ..."]]:
        """What the robot reports: the Cartesian pose is left out, since nobody here reads it."""
        q, dq = self._stepped.q, self._stepped.dq
        zeros = np.zeros(7)
        return {
            "q": q,
            "dq": dq,
            "ddq": zeros,
            "q_d": self.target,
            "dq_d": dq,
            "ddq_d": zeros,
            "tau_J": zeros,
        }


class _LockStep(FrankaSimServer):  # type: ignore[misc]  # publishes no types
    """One state, one answer, one step; and the arm holds what it was last told to, as a robot does.

    franka-sim holds what it measures, so that each motion would begin where the one before sagged.
    """

    def _switch_to_hold_position(self) -> None:
        self.physics_sim.set_control_mode(ControlMode.POSITION)
        self.control_mode = ControlMode.POSITION
        self._publish_hold_setpoint()

    def _publish_hold_setpoint(self, joint_positions: Any = None) -> Any:
        return super()._publish_hold_setpoint(self.physics_sim.target)

    def _drain_gate(self, answer_deadline: float = 0.0) -> float:
        start = time.perf_counter()
        while (
            self.connection_running
            and time.perf_counter() - start < _ANSWER_WITHIN
            and (self.comm.awaiting_answer or self._commands_in_flight)
        ):
            time.sleep(_POLL)
        self.physics_sim.advance()
        state = self.physics_sim.get_robot_state()
        owned = self._server_owned_state_fields
        self.robot_state.state.update({k: v for k, v in state.items() if k not in owned})
        if self.robot_state.state["robot_mode"] != RobotMode.kMove:
            self.robot_state.state["q_d"] = list(self.physics_sim.target)
        return time.perf_counter() - start
