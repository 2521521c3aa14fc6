"""Plans of end-effector poses: what a tool carries is poured, or swung on a string."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry, shift
from reproduction.zoo.base import ZooTask
from reproduction.zoo.human import Strategy, Submovement, reach_and_strike
from reproduction.zoo.physics import first_passage, hung, landing, moving

_POSES = PlanFormat(("x", "y", "z", "rx", "ry", "rz"), ("m",) * 3 + ("rad",) * 3, 0.02)


def _ahead(plan: Frames) -> Float[np.ndarray, "H 3"]:
    """Where the tool's own x axis points at each pose."""
    return np.asarray(Rotation.from_rotvec(plan[:, 3:]).apply((1.0, 0.0, 0.0)))


class Pour(ZooTask):
    """A marble rolls off a ladle as it tips, with the ladle's velocity."""

    name = "zoo-pour"
    format = _POSES
    horizon = 80
    release = "the ladle's tilt"
    tolerance = 0.004
    region = np.array([[0.75, -0.30], [1.15, 0.30]])
    bandwidth = 6.0
    posture = (0.01, 0.01, 0.02, 0.03, 0.03, 0.06)
    aim_range = ((0.1, 1.1), (-0.8, 0.8))
    ladle = 0.10
    """From the tool to the lip, along the tool's x, in [m]."""
    tilt = 0.35
    """Tilt of the lip below the horizontal at which the marble goes, in [rad]."""
    roll = 0.3
    """Speed at which it rolls off the lip, in [m/s]."""

    @property
    def symmetry(self) -> Symmetry:
        """Done elsewhere on the table."""
        return shift()

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Raise, then sweep and tip at once; in style 1 tip from the side, by turning first."""
        sweep, heading = aims
        ahead, aside = sweep * math.cos(heading), sweep * math.sin(heading)
        turn = heading + (0.0 if style == 0 else 0.6)
        moves = (
            Submovement(0.0, 0.5, (0.0, 0.0, 0.10, 0.0, 0.0, turn)),
            Submovement(0.4, 0.7, (ahead, aside, 0.0, 0.0, 0.0, 0.0)),
            Submovement(0.5, 0.6, (0.0, 0.0, 0.0, 0.0, 0.9, 0.0)),
        )
        return Strategy((0.40, 0.0, 0.30, 0.0, -0.1, 0.0), moves, 0.4)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        ahead = _ahead(plan)
        time = first_passage(-ahead[:, 2], math.sin(self.tilt), self.format.dt)
        if time is None:
            return None
        lip = moving(plan[:, :3] + self.ladle * ahead, self.format.dt)
        rolling = self.roll * moving(ahead, self.format.dt)(time)
        return landing(lip(time), (lip(time, 1) + rolling) * (1.0 + disturbed[0]))


class Swing(ZooTask):
    """A weight on a string from a rod's tip is let go at a fixed frame: poses, and a clock."""

    name = "zoo-swing"
    format = _POSES
    horizon = 90
    release = "the clock"
    tolerance = 0.008
    region = np.array([[0.85, -0.25], [1.30, 0.25]])
    slack = 0.12
    posture = (0.01, 0.01, 0.01, 0.02, 0.02, 0.03)
    aim_range = ((0.35, 1.1), (-0.9, 0.9))
    rod = 0.2
    """From the tool to the rod's tip, along the tool's x, in [m]."""
    string = 0.35
    """Length of the string, in [m]."""
    clock = 78
    """Frame at which the weight is let go."""

    @property
    def symmetry(self) -> Symmetry:
        """Done elsewhere on the table."""
        return shift()

    def strategy(self, aims: Point, style: int) -> Strategy:
        """Draw the weight back, then pull it forward; in style 1 by turning the rod as well."""
        length, heading = aims
        cos, sin = math.cos(heading), math.sin(heading)
        back, raised = (0.15, 0.0) if style == 0 else (0.10, -0.4)
        home = (0.40, 0.0, 0.75, 0.0, 0.0, 0.0)
        wound = (0.40 - back * cos, -back * sin, 0.75, 0.0, raised, 0.0)
        struck = (0.40 + (length - back) * cos, (length - back) * sin, 0.80, 0.0, 0.0, 0.0)
        return reach_and_strike(home, wound, struck, 0.6, 0.6)

    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, "1"]) -> Point | None:
        if len(plan) <= self.clock:
            return None
        tip = moving(plan[:, :3] + self.rod * _ahead(plan), self.format.dt)
        place, velocity = hung(tip, self.string, self.clock * self.format.dt, self.format.dt / 2.0)
        return landing(place, velocity * (1.0 + disturbed[0]))
