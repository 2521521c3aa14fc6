"""Env: dynamic manipulation tasks in contact physics. Each a `.py` with its `.xml`."""

from prior_reinforce.registry import make_own
from prior_reinforce.tasks.base import Task
from prior_reinforce.tasks.basketball import BasketballShot
from prior_reinforce.tasks.basketball_v2 import BasketballShotV2
from prior_reinforce.tasks.basketball_v3 import BasketballShotV3
from prior_reinforce.tasks.curling import Curling
from prior_reinforce.tasks.fishing import Fishing

FAMILY: tuple[type[Task], ...] = (
    BasketballShot,
    BasketballShotV2,
    BasketballShotV3,
    Curling,
    Fishing,
)
"""Every task that can be named on the command line."""


def make_task(name: str) -> Task:
    """Make a task by its name, or one's own by `module:Class`.

    Raises:
        ConfigurationError: There is no such task; the message lists them.
    """
    known = {kind.name: kind for kind in FAMILY}
    if name in known:
        return known[name]()
    return make_own(name, Task, list(known))


__all__ = [
    "FAMILY",
    "BasketballShot",
    "BasketballShotV2",
    "BasketballShotV3",
    "Curling",
    "Fishing",
    "Task",
    "make_task",
]
