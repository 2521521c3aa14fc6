"""Tasks that can be done in two ways, between which nothing is one: style 0, and style 1.

Half of one way and half of the other is no throw, or a shot that goes elsewhere. The kind of set
`ways` mixes both among its demonstrations, unsorted.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.zoo.base import ZooTask, joints
from reproduction.zoo.human import Strategy, reach_and_strike
from reproduction.zoo.physics import GRAVITY, Arm, finely, moving
from reproduction.zoo.throws import Throw


def fastest(path: CubicSpline, least: float) -> float | None:
    """When a path [m] is fastest, by a parabola through three samples.

    None if it is slower than `least` [m/s]: who swings less has not thrown.
    """
    fine = finely(path)
    speed = np.linalg.norm(np.atleast_2d(path(fine, 1).T), axis=0)
    i = int(np.clip(np.argmax(speed), 1, len(speed) - 2))
    if speed[i] < least:
        return None
    before, at, after = speed[i - 1 : i + 2]
    bend = before - 2.0 * at + after
    part = 0.0 if bend == 0.0 else float(np.clip((before - after) / (2.0 * bend), -1.0, 1.0))
    return float(fine[i] + part * (fine[1] - fine[0]))


class _Swung(Throw):
    """An arm lets go of a ball when its hand is fastest."""

    release = "the hand's fastest moment"
    least = 1.5
    """Speed of the hand below which the ball stays in it, in [m/s]."""

    def _leaves(self, plan: Frames, hand: CubicSpline) -> float | None:
        return fastest(hand, self.least)


class Sidearm(_Swung):
    """A ball slung around the body: forehand from the right, or backhand from the left."""

    name = "zoo-sidearm"
    demonstration_sets = ("ways-8-0", "ways-12-0", "warped-8-0", "mixed-8-0")
    format = PlanFormat(joints(3), ("rad",) * 3, 0.02)
    horizon = 140
    tolerance = 0.02
    region = np.array([[1.20, -0.30], [1.70, 0.30]])
    posture = (0.0, 0.03, 0.02)
    aim_range = ((0.5, 1.6), (0.1, 1.1))
    arm = Arm("zzy", ((0.35, 0.0, 0.0), (0.35, 0.0, 0.0), (0.10, 0.0, 0.0)), (0.0, 0.0, 0.6))

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Wind up to the right and sling to the left; style 1: its mirror image."""
        swing, heading = aims
        side = -1.0 if style == 0 else 1.0
        middle = side * (math.pi / 2.0 - heading)
        wound = (middle + side * swing / 2.0, side * 0.4, 0.0)
        struck = (middle - side * swing / 2.0, 0.0, -0.2)
        return reach_and_strike((0.0, 0.0, 0.0), wound, struck, 1.6, 0.4)


class Overarm(_Swung):
    """A ball thrown over the shoulder, or underhand."""

    name = "zoo-overarm"
    format = PlanFormat(joints(3), ("rad",) * 3, 0.02)
    horizon = 110
    tolerance = 0.02
    region = np.array([[1.60, -0.35], [2.30, 0.35]])
    posture = (0.02, 0.0, 0.04)
    aim_range = ((0.6, 3.0), (-0.35, 0.35))
    arm = Arm.straight("zyy", 0.0, 0.35, 0.35, base=0.9)

    def strategy(self, aims: Point, style: int) -> Strategy:
        """From behind, over the shoulder (its angle grows), or style 1: past the hip (it falls)."""
        swing, heading = aims
        middle, turns = (-0.5, 1.0) if style == 0 else (-3.7, -1.0)
        wound = (heading, middle - turns * swing / 2.0, 0.3 * turns)
        struck = (heading, middle + turns * swing / 2.0, 0.0)
        return reach_and_strike((0.0, -2.1, 0.0), wound, struck, 1.0, 0.5)


class Bank(ZooTask):
    """A puck shot by a cue, straight to the goal or off the cushion on the left."""

    name = "zoo-bank"
    format = PlanFormat(("heading", "cue"), ("rad", "m"), 0.02)
    horizon = 90
    release = "the cue's fastest moment"
    tolerance = 0.02
    region = np.array([[0.80, -0.25], [1.30, 0.20]])
    pose = 0.0  # of two channels, the heading alone would be disturbed
    spread = (0.003, 0.002)
    """Relative error of the speed, and error of the heading in [rad]; ours."""
    posture = (0.01, 0.004)
    aim_range = ((0.10, 0.45), (-0.5, 0.5))
    cushion = 0.45
    """Where it runs, along x at this y, in [m]."""
    rebound = 0.8
    """Share of the speed across the cushion that comes back."""
    friction = 0.15
    """Of the puck on the table [-]."""

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Turn to the goal, draw the cue back and shoot; style 1: turn to its mirror image."""
        stroke, heading = aims + np.array([0.0, 0.75 * style])
        return reach_and_strike((0.0, 0.0), (heading, -0.05), (heading, stroke - 0.05), 0.7, 0.35)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> Point | None:
        cue = moving(plan[:, 1], self.format.dt)
        time = fastest(cue, 0.3)
        if time is None or cue(time, 1) <= 0.0:
            return None
        heading = float(moving(plan[:, 0], self.format.dt)(time)) + disturbed[1]
        speed = float(cue(time, 1)) * (1.0 + disturbed[0])
        way = speed**2 / (2.0 * self.friction * GRAVITY)
        cos, sin = math.cos(heading), math.sin(heading)
        if way * sin <= self.cushion:
            return np.array([way * cos, way * sin])
        there = self.cushion / sin  # of the way, up to the cushion
        turned = math.hypot(cos, self.rebound * sin)
        left = (way - there) * turned**2  # the puck comes off it more slowly
        ahead, back = cos / turned, self.rebound * sin / turned
        return np.array([there * cos + left * ahead, self.cushion - left * back])
