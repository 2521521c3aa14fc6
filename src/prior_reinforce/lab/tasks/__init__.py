"""Env: dynamic manipulation tasks in contact physics, each a `.py` with its `.xml`; and `zoo`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prior_reinforce.lab.tasks import zoo
from prior_reinforce.registry import Member, Registry

if TYPE_CHECKING:
    from prior_reinforce.environment import Task

_HERE = "prior_reinforce.lab.tasks"
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
        **zoo.MEMBERS,
    },
)

make_task = TASKS.make
