"""What came of executing one plan: the true outcome, and the picture a camera would need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, eq=False)
class KeyFrame:
    """The instant that decides a trial, ready to be drawn by anyone who has the goal.

    The goal's object is the model's mocap body `goal`; whoever draws the frame moves it to the
    goal first. The paper calls it the collision frame (throws) or final stable frame (slides).
    """

    model: mujoco.MjModel
    """The scene; shared between rollouts, never changed by a reader."""
    state: Float[np.ndarray, " nq"]
    """Positions `qpos` of the model at this instant."""
    time: float
    """Time since the plan's first frame, in [s]."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """Result of one open-loop execution (paper eq. r = rollout_Env(A))."""

    outcome: Point
    """True outcome r, mostly [m] in the table frame: x forward and y left of the robot's base axis.
    Always finite."""
    valid: bool
    """False where the object never reached the place that defines the outcome (a lost ball);
    `outcome` is then a sensible place, stated by the task, that no goal can be near."""
    key_frame: KeyFrame | None = None
    """What a camera sees; None where nothing can be drawn (a real arm, a synthetic task)."""
