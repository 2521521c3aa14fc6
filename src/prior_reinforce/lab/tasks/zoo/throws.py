"""Throws: an arm swings, something decides when the ball leaves, the ball flies."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.lab.tasks.zoo.base import ZooTask
from prior_reinforce.lab.tasks.zoo.human import Strategy, Submovement, reach_and_strike
from prior_reinforce.lab.tasks.zoo.physics import (
    GRAVITY,
    Arm,
    first_passage,
    flight,
    flight_in_air,
    landing,
    lift_off,
    moving,
    on_parabola,
)
from prior_reinforce.plans.motions import PlanFormat


def _joints(n: int) -> tuple[str, ...]:
    return tuple(f"joint{i + 1}" for i in range(n))


class Lob(ZooTask):
    """A seven-joint arm lets a ball go at a fixed frame, whatever the arm does then: a clock."""

    name = "zoo-lob"
    format = PlanFormat(_joints(7), ("rad",) * 7, 0.02)
    horizon = 75
    release = "the clock"
    tolerance = 0.015
    region = np.array([[1.00, -0.45], [1.80, 0.45]])
    slack = 0.12
    posture = (0.03, 0.05, 0.08, 0.05, 0.08, 0.05, 0.1)
    aim_range = ((-0.8, 0.8), (0.4, 1.3))
    arm = Arm(
        "zyzyzyz",
        (*((0.0, 0.0, z) for z in (0.25, 0.20, 0.18, 0.22, 0.14, 0.10)), (0.03, 0.0, 0.08)),
    )
    clock = 56
    """Frame at which the ball is let go."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back, then swing: shoulder first, or (style 1) more with elbow and wrist."""
        heading, swing = aims
        home = (0.0, -0.3, 0.0, 0.5, 0.0, 0.3, 0.0)
        wound = (heading, -0.9, 0.0, -0.5, 0.0, -0.4, 0.0)
        share = (1.1, 0.6, 0.4) if style == 0 else (0.75, 0.95, 0.75)
        shoulder, elbow, wrist = swing * np.array(share)
        struck = (heading, shoulder - 0.9, 0.0, elbow - 0.5, 0.0, wrist - 0.4, 0.0)
        return reach_and_strike(home, wound, struck, reach=0.6, strike=0.7, overlap=0.1)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        if len(plan) <= self.clock:
            return None
        hand = moving(self.arm.hand(plan), self.format.dt)
        time = self.clock * self.format.dt
        return landing(hand(time), hand(time, 1) * (1.0 + disturbed[0]))


