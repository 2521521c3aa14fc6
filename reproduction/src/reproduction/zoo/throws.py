"""Throws: an arm swings, something decides when the ball leaves, the ball flies."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import (
    Amplitude,
    Learned,
    Symmetry,
    Tempo,
    TurnJoint,
    scale_alone,
    turn_and_scale,
)
from reproduction.zoo import physics
from reproduction.zoo.base import ZooTask, joints
from reproduction.zoo.human import Strategy, Submovement, reach_and_strike
from reproduction.zoo.physics import GRAVITY, Arm, Place, first_passage, moving

_OPENING = 0.12
"""How long a gripper takes to open, six frames, in [s]."""


class Throw(ZooTask):
    """An arm swings, and a ball leaves its hand at some time, with the hand's velocity."""

    arm: ClassVar[Arm]

    @abstractmethod
    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        """When the ball leaves, in [s]; None if it stays in the hand."""

    def _flies(self, time: float, start: Place, velocity: Place) -> ArrayLike | None:
        """Outcome of a ball that leaves then, there and so fast: here, where it comes down."""
        return physics.landing(start, velocity)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, " m"]) -> ArrayLike | None:
        hand = moving(self.arm.hand(plan), self.format.dt)
        time = self._leaves(plan, hand)
        if time is None:
            return None
        return self._flies(time, hand(time), hand(time, 1) * (1.0 + disturbed[0]))


class Lob(Throw):
    """A seven-joint arm lets a ball go at a fixed frame, whatever the arm does then: a clock."""

    name = "zoo-lob"
    format = PlanFormat(joints(7), ("rad",) * 7, 0.02)
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

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the base, and played faster around the release."""
        return turn_and_scale(TurnJoint(), scale=Tempo(about=float(self.clock), keep_horizon=True))

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back, then swing: shoulder first, or (style 1) more with elbow and wrist."""
        heading, swing = aims
        home = (0.0, -0.3, 0.0, 0.5, 0.0, 0.3, 0.0)
        wound = (heading, -0.9, 0.0, -0.5, 0.0, -0.4, 0.0)
        shares = ((0.0, 1.1, 0.0, 0.6, 0.0, 0.4, 0.0), (0.0, 0.75, 0.0, 0.95, 0.0, 0.75, 0.0))
        struck = wound + swing * np.array(shares[style])
        return reach_and_strike(home, wound, struck, reach=0.6, strike=0.7, overlap=0.1)

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        return self.clock * self.format.dt if len(plan) > self.clock else None


class Scoop(Throw):
    """A ball lies in a scoop on a seven-joint arm, and leaves it when the hand decelerates."""

    name = "zoo-scoop"
    format = PlanFormat(joints(7), ("rad",) * 7, 0.0125)
    horizon = 140
    release = "the hand's deceleration"
    tolerance = 0.012
    region = np.array([[1.10, -0.45], [1.90, 0.45]])
    bandwidth = 8.0
    posture = (0.02, 0.04, 0.05, 0.04, 0.05, 0.04, 0.03)
    aim_range = ((-0.8, 0.8), (0.35, 1.5))
    arm = Arm.straight("zyxyzyx", 0.30, 0.16, 0.16, 0.20, 0.10, 0.08, 0.15)

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the base, and played faster."""
        return turn_and_scale(TurnJoint())

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lay the scoop back, then swing it over; in style 1 the wrist does more."""
        heading, swing = aims
        home = (0.0, -0.2, 0.0, -0.6, 0.0, -0.5, 0.0)
        wound = (heading, -0.5, 0.0, -0.5, 0.0, -0.35, 0.0)
        shares = ((0.0, 1.0, 0.0, 0.7, 0.0, 0.3, 0.0), (0.0, 0.6, 0.0, 0.7, 0.0, 0.9, 0.0))
        struck = wound + swing * np.array(shares[style])
        return reach_and_strike(home, wound, struck, reach=0.45, strike=0.55)

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        return physics.lift_off(hand, self.arm.direction(plan, (1.0, 0.0, 0.0)))


class GripperThrow(Throw):
    """Three joints and a gripper, whose opening is a channel of the plan: k = 3."""

    name = "zoo-gripper"
    format = PlanFormat((*joints(3), "gripper"), ("rad", "rad", "rad", "1"), 0.02)
    outcome_format = OutcomeFormat(("x", "y", "apex"), ("m", "m", "m"))
    horizon = 80
    release = "a gripper channel, opening in six frames"
    tolerance = 0.05
    region = np.array([[1.20, -0.30, 1.10], [1.60, 0.30, 1.18]])
    posture = (0.02, 0.04, 0.04, 0.0)
    aim_range = ((-0.4, 0.4), (1.2, 3.0), (-0.1, 0.45))
    arm = Arm.straight("zyy", 0.40, 0.30, 0.35)

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the base; how far and how high it flies is learned."""
        return turn_and_scale(TurnJoint(), scale=Learned(), others=(Learned(),))

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back, swing, and open the gripper in the swing: early for a high throw."""
        heading, swing, late = aims
        home = (0.0, -0.2, 0.4, 0.0)
        wound = (heading, -0.8, -0.7, 0.0)
        struck = wound + swing * np.array(((0.0, 0.6, 0.8, 0.0), (0.0, 0.9, 0.35, 0.0))[style])
        opens = Submovement(0.7 + 0.35 * late, _OPENING, (0, 0, 0, 1.0), by_hardware=True)
        return reach_and_strike(home, wound, struck, 0.6, 0.6, more=(opens,))

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        return first_passage(plan[:, 3], 0.5, self.format.dt)

    def _flies(self, time: float, start: Place, velocity: Place) -> Point | None:
        landed = physics.flight(start, velocity)
        if landed is None:
            return None
        apex = start[2] + max(velocity[2], 0.0) ** 2 / (2.0 * GRAVITY)
        return np.append(landed[0][:2], apex)


