"""Env: dynamic manipulation tasks in contact physics, each a `.py` with its `.xml`."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from prior_reinforce.errors import PriorReinforceError, RenderingUnavailableError
from prior_reinforce.registry import Member, Registry

if TYPE_CHECKING:
    from prior_reinforce.environment import Task

_HERE = "prior_reinforce.simulation.tasks"
_BASKETBALL = f"{_HERE}.basketball"

TASKS: Registry[Task] = Registry(
    "task",
    "prior_reinforce.environment:Task",
    {
        "basketball-v1": Member(f"{_BASKETBALL}:BasketballShot", "throw a ball into a hoop"),
        "basketball-v2": Member(f"{_BASKETBALL}:BasketballV2", "the same with a shorter spoon"),
        "basketball-v3": Member(f"{_BASKETBALL}:BasketballV3", "a smaller ball and a cup"),
        "basketball-fr3": Member(
            f"{_HERE}.basketball_fr3:BasketballFR3", "the first on a Franka Research 3"
        ),
        "curling": Member(f"{_HERE}.curling:Curling", "slide a stone to a target"),
        "curling-round": Member(f"{_HERE}.curling:CurlingRound", "go round the stone first"),
        "fishing": Member(f"{_HERE}.fishing:Fishing", "swing a hook onto a magnet"),
        "so101": Member(f"{_HERE}.so101:SO101Shot", "the SO-101 throws a ball into a cup"),
    },
)


def make_task(choice: str) -> Task:
    """Make a task by its name.

    Args:
        choice: Its name, with settings if need be.

    Raises:
        ConfigurationError: There is no such task.
        MissingExtraError: The extra [simulation] is not installed.
        RenderingUnavailableError: MuJoCo cannot be loaded with the OpenGL that MUJOCO_GL names.
    """
    try:
        return TASKS.make(choice)
    except (AttributeError, RuntimeError) as error:
        backend = os.environ.get("MUJOCO_GL")
        if isinstance(error, PriorReinforceError) or not backend or "mujoco" in sys.modules:
            raise
        raise RenderingUnavailableError(
            f"MuJoCo cannot be loaded with MUJOCO_GL={backend} ({error}); unset it, or set egl and "
            "install libegl1 (osmesa and libosmesa6)"
        ) from error