class Scoop(ZooTask):
    """A ball lies in a scoop on a seven-joint arm, and leaves it when the hand decelerates."""

    name = "zoo-scoop"
    format = PlanFormat(_joints(7), ("rad",) * 7, 0.0125)
    horizon = 140
    release = "the hand's deceleration"
    tolerance = 0.012
    region = np.array([[1.10, -0.45], [1.90, 0.45]])
    bandwidth = 8.0
    posture = (0.02, 0.04, 0.05, 0.04, 0.05, 0.04, 0.03)
    aim_range = ((-0.8, 0.8), (0.35, 1.5))
    arm = Arm.straight("zyxyzyx", 0.30, 0.16, 0.16, 0.20, 0.10, 0.08, 0.15)

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lay the scoop back, then swing it over; in style 1 the wrist does more."""
        heading, swing = aims
        home = (0.0, -0.2, 0.0, -0.6, 0.0, -0.5, 0.0)
        wound = (heading, -0.5, 0.0, -0.5, 0.0, -0.35, 0.0)
        share = (1.0, 0.7, 0.3) if style == 0 else (0.6, 0.7, 0.9)
        shoulder, elbow, wrist = swing * np.array(share)
        struck = (heading, shoulder - 0.5, 0.0, elbow - 0.5, 0.0, wrist - 0.35, 0.0)
        return reach_and_strike(home, wound, struck, reach=0.45, strike=0.55)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        hand = moving(self.arm.hand(plan), self.format.dt)
        time = lift_off(hand, self.arm.direction(plan, (1.0, 0.0, 0.0)))
        if time is None:
            return None
        return landing(hand(time), hand(time, 1) * (1.0 + disturbed[0]))


class GripperThrow(ZooTask):
    """Three joints and a gripper, whose opening is a channel of the plan: k = 3."""

    name = "zoo-gripper"
    format = PlanFormat((*_joints(3), "gripper"), ("rad", "rad", "rad", "1"), 0.02)
    outcome_names = ("x", "y", "apex")
    outcome_units = ("m", "m", "m")
    horizon = 80
    release = "a gripper channel, opening in six frames"
    tolerance = 0.05
    region = np.array([[1.20, -0.30, 1.10], [1.60, 0.30, 1.18]])
    posture = (0.02, 0.04, 0.04, 0.0)
    aim_range = ((-0.4, 0.4), (1.2, 3.0), (-0.1, 0.45))
    arm = Arm.straight("zyy", 0.40, 0.30, 0.35)
    opening = 0.12
    """How long the gripper takes to open, six frames, in [s]."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back, swing, and open the gripper in the swing: early for a high throw."""
        heading, swing, late = aims
        home = (0.0, -0.2, 0.4, 0.0)
        wound = (heading, -0.8, -0.7, 0.0)
        share = (0.6, 0.8) if style == 0 else (0.9, 0.35)
        struck = (heading, -0.8 + swing * share[0], -0.7 + swing * share[1], 0.0)
        opens = Submovement(0.7 + 0.35 * late, self.opening, (0, 0, 0, 1.0), by_hardware=True)
        return reach_and_strike(home, wound, struck, 0.6, 0.6, more=(opens,))

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        time = first_passage(plan[:, 3], 0.5, self.format.dt)
        if time is None:
            return None
        hand = moving(self.arm.hand(plan[:, :3]), self.format.dt)
        start, velocity = hand(time), hand(time, 1) * (1.0 + disturbed[0])
        landed = flight(start, velocity)
        if landed is None:
            return None
        apex = start[2] + max(velocity[2], 0.0) ** 2 / (2.0 * GRAVITY)
        return np.append(landed[0][:2], apex)