class Latched(Throw):
    """A latch lets the ball go where the hand's lean, the sum of all pitches, passes an angle."""

    release = "a latch at an angle of the hand"
    latch: ClassVar[float]
    """Lean of the hand at which the ball leaves, forwards from the vertical, in [rad]."""

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        pitches = np.array([axis == "y" for axis in self.arm.axes])
        return first_passage(plan[:, pitches].sum(axis=1), self.latch, self.format.dt)


class Bounce(Latched):
    """A ball that bounces once before it counts: where it comes down the second time."""

    name = "zoo-bounce"
    format = PlanFormat(joints(4), ("rad",) * 4, 0.0125)
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

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the base, and played faster."""
        return turn_and_scale(TurnJoint())

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Lean back and swing over; in style 1 the wrist does more."""
        heading, swing = aims
        wound = (heading, -0.5, -0.4, -0.3)
        struck = wound + swing * np.array(((0.0, 0.5, 0.3, 0.2), (0.0, 0.3, 0.3, 0.4))[style])
        return reach_and_strike((0.0, -0.3, -0.2, -0.1), wound, struck, 0.4, 0.5)

    def _flies(self, time: float, start: Place, velocity: Place) -> Point | None:
        first = physics.flight(start, velocity)
        if first is None:
            return None
        after = velocity * self.slip
        after[2] = -self.restitution * (velocity[2] - GRAVITY * first[1])
        return physics.landing(np.array([*first[0][:2], 0.0]), after)


class Drag(Latched):
    """A light ball against the air, thrown by a planar arm of two links; k = 1, 40 frames."""

    name = "zoo-drag"
    format = PlanFormat(joints(2), ("rad",) * 2, 0.025)
    outcome_format = OutcomeFormat(("x",), ("m",))
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

    @property
    def symmetry(self) -> Symmetry:
        """Played faster."""
        return scale_alone()

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Swing both joints; in style 1 the elbow follows with a whip."""
        wound = (-0.8, -0.7)
        struck = wound + aims[0] * np.array(((0.5, 0.5), (0.25, 0.75))[style])
        return reach_and_strike((-0.4, -0.4), wound, struck, 0.3, 0.45, 0.05)

    def _flies(self, time: float, start: Place, velocity: Place) -> Point | None:
        landed = physics.flight_in_air(start, velocity, self.drag)
        return None if landed is None else landed[:1]


class Arrival(Latched):
    """Where a ball lands, in metres, and when after the plan's start, in seconds."""

    name = "zoo-arrival"
    format = PlanFormat(joints(3), ("rad",) * 3, 0.02)
    outcome_format = OutcomeFormat(("x", "arrival"), ("m", "s"))
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
        wound = (-0.6, -0.5, -0.2)
        struck = wound + swing * np.array(((0.45, 0.35, 0.2), (0.3, 0.3, 0.4))[style])
        swung = reach_and_strike((-0.3, -0.3, 0.0), wound, struck, 0.4, 0.5)
        return replace(swung, settle=float(early))

    def _flies(self, time: float, start: Place, velocity: Place) -> Point | None:
        landed = physics.flight(start, velocity)
        return None if landed is None else np.array([landed[0][0], time + landed[1]])

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> ArrayLike | None:
        outcome = super()._execute(plan, disturbed)
        return None if outcome is None else outcome + np.array([0.0, disturbed[1]])


class Hoop(Throw):
    """Six joints of the usual industrial kind and a grip channel; through a window, k = 3."""

    name = "zoo-hoop"
    format = PlanFormat((*joints(6), "grip"), (*("rad",) * 6, "1"), 0.02)
    outcome_format = OutcomeFormat(("y", "z", "flight"), ("m", "m", "s"))
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

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Swing shoulder, elbow and wrist, and let go: early for a long flight."""
        heading, swing, late = aims
        home = (0.0, -0.4, 0.6, -0.4, 0.0, 0.0, 1.0)
        wound = (heading, -0.7, -0.3, -0.5, 0.0, 0.0, 1.0)
        shares = ((0, 0.4, 0.35, 0.25, 0, 0, 0), (0, 0.3, 0.25, 0.45, 0, 0, 0))
        struck = wound + swing * np.array(shares[style])
        opens = Submovement(0.85 + 0.35 * late, _OPENING, (0,) * 6 + (-1.0,), by_hardware=True)
        return reach_and_strike(home, wound, struck, 0.75, 0.6, more=(opens,))

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        return first_passage(-plan[:, 6], -0.5, self.format.dt)

    def _flies(self, time: float, start: Place, velocity: Place) -> Point | None:
        if velocity[0] <= 0.1 or start[0] >= self.window:
            return None
        flies = float((self.window - start[0]) / velocity[0])
        place = physics.on_parabola(start, velocity, flies)
        return None if place[2] < 0.0 else np.array([place[1], place[2], flies])


class Catapult(ZooTask):
    """A spring is drawn, an elevation set, a trigger pulled: only the values at the trigger count.

    The ball leaves with `stiffness` times the draw; k = 1.
    """

    name = "zoo-catapult"
    format = PlanFormat(("draw", "elevation", "trigger"), ("m", "rad", "1"), 0.05)
    outcome_format = OutcomeFormat(("x",), ("m",))
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

    @property
    def symmetry(self) -> Symmetry:
        """Drawn farther, the trigger and the elevation as they are."""
        return scale_alone(Amplitude(steps=(1, 2)))

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
        landed = physics.landing(np.array([0.0, 0.0, self.height]), velocity)
        return None if landed is None else landed[:1]
