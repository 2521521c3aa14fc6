"""A simulated SO-101 behind the bus of its servos, on a pseudo-terminal.

LeRobot's own class drives it by that port. Physics, servos and ball are those of the task `so101`,
where the same plan without a bus lands likewise. The ball is put back into the scoop whenever the
arm stands still and the scoop opens upwards. Without torque the arm
stays where it is, or a hand guides it through demonstrations, one after the other.
"""

from __future__ import annotations

import json
import math
import os
import select
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.environment import Rollout
from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.panda import STEP, setpoints
from prior_reinforce.simulation.tasks.panda_task import first_descent
from prior_reinforce.simulation.tasks.so101 import (
    LAG,
    MOTORS,
    RIM_HEIGHT,
    SO101Shot,
    servo_lag,
    servo_speed,
)
from simulators.feetech import (
    GOAL_POSITION,
    HOMING_OFFSET,
    MAX_LIMIT,
    MIN_LIMIT,
    P_COEFFICIENT,
    PRESENT_POSITION,
    TORQUE_ENABLE,
    Servo,
    ServoBus,
)

_STEPS = 4095 / (2 * math.pi)
"""Steps of the encoder a radian, as LeRobot counts them."""
_GRIPPER = (2030, 3480)
"""Its closed and its open end, in steps; ours."""
_STILL, _STILL_FOR, _UPRIGHT = 0.02, 0.3, 0.95
"""The ball is put back once no joint was faster [rad/s] for so long [s], if the cosine of the
scoop's tilt is more. Ours."""
_SILENT = 0.5
"""A client that asks for nothing for so long has ended, in [s]; ours."""
_BETWEEN = 2.0
"""How long a hand takes from one throw to the next, and how long it waits there, in [s]. Ours."""


class SimulatedSO101:
    """The arm, its six servos and the ball; time passes in `advance`."""

    def __init__(
        self,
        demonstrations: Demonstrations | None = None,
        landed: Callable[[Rollout], None] = lambda rollout: None,
    ) -> None:
        """Stand in the zero of all joints.

        Args:
            demonstrations: Through which a hand guides the arm while it has no torque.
            landed: Called with where the ball came down, throw by throw.
        """
        self.task, self._landed = SO101Shot(), landed
        model = self.task.model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        limits = (2047 + np.round(model.jnt_range[:4] * _STEPS)).astype(int).tolist()
        ends = [*limits, (0, 4095), _GRIPPER]
        self.servos = {i: Servo(low, high) for i, (low, high) in enumerate(ends, start=1)}
        self._middle = np.array(ends[:5]).mean(axis=1)
        self._position = np.zeros(6)
        """Of each servo, in [rad] from the middle; of the gripper, from its closed end."""
        self._hand = np.empty((0, 5)) if demonstrations is None else _guided(demonstrations)
        self._guided, self._still, self._thrown = 0, 0.0, True  # the ball lies on the table
        self._remember()
        for servo in self.servos.values():
            servo.write_word(GOAL_POSITION, servo.word(PRESENT_POSITION))

    def advance(self, duration: float) -> None:
        """Let time pass, in [s]."""
        goals, torque = self._goals()
        lag = np.array([servo_lag(max(s.memory[P_COEFFICIENT], 1)) for s in self.servos.values()])
        for _ in range(round(duration / STEP)):
            speed = np.where(torque, servo_speed(goals, self._position, lag), 0.0)
            if not torque.any() and self._guided < len(self._hand):
                speed[:5] = (self._hand[self._guided] - self._position[:5]) / STEP
                self._guided += 1
            self._step(speed)
        self._remember()

    def _step(self, speed: Float[np.ndarray, "6"]) -> None:
        """One period of the servos."""
        data, ball = self._data, self.task.ball
        data.ctrl[:] = self._position[:5] + self.task.feed_forward * speed[:5]
        self._position += STEP * speed
        before = data.qpos[ball : ball + 3].copy()
        mujoco.mj_step(self.task.model, data)
        path = np.stack([before, data.qpos[ball : ball + 3]])
        if not self._thrown and (descent := first_descent(path, RIM_HEIGHT)) is not None:
            self._thrown = True
            self._landed(Rollout(descent[2], True))
        self._still = 0.0 if np.abs(speed).max() > _STILL else self._still + STEP
        if self._still > _STILL_FOR:
            self._put_back()

    @property
    def flying(self) -> bool:
        """Whether the ball has left the scoop and not come down yet."""
        return not self._thrown and self._away

    @property
    def _away(self) -> bool:
        ball, seat = self.task.ball, self._data.site("tool/seat")
        return bool(np.linalg.norm(self._data.qpos[ball : ball + 3] - seat.xpos) > 0.02)

    def _put_back(self) -> None:
        """A person puts the ball into a scoop that is empty and opens upwards."""
        data, seat, ball = self._data, self._data.site("tool/seat"), self.task.ball
        if self._away and seat.xmat[8] > _UPRIGHT:
            data.qpos[ball : ball + 3] = seat.xpos
            velocity = self.task.model.jnt_dofadr[self.task.model.joint("ball").id]
            data.qvel[velocity : velocity + 6] = 0.0
            self._thrown = False

    def _goals(self) -> tuple[Float[np.ndarray, "6"], Bool[np.ndarray, "6"]]:
        """Where each servo goes, in the units of its position, and whether it has torque."""
        servos = list(self.servos.values())
        steps = np.array([servo.goal for servo in servos], dtype=float)
        goals = np.append((steps[:5] - self._middle) / _STEPS, (steps[5] - _GRIPPER[0]) / _STEPS)
        return goals, np.array([servo.memory[TORQUE_ENABLE] == 1 for servo in servos])

    def _remember(self) -> None:
        """What the encoders say. A goal stays what it was given last, without torque too."""
        measured = self._data.qpos[:5] * _STEPS + self._middle
        steps = np.round(np.append(measured, self._position[5] * _STEPS + _GRIPPER[0]))
        for servo, value in zip(self.servos.values(), steps.astype(int), strict=True):
            servo.write_word(PRESENT_POSITION, int(value))

    def calibration(self) -> dict[str, dict[str, int]]:
        """What LeRobot's calibration wrote down of these servos: the content of its file."""
        names, servos = [*MOTORS, "gripper"], self.servos.values()
        return {
            motor: {
                "id": identity,
                "drive_mode": 0,
                "homing_offset": servo.word(HOMING_OFFSET),
                "range_min": servo.word(MIN_LIMIT),
                "range_max": servo.word(MAX_LIMIT),
            }
            for motor, identity, servo in zip(names, self.servos, servos, strict=True)
        }