class Latched(ZooTask):
    """A latch lets the ball go where the hand's lean, the sum of all pitches, passes an angle."""

    release = "a latch at an angle of the hand"
    arm: ClassVar[Arm]
    latch: ClassVar[float]
    """Lean of the hand at which the ball leaves, forwards from the vertical, in [rad]."""

    def _leaves(
        self, plan: Frames, faster: float
    ) -> tuple[float, Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None:
        """When the ball leaves, where, and how fast; None if the latch never opens."""
        pitches = np.array([axis == "y" for axis in self.arm.axes])
        time = first_passage(plan[:, pitches].sum(axis=1), self.latch, self.format.dt)
        if time is None:
            return None
        hand = moving(self.arm.hand(plan), self.format.dt)
        return time, hand(time), hand(time, 1) * (1.0 + faster)


class Bounce(Latched):
    """A ball that bounces once before it counts: where it comes down the second time."""

    name = "zoo-bounce"
    format = PlanFormat(_joints(4), ("rad",) * 4, 0.0125)
    horizon = 110
    tolerance = 0.012
    region = np.array([[1.20, -0.45], [2.00, 0.45]])
    bandwidth = 8.0
    posture = (0.02, 0.04, 0.05, 0.05)
    aim_range = ((-0.7, 0.7), (0.9, 2.6))
    arm = Arm.straight("zyyy", 0.35, 0.25, 0.25, 0.10)
    latch = -0.3
    restitution, slip = 0.65, 0.8
    """What a bounce leaves of the vertical speed, and of the horizontal [-]."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back and swing over; in style 1 the wrist does more."""
        heading, swing = aims
        share = (0.5, 0.3, 0.2) if style == 0 else (0.3, 0.3, 0.4)
        shoulder, elbow, wrist = swing * np.array(share)
        wound = (heading, -0.5, -0.4, -0.3)
        struck = (heading, shoulder - 0.5, elbow - 0.4, wrist - 0.3)
        return reach_and_strike((0.0, -0.3, -0.2, -0.1), wound, struck, 0.4, 0.5)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        left = self._leaves(plan, float(disturbed[0]))
        if left is None:
            return None
        _, start, velocity = left
        first = flight(start, velocity)
        if first is None:
            return None
        place, time = first
        down = velocity[2] - GRAVITY * time
        after = velocity * self.slip
        after[2] = -self.restitution * down
        return landing(np.array([*place[:2], 0.0]), after)


class Drag(Latched):
    """A light ball against the air, thrown by a planar arm of two links; k = 1, 40 frames."""

    name = "zoo-drag"
    format = PlanFormat(_joints(2), ("rad",) * 2, 0.025)
    outcome_names = ("x",)
    outcome_units = ("m",)
    horizon = 40
    tolerance = 0.0025
    region = np.array([[0.80], [2.00]])
    spread = (0.0005,)  # an even ball
    posture = (0.05, 0.06)
    aim_range = ((1.0, 3.2),)
    arm = Arm.straight("yy", 0.40, 0.35, base=0.5)
    latch = -0.5
    drag = 0.25
    """Deceleration over speed squared, in [1/m]; of a ball of paper."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Swing both joints; in style 1 the elbow follows with a whip."""
        swing = float(aims[0])
        share = (0.5, 0.5) if style == 0 else (0.25, 0.75)
        wound = (-0.8, -0.7)
        struck = (-0.8 + share[0] * swing, -0.7 + share[1] * swing)
        return reach_and_strike((-0.4, -0.4), wound, struck, 0.3, 0.45, 0.05)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        left = self._leaves(plan, float(disturbed[0]))
        landed = None if left is None else flight_in_air(left[1], left[2], self.drag)
        return None if landed is None else landed[:1]


class Arrival(Latched):
    """Where a ball lands, in metres, and when after the plan's start, in seconds."""

    name = "zoo-arrival"
    format = PlanFormat(_joints(3), ("rad",) * 3, 0.02)
    outcome_names = ("x", "arrival")
    outcome_units = ("m", "s")
    horizon = 90
    tolerance = (0.009, 0.009)
    region = np.array([[1.00, 1.45], [1.80, 1.85]])
    spread = (0.002, 0.003)
    """Relative error of the speed, and the delay until the arm moves, in [s]; ours."""
    slack = 0.1
    posture = (0.03, 0.04, 0.05)
    aim_range = ((1.1, 2.8), (0.0, 0.7))
    arm = Arm.straight("yyy", 0.35, 0.30, 0.15, base=0.3)
    latch = -0.4

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Swing, earlier or later; in style 1 with the wrist."""
        swing, early = aims
        share = (0.45, 0.35, 0.2) if style == 0 else (0.3, 0.3, 0.4)
        shoulder, elbow, wrist = swing * np.array(share)
        wound = (-0.6, -0.5, -0.2)
        struck = (shoulder - 0.6, elbow - 0.5, wrist - 0.2)
        swung = reach_and_strike((-0.3, -0.3, 0.0), wound, struck, 0.4, 0.5)
        return replace(swung, settle=float(early))

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> Point | None:
        left = self._leaves(plan, float(disturbed[0]))
        landed = None if left is None else flight(left[1], left[2])
        if left is None or landed is None:
            return None
        return np.array([landed[0][0], left[0] + landed[1] + disturbed[1]])


class Hoop(ZooTask):
    """Six joints of the usual industrial kind and a grip channel; through a window, k = 3."""

    name = "zoo-hoop"
    format = PlanFormat((*_joints(6), "grip"), (*("rad",) * 6, "1"), 0.02)
    outcome_names = ("y", "z", "flight")
    outcome_units = ("m", "m", "s")
    horizon = 100
    release = "a grip channel, let down in six frames"
    tolerance = (0.03, 0.03, 0.03)
    region = np.array([[-0.25, 0.65, 0.42], [0.25, 0.95, 0.52]])
    posture = (0.02, 0.03, 0.04, 0.04, 0.05, 0.05, 0.0)
    aim_range = ((-0.4, 0.4), (1.6, 3.4), (0.0, 0.5))
    arm = Arm(
        "zyyyzy",
        (
            (0.0, 0.13, 0.16),
            (0.0, -0.12, 0.43),
            (0.0, 0.0, 0.39),
            (0.0, 0.10, 0.0),
            (0.0, 0.0, 0.10),
            (0.0, 0.08, 0.10),
        ),
    )
    window = 1.5
    """The plane that it flies through stands at this x, in [m]."""
    opening = 0.12
    """How long the grip takes to open, six frames, in [s]."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Swing shoulder, elbow and wrist, and let go: early for a long flight."""
        heading, swing, late = aims
        share = (0.4, 0.35, 0.25) if style == 0 else (0.3, 0.25, 0.45)
        shoulder, elbow, wrist = swing * np.array(share)
        home = (0.0, -0.4, 0.6, -0.4, 0.0, 0.0, 1.0)
        wound = (heading, -0.7, -0.3, -0.5, 0.0, 0.0, 1.0)
        struck = (heading, shoulder - 0.7, elbow - 0.3, wrist - 0.5, 0.0, 0.0, 1.0)
        opens = Submovement(0.85 + 0.35 * late, self.opening, (0,) * 6 + (-1.0,), by_hardware=True)
        return reach_and_strike(home, wound, struck, 0.75, 0.6, more=(opens,))

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        time = first_passage(-plan[:, 6], -0.5, self.format.dt)
        if time is None:
            return None
        hand = moving(self.arm.hand(plan[:, :6]), self.format.dt)
        start, velocity = hand(time), hand(time, 1) * (1.0 + disturbed[0])
        if velocity[0] <= 0.1 or start[0] >= self.window:
            return None
        flies = float((self.window - start[0]) / velocity[0])
        place = on_parabola(start, velocity, flies)
        return None if place[2] < 0.0 else np.array([place[1], place[2], flies])


class Catapult(ZooTask):
    """A spring is drawn, an elevation set, a trigger pulled: only the values at the trigger count.

    The ball leaves with `stiffness` times the draw; k = 1.
    """

    name = "zoo-catapult"
    format = PlanFormat(("draw", "elevation", "trigger"), ("m", "rad", "1"), 0.05)
    outcome_names = ("x",)
    outcome_units = ("m",)
    horizon = 72
    release = "a trigger channel"
    tolerance = 0.002
    region = np.array([[1.00], [2.50]])
    spread = (0.0004,)  # a spring repeats itself better than an arm
    posture = (0.003, 0.04, 0.0)
    aim_range = ((0.05, 0.30),)
    stiffness = 25.0
    """Speed over draw, the root of the spring's stiffness over the ball's mass, in [1/s]."""
    height = 0.2
    """Height of the muzzle, in [m]."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Draw and raise it, pull the trigger, let it sink; style 1: raise it first, steeply."""
        draw, trigger = float(aims[0]), (0.0, 0.0, 1.0)
        elevation, lag = (0.55, 0.0) if style == 0 else (0.95, 0.7)
        moves = (
            Submovement(0.0, 1.0, (0.0, elevation, 0.0)),
            Submovement(lag, 1.2, (draw, 0.0, 0.0)),
            Submovement(2.0, 0.1, trigger, by_hardware=True),
            Submovement(2.1, 0.8, (0.0, -elevation / 2.0, 0.0)),
        )
        return Strategy((0.0, 0.0, 0.0), moves, 2.0)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        time = first_passage(plan[:, 2], 0.5, self.format.dt)
        if time is None:
            return None
        frames = np.arange(len(plan)) * self.format.dt
        draw, elevation = (float(np.interp(time, frames, plan[:, i])) for i in (0, 1))
        speed = self.stiffness * draw * (1.0 + disturbed[0])
        velocity = speed * np.array([np.cos(elevation), 0.0, np.sin(elevation)])
        landed = landing(np.array([0.0, 0.0, self.height]), velocity)
        return None if landed is None else landed[:1]
