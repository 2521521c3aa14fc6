"""Pushes: what is pushed slides on by itself, and stops by friction."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import (
    Symmetry,
    Tempo,
    TurnIncrements,
    TurnJoint,
    scale_alone,
    turn_and_scale,
)
from reproduction.zoo.base import ZooTask, joints
from reproduction.zoo.human import Strategy, Submovement, reach_and_strike
from reproduction.zoo.physics import GRAVITY, Arm, finely, first_passage, moving


class ByIncrements(ZooTask):
    """A plan says how far the hand goes in each frame, not where it is."""

    def recorded(self, path: Frames) -> Frames:
        """Increments of a led path; the first is none."""
        return np.diff(path, axis=0, prepend=path[:1])

    def held(self, plan: Frames) -> Float[np.ndarray, " D"]:
        """No further increment."""
        return np.zeros(plan.shape[1])


class Push(ByIncrements):
    """A bar pushes a puck; a plan says how far the bar goes in each frame."""

    name = "zoo-push"
    format = PlanFormat(("dx", "dy", "dyaw"), ("m", "m", "rad"), 0.02)
    horizon = 90
    release = "the bar's deceleration"
    tolerance = 0.006
    region = np.array([[0.50, -0.16], [0.95, 0.16]])
    pose = 0.0  # an offset of every increment would be a drift
    spread = (0.0005, 0.005)
    """Where the puck is put aside, in [m], and the relative error of its friction; ours."""
    posture = (0.004, 0.006, 0.03)  # where it is brought behind the puck; its start is given
    aim_range = ((0.12, 0.6), (-0.9, 0.9))
    bar = (0.20, 0.0)
    """Where the bar's middle begins, (x, y) in [m], its face towards x."""
    puck = (0.26, 0.0)
    """Where the puck begins, (x, y) in [m]."""
    radius = 0.03
    """Radius of the puck, in [m]."""
    friction = 0.15
    """Friction of the puck on the table [-]."""
    grip = 0.3
    """Friction of the puck on the bar's face [-]."""
    per_frame = 6
    """Steps of the contact a frame."""

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the puck, and played faster."""
        return turn_and_scale(
            TurnIncrements(self.bar, self.puck, yaw=2), self.puck, Tempo(increments=(0, 1, 2))
        )

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Turn the bar behind the puck, then push along its face; style 1: turn while pushing."""
        length, heading = aims
        back = -0.02
        beside = (back + 0.06 * (1 - math.cos(heading)), -0.06 * math.sin(heading), heading)
        onward = (length * math.cos(heading), length * math.sin(heading), 0.0)
        if style == 0:
            struck = tuple(a + b for a, b in zip(beside, onward, strict=True))
            return reach_and_strike((0.0, 0.0, 0.0), beside, struck, 0.5, 0.6)
        moves = (
            Submovement(0.0, 0.4, (0.0, beside[1], 0.0)),
            Submovement(0.3, 0.4, (0.0, 0.0, heading)),
            Submovement(0.4, 0.65, onward),
        )
        return Strategy((0.0, 0.0, 0.0), moves, 0.4)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> Point | None:
        dt = self.format.dt / self.per_frame
        braking = self.friction * (1.0 + disturbed[1]) * GRAVITY
        x, y, yaw = *self.bar, 0.0
        px, py = self.puck[0], self.puck[1] + disturbed[0]
        vx = vy = 0.0
        for dx, dy, dyaw in (plan / self.per_frame).tolist():
            for _ in range(self.per_frame):
                x, y, yaw = x + dx, y + dy, yaw + dyaw
                speed = math.hypot(vx, vy)
                if speed:
                    sliding = min(dt, speed / braking)
                    px += vx * sliding * (1.0 - braking * sliding / speed / 2.0)
                    py += vy * sliding * (1.0 - braking * sliding / speed / 2.0)
                    vx *= 1.0 - braking * sliding / speed
                    vy *= 1.0 - braking * sliding / speed
                nx, ny = math.cos(yaw), math.sin(yaw)
                ax, ay = px - x, py - y
                gap = ax * nx + ay * ny - self.radius
                if gap >= 0.0:
                    continue
                # The bar's face takes the puck along, and drags it sideways as friction allows.
                px, py = px - gap * nx, py - gap * ny
                bx, by = dx / dt - dyaw / dt * ay, dy / dt + dyaw / dt * ax
                along = (bx - vx) * nx + (by - vy) * ny
                aside = (by - vy) * nx - (bx - vx) * ny
                pushed = max(along, 0.0)
                dragged = max(min(aside, self.grip * pushed), -self.grip * pushed)
                vx += pushed * nx - dragged * ny
                vy += pushed * ny + dragged * nx
        further = math.hypot(vx, vy) / (2.0 * braking)
        stopped = np.array([px + further * vx, py + further * vy])
        return None if np.allclose(stopped[0], self.puck[0]) else stopped