def _guided(demonstrations: Demonstrations) -> Float[np.ndarray, "steps 5"]:
    """The hand's path at every period: to the first frame, a wait, the motion, and so on."""
    dt, wait = demonstrations.format.dt, round(_BETWEEN / STEP)
    n_steps = round(demonstrations.horizon * dt / STEP)
    motions, _ = setpoints(demonstrations.plans, dt, n_steps)
    path, here = [], np.zeros(5)
    share = minimum_jerk(np.arange(wait) / wait)[:, None]
    for motion in motions:
        path += [here + share * (motion[0] - here), np.tile(motion[0], (wait, 1)), motion]
        here = motion[-1]
    return np.vstack([*path, np.tile(here, (wait, 1))])


class Port:
    """A pseudo-terminal at which the arm answers, and a folder with all that LeRobot needs.

    In the folder: `port`, a link to the terminal, and `calibration/simulated.json`, which goes with
    `id = "simulated"`.
    """

    def __init__(
        self,
        arm: SimulatedSO101,
        folder: Path,
        *,
        lock_step: float | None = None,
        dies_after: int | None = None,
    ) -> None:
        """Open it.

        Args:
            arm: The arm.
            folder: Is made if it is not there.
            lock_step: Time passes by so much, in [s], whenever positions are read, and not
                otherwise: then the same motion always ends alike. None follows the clock.
            dies_after: The plug is pulled after so many goals.
        """
        self.arm, self._lock_step, self._left = arm, lock_step, dies_after
        self._bus = ServoBus(arm.servos, before_read=self._cycle, after_goals=self._count)
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path = os.ttyname(self._theirs)
        self._stopped = False
        (folder / "calibration").mkdir(parents=True, exist_ok=True)
        (folder / "port").unlink(missing_ok=True)
        (folder / "port").symlink_to(self.path)
        text = json.dumps(arm.calibration(), indent=4)
        (folder / "calibration" / "simulated.json").write_text(text)

    def serve(self) -> None:
        """Answer until `stop`, or until the plug is pulled."""
        then = heard = time.monotonic()
        while not self._stopped:
            readable, _, _ = select.select([self._ours], [], [], 0.002)
            now = time.monotonic()
            heard = now if readable else heard
            if self._lock_step is not None and now - heard > _SILENT and self.arm.flying:
                self.arm.advance(self._lock_step)  # what flies comes down, whoever looks
            if self._lock_step is None:
                whole = math.floor((now - then) / STEP)
                self.arm.advance(whole * STEP)
                then += whole * STEP
            if readable and (answer := self._bus.answer(os.read(self._ours, 4096))):
                os.write(self._ours, answer)
        for end in (self._ours, self._theirs):
            os.close(end)

    def stop(self) -> None:
        """End `serve`, and close the terminal as a pulled plug does."""
        self._stopped = True

    def _cycle(self) -> None:
        if self._lock_step is not None:
            self.arm.advance(self._lock_step)

    def _count(self) -> None:
        if self._left is not None:
            self._left -= 1
            self._stopped |= self._left <= 0


def serve(
    folder: Path,
    landed: Callable[[Rollout], None],
    *,
    hand: bool = False,
    leader: bool = False,
    lock_step: float | None = None,
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Serve a simulated arm until interrupted; with a leader, a second one in `leader`.

    Args:
        folder: For the ports and calibrations, as `Port`.
        landed: Called with where the ball came down, throw by throw.
        hand: A hand guides the arm, or its leader, through six throws.
        leader: Serve a leader arm too.
        lock_step: As `Port`.
        ready: Called when clients may connect.
    """
    throws = SO101Shot().demonstrations("A") if hand else None
    ports = [Port(SimulatedSO101(None if leader else throws, landed), folder, lock_step=lock_step)]
    if leader:
        ports.append(Port(SimulatedSO101(throws), folder / "leader", lock_step=lock_step))
    serving = [threading.Thread(target=port.serve) for port in ports]
    for thread in serving:
        thread.start()
    ready()
    try:
        for thread in serving:
            thread.join()
    finally:
        for port in ports:
            port.stop()


def manifest_section(folder: Path, *, leader: bool = False, lock_step: bool = False) -> str:
    """`[arm]` of a manifest for the arm of `serve`."""

    def device(kind: str, where: Path) -> str:
        at = where.resolve()
        return (
            f'{{ type = "so101_{kind}", id = "simulated", port = "{at}/port", '
            f'calibration_dir = "{at}/calibration" }}'
        )

    lines = ["[arm]", 'executor = "lerobot"', f"robot = {device('follower', folder)}"]
    if leader:
        lines += [f"leader = {device('leader', folder / 'leader')}", 'goals = "as planned"']
    lines.append(f"lag = {LAG:.3f}")
    if lock_step:
        lines.append('clock = "cycles"')
    return "\n".join(lines)
