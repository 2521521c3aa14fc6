"""Which simulated task a command is about."""

from __future__ import annotations

from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.tasks import make_task
from prior_reinforce.tasks.base import Task


@dataclass(frozen=True)
class Simulated:
    """What every command on a simulated task is told."""

    task: str = "basketball-v1"
    """Task to simulate: basketball-v1, -v2 or -v3, curling, fishing, or one's own as
    module:Class."""
    demonstrations: str = "A"
    """Prior set: A, B, or the path of a demonstrations file of the same plan format."""
    seed: int = 0
    """Seed of training, goals, disturbances and perception."""

    def open(self) -> tuple[Task, Demonstrations]:
        """Make the task and load the demonstrations.

        Raises:
            ConfigurationError: An unknown task, a negative seed, or another plan format.
            FileFormatError: No such demonstrations.
        """
        if self.seed < 0:
            raise ConfigurationError(f"--seed must be 0 or more, got {self.seed}")
        task = make_task(self.task)
        if self.demonstrations in task.demonstration_sets:
            return task, task.demonstrations(self.demonstrations)
        demonstrations = Demonstrations.load(self.demonstrations)
        if demonstrations.format.names != task.format.names:
            raise ConfigurationError(
                f"{self.demonstrations} moves {demonstrations.format.names}, but {task.name} needs "
                f"{task.format.names}; choose the task that it was recorded on"
            )
        return task, demonstrations
