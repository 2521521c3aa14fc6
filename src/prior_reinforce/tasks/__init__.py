"""Env: dynamic manipulation tasks in contact physics, each a `.py` with its `.xml`; and `zoo`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prior_reinforce.registry import Member, Registry
from prior_reinforce.tasks import zoo

if TYPE_CHECKING:
    from prior_reinforce.tasks.base import Task

_HERE = "prior_reinforce.tasks"
_SHOT = f"{_HERE}.basketball:BasketballShot"

TASKS: Registry[Task] = Registry(
    "task",
    f"{_HERE}.base:Task",
    {
        "basketball-v1": Member(_SHOT, "throw a ball into a hoop"),
        "basketball-v2": Member(_SHOT, "the same with a shorter spoon", {"hardware": "v2"}),
        "basketball-v3": Member(_SHOT, "a smaller ball and a cup", {"hardware": "v3"}),
        "curling": Member(f"{_HERE}.curling:Curling", "slide a stone to a target"),
        "fishing": Member(f"{_HERE}.fishing:Fishing", "swing a hook onto a magnet"),
        **zoo.MEMBERS,
    },
)

make_task = TASKS.make
