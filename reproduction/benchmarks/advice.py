"""What teaching throws are worth: where `advise` says, or at random goals.

    python reproduction/benchmarks/advice.py FOLDER [TASK ...] [--afternoons 4] [--goals 25] \
        [--seed 3001]

By eye, on displacement fields of sets A and B with tuning seeds, which are kept in FOLDER.
Each afternoon makes throws that are chosen where `BayesianAdapter.gain` is greatest, or aimed at
goals drawn at random; then one throw at each of the goals. Printed is the share that hits, with its
standard error over afternoons. Basketball V3 is other hardware than demonstrations were made on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.environment import Task
from prior_reinforce.generators.base import Generator
from prior_reinforce.perception.eye import Eye
from prior_reinforce.simulation.protocol import is_hit
from reproduction.fields import Conditions, FieldTask, MeasuredField
from reproduction.recipes.adaptation import TASKS

LABELS = 10
THROWS = (0, 2, 4)
ACROSS = 15


def teach(
    task: Task,
    generator: Generator,
    adapter: BayesianAdapter,
    chosen: bool,
    rng: np.random.Generator,
) -> None:
    """One more throw."""
    if chosen:
        axes = [np.linspace(a, b, ACROSS) for a, b in task.region.T]
        goals = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        conditions = np.array([adapter.propose(goal) for goal in goals])
        best = int(np.argmax(adapter.gain(conditions, conditions)))
        goal, condition = goals[best], conditions[best]
    else:
        goal = task.sample_goals(1, rng)[0]
        condition = adapter.propose(goal)
    (rollout,) = task.rollout(generator.generate(condition[None]), rng)
    reading = Eye().perceive(rollout, goal, rng)
    adapter.observe(condition, goal, reading.with_hit(is_hit(rollout, goal, task.tolerance)))


def share_hit(
    task: Task,
    generator: Generator,
    adapter: BayesianAdapter,
    goals: np.ndarray,
    rng: np.random.Generator,
) -> float:
    conditions = np.array([adapter.propose(goal) for goal in goals])
    rollouts = task.rollout(generator.generate(conditions), rng)
    hits = [is_hit(r, g, task.tolerance) for r, g in zip(rollouts, goals, strict=True)]
    return float(np.mean(hits))


def afternoon(task: FieldTask, chosen: bool, n_goals: int, seed: int) -> list[float]:
    """Share of first throws that hit after each number of teaching throws."""
    goals = task.sample_goals(n_goals, np.random.default_rng([seed, 7]))
    rng = np.random.default_rng([seed, 8])
    prior = task.demonstrations("own")
    generator = Conditions().fit(prior, seed=0)
    adapter = BayesianAdapter()
    adapter.start(prior)
    shares = []
    for n in range(max(THROWS) + 1):
        if n:
            teach(task, generator, adapter, chosen, rng)
        if n in THROWS:
            shares.append(share_hit(task, generator, adapter, goals, rng))
    return shares


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("tasks", nargs="*", default=["basketball-v3"])
    parser.add_argument("--afternoons", type=int, default=4)
    parser.add_argument("--goals", type=int, default=25)
    parser.add_argument("--seed", type=int, default=3001)
    arguments = parser.parse_args()
    print(f"| task | throws | {' | '.join(map(str, THROWS))} |")
    print("|---" * (2 + len(THROWS)) + "|")
    for name in arguments.tasks:
        measured = [
            MeasuredField(name, TASKS[name], key, LABELS, seed=arguments.seed) for key in "AB"
        ]
        tasks = [FieldTask(one.field(arguments.folder)) for one in measured]
        for chosen in (True, False):
            shares = np.array([
                afternoon(task, chosen, arguments.goals, arguments.seed + i)
                for task in tasks
                for i in range(arguments.afternoons)
            ])  # fmt: skip
            error = shares.std(axis=0, ddof=1) / np.sqrt(len(shares))
            cells = [f"{m:.2f} ± {e:.2f}" for m, e in zip(shares.mean(axis=0), error, strict=True)]
            print(
                f"| {name} | {'chosen' if chosen else 'random'} | {' | '.join(cells)} |", flush=True
            )


if __name__ == "__main__":
    main()