class Slide(ZooTask):
    """Shuffleboard: a cue of one axis pushes a disc over a table of varying friction, k = 1."""

    name = "zoo-slide"
    format = PlanFormat(("cue",), ("m",), 0.02)
    outcome_format = OutcomeFormat(("x",), ("m",))
    horizon = 60
    release = "the cue's deceleration"
    tolerance = 0.007
    region = np.array([[0.5], [1.3]])
    spread = (0.002, 0.002)
    """Relative errors of the speed and of the friction; ours."""
    bandwidth = 10.0
    posture = (0.01,)
    aim_range = ((0.10, 0.45),)
    friction = 0.12
    """Mean of the disc on the table [-]."""
    worn = 0.4
    """Relative amplitude of the friction's waves along the table."""
    wave = 0.35
    """Length of these waves, in [m]."""

    @property
    def symmetry(self) -> Symmetry:
        """Played faster."""
        return scale_alone()

    def work(self, x: Float[np.ndarray, " t"]) -> Float[np.ndarray, " t"]:
        """What friction takes from the disc from 0 to a place of the table, for its mass [J/kg]."""
        phase = 2.0 * math.pi * x / self.wave
        waves = self.worn * self.wave / (2.0 * math.pi) * (1.0 - np.cos(phase))
        return self.friction * GRAVITY * (x + waves)

    def braking(self, x: Float[np.ndarray, " t"]) -> Float[np.ndarray, " t"]:
        """Deceleration of a disc that slides there: the slope of `work`, in [m/s^2]."""
        phase = 2.0 * math.pi * x / self.wave
        return self.friction * GRAVITY * (1.0 + self.worn * np.sin(phase))

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Draw the cue back, then push; style 1: a longer draw and a quicker push."""
        back, takes = (0.05, 0.4) if style == 0 else (0.10, 0.45)
        return reach_and_strike((0.0,), (-back,), (float(aims[0]) - back,), 0.35, takes, 0.05)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> Point | None:
        cue = moving(plan[:, 0], self.format.dt)
        fine = finely(cue)
        # The disc leaves where the cue brakes harder than the table brakes the disc.
        ahead = np.where(cue(fine, 1) > 0.05, -cue(fine, 2) - self.braking(cue(fine)), -1.0)
        time = first_passage(ahead, 0.0, fine[1])
        if time is None:
            return None
        start, speed = float(cue(time)), float(cue(time, 1)) * (1.0 + disturbed[0])
        energy = self._work_to(start) + speed**2 / 2.0 / (1.0 + disturbed[1])
        farthest = start + speed**2 / (self.friction * GRAVITY * (1.0 - self.worn))
        return np.array([brentq(lambda x: self._work_to(x) - energy, start, farthest)])

    def _work_to(self, x: float) -> float:
        return float(self.work(np.array([x]))[0])


class Curl(ByIncrements):
    """A stone leaves a hand that brakes, with the hand's spin, and curls; plans are increments.

    Friction takes mu g from the speed v, and the spin turns the heading at curl * spin / v, so that
    a stone stops at v^2 / (mu g) (2, a) / (4 + a^2), ahead and to the left, with
    a = curl * spin / (mu g).
    """

    name = "zoo-curl"
    format = PlanFormat(("dx", "dy", "dyaw"), ("m", "m", "rad"), 0.02)
    horizon = 100
    release = "the hand's deceleration"
    tolerance = 0.006
    region = np.array([[1.20, -0.35], [1.80, 0.35]])
    pose = 0.0
    spread = (0.001, 0.002)
    """Relative errors of the speed and of the friction; ours."""
    bandwidth = 8.0
    posture = (0.01, 0.01, 0.05)
    aim_range = ((0.3, 0.9), (-0.9, 0.9))
    friction = 0.08
    """Friction of the stone on the ice [-]."""
    curl = 0.25
    """Sideways deceleration over spin, in [m/s]."""

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the start, and played faster."""
        return turn_and_scale(TurnIncrements(yaw=2), scale=Tempo(increments=(0, 1, 2)))

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Draw back, then push and turn the hand to the left; style 1: turn it to the right."""
        length, heading = aims
        turn = 0.7 if style == 0 else -0.7
        ahead = (float(np.cos(heading)), float(np.sin(heading)))
        back = (-0.08 * ahead[0], -0.08 * ahead[1], -turn / 2.0)
        gone = (back[0] + length * ahead[0], back[1] + length * ahead[1], turn / 2.0)
        return reach_and_strike((0.0, 0.0, 0.0), back, gone, 0.5, 0.8)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "2"]) -> Point | None:
        hand = moving(np.cumsum(plan, axis=0), self.format.dt)
        fine = finely(hand)
        velocity, change = hand(fine, 1)[:, :2], hand(fine, 2)[:, :2]
        speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)
        slower = -np.sum(velocity * change, axis=1) / speed
        # Half a metre a second: nobody lets go while drawing back.
        ahead = np.where(speed > 0.5, slower - self.friction * GRAVITY, -1.0)
        time = first_passage(ahead, 0.0, fine[1])
        if time is None:
            return None
        (x, y, _), (vx, vy, spin) = hand(time), hand(time, 1)
        braking = self.friction * (1.0 + disturbed[1]) * GRAVITY
        way = (vx**2 + vy**2) * (1.0 + disturbed[0]) ** 2 / braking
        a = self.curl * spin / braking
        forward, left = way * np.array([2.0, a]) / (4.0 + a**2)
        unit = np.array([vx, vy]) / np.hypot(vx, vy)
        return np.array([x, y]) + forward * unit + left * np.array([-unit[1], unit[0]])


class Strike(ZooTask):
    """A putter on a hanging arm: reach back, wait, strike; 400 frames, the ball rolls on."""

    name = "zoo-strike"
    format = PlanFormat(joints(4), ("rad",) * 4, 0.01)
    horizon = 400
    release = "the putter's touch"
    tolerance = 0.015
    region = np.array([[0.80, -0.40], [1.60, 0.40]])
    bandwidth = 8.0
    posture = (0.0, 0.03, 0.04, 0.03)
    aim_range = ((-0.6, 0.6), (0.6, 1.4))
    arm = Arm.straight("zyyz", -0.05, -0.30, -0.15, -0.15)
    """It hangs; its first joint turns about the ball's vertical."""
    ball = (0.0, 0.0, -0.65)
    """Where the ball lies, from the arm's base, in [m]."""
    radius, reach = 0.03, 0.08
    """Radius of the ball, and how far beside it the putter still meets it, in [m]."""
    bounce = 0.5
    """Restitution of the ball on the putter, which is much heavier [-]."""
    friction = 0.15
    """Friction of the ball on the lawn [-]."""

    @property
    def symmetry(self) -> Symmetry:
        """Turned about the ball, and played faster."""
        return turn_and_scale(TurnJoint())

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Turn and reach back, wait 0.7 s, strike; style 1 bends the elbow more."""
        heading, swing = aims
        bend = 0.2 if style == 0 else 0.6
        wound = (heading, 0.7 - bend / 2.0, bend, 0.0)
        struck = (heading, 0.7 - bend / 2.0 - swing, bend / 4.0, 0.0)
        return reach_and_strike((0.0, 0.25, 0.0, 0.0), wound, struck, 1.2, 0.8, overlap=-0.7)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        places = self.arm.hand(plan) - np.array(self.ball)
        face = self.arm.direction(plan, (1.0, 0.0, 0.0))[:, :2]
        face = face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-9)
        along = np.sum(places[:, :2] * face, axis=1)
        time = first_passage(along, -self.radius, self.format.dt)
        if time is None:
            return None
        hand = moving(places, self.format.dt)
        normal = moving(face, self.format.dt)(time)
        beside = hand(time) + self.radius * np.append(normal, 0.0)
        if np.linalg.norm(beside) > self.reach:
            return None
        speed = (1.0 + self.bounce) * float(hand(time, 1)[:2] @ normal) * (1.0 + disturbed[0])
        return np.array(self.ball[:2]) + speed**2 / (2.0 * self.friction * GRAVITY) * normal
