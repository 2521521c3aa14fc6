"""Env: dynamic manipulation tasks in contact physics. Each a `.py` with its `.xml`."""

from prior_reinforce.errors import ConfigurationError
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
    """Make the task of a name.

    Raises:
        ConfigurationError: There is no such task; the message lists them.
    """
    for kind in FAMILY:
        if kind.name == name:
            return kind()
    raise ConfigurationError(
        f"no task {name!r}; tasks are {', '.join(kind.name for kind in FAMILY)}"
    )


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
