"""Where the time of the batched protocol goes, and what batching saves.

    python benchmarks/protocol.py [--tasks basketball-v1 curling fishing] [--goals 100] [--rounds 3]

All goals of a round share one call of the generator and one batched rollout. Printed for each task:
how much of the rollouts' time passes inside the engine (`mujoco.rollout`), how long the adapters
take for one round of all goals (every trial observed, every next condition proposed), and how much
longer the same goals take one by one. The generator is a diffusion model after two training steps:
it samples as fast as a learned one, and as it reaches hardly any goal, every round is full.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import mujoco.rollout
import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.generators import make_generator
from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.protocol import run_goals
from prior_reinforce.simulation.tasks import make_task


class Stopwatch:
    """Adds up the time that passes inside a function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.seconds = 0.0
        self._function = function

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Call the function."""
        start = time.perf_counter()
        try:
            return self._function(*args, **options)
        finally:
            self.seconds += time.perf_counter() - start


class TimedAdapter(GaussianProcessAdapter):
    """The paper's adapter, all instances on one watch."""

    watch = Stopwatch(lambda work: work())

    def propose(self, goal_seen: ArrayLike) -> np.ndarray:
        """Return the next condition."""
        return self.watch(lambda: super(TimedAdapter, self).propose(goal_seen))

    def observe(self, condition: ArrayLike, goal: ArrayLike, reading: Reading | ArrayLike) -> None:
        """Take in a trial."""
        self.watch(lambda: super(TimedAdapter, self).observe(condition, goal, reading))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=["basketball-v1", "curling", "fishing"])
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one-by-one", type=int, default=5, help="goals that go one by one")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"{arguments.goals} goals, {arguments.rounds} rounds, seed {arguments.seed}")
    for name in arguments.tasks:
        task = make_task(name)
        demos = task.demonstrations("A")
        generator = make_generator("diffusion,training_steps=2")
        generator.fit(demos, seed=arguments.seed)
        goals = task.sample_goals(arguments.goals, np.random.default_rng(arguments.seed))

        def seconds_for(
            chosen: np.ndarray, task: Any = task, generator: Any = generator, demos: Any = demos
        ) -> float:
            start = time.perf_counter()
            run_goals(
                task, generator, TimedAdapter, Amplified(), demos, chosen,
                rounds=arguments.rounds, seed=arguments.seed,
            )  # fmt: skip
            return time.perf_counter() - start

        seconds_for(goals[:2])
        TimedAdapter.watch.seconds = 0.0
        engine, rollouts = Stopwatch(mujoco.rollout.rollout), Stopwatch(task.rollout)
        with (
            patch.object(mujoco.rollout, "rollout", engine),
            patch.object(task, "rollout", rollouts),
        ):
            together = seconds_for(goals)
        adapters = TimedAdapter.watch.seconds / arguments.rounds
        few = goals[: arguments.one_by_one]
        apart = sum(seconds_for(goal[None]) for goal in few) / len(few)
        print(
            f"{name:14} {together:6.1f} s; physics {rollouts.seconds:5.1f} s, "
            f"{engine.seconds / rollouts.seconds:.0%} of it in the engine; "
            f"adapters {adapters:.2f} s a round; "
            f"one by one {apart * len(goals) / together:.1f} x as long "
            f"(from {len(few)} goals)"
        )


if __name__ == "__main__":
    main()
