"""Throws: an arm swings, something decides when the ball leaves, the ball flies."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.tasks.zoo.base import ZooTask
from prior_reinforce.tasks.zoo.human import Strategy, Submovement, reach_and_strike
from prior_reinforce.tasks.zoo.physics import (
    GRAVITY,
    Arm,
    first_passage,
    flight,
    lift_off,
    moving,
)


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
        (
            (0.0, 0.0, 0.25),
            (0.0, 0.0, 0.20),
            (0.0, 0.0, 0.18),
            (0.0, 0.0, 0.22),
            (0.0, 0.0, 0.14),
            (0.0, 0.0, 0.10),
            (0.03, 0.0, 0.08),
        ),
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
        landed = flight(hand(time), hand(time, 1) * (1.0 + disturbed[0]))
        return None if landed is None else landed[0][:2]


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
    arm = Arm(
        "zyxyzyx",
        (
            (0.0, 0.0, 0.30),
            (0.0, 0.0, 0.16),
            (0.0, 0.0, 0.16),
            (0.0, 0.0, 0.20),
            (0.0, 0.0, 0.10),
            (0.0, 0.0, 0.08),
            (0.0, 0.0, 0.15),
        ),
    )

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
        landed = flight(hand(time), hand(time, 1) * (1.0 + disturbed[0]))
        return None if landed is None else landed[0][:2]


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
    arm = Arm("zyy", ((0.0, 0.0, 0.40), (0.0, 0.0, 0.30), (0.0, 0.0, 0.35)))
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
