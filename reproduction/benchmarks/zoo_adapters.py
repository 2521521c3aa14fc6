"""Adapters behind the generator that `learn` chooses: trials a goal in sequences, over the zoo.

    python reproduction/benchmarks/zoo_adapters.py [--tasks developed|reported|NAME ...]
        [--sets KIND-COUNT-N ...] [--adapters NAME[+] ...] [--seed 0]
        [--perceptions exact|eye|amplified|hit ...] [--goals 8] [--sequences 4] [--rounds 10]

A row an adapter, `+` with the trials of earlier goals; a column a number of outcome components.
Mean trials of the goals after the first, one that is not reached counts a trial more than there
are; behind it the first row's minus it, with its standard error over sets of demonstrations.
Perception `hit` says whether a trial hit, and nothing else.
"""

from __future__ import annotations

import argparse
import warnings
from functools import partial

import numpy as np

from prior_reinforce.adapters import make_adapter
from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.generators import make_generator
from prior_reinforce.perception import make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.protocol import run_sequences
from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import DEVELOPED_ON, REPORTED

ADAPTERS = ("bayes+", "gp-two-term-all+", "gp-two-term+", "bayes", "gp-two-term", "proportional")
SETS = ("mixed-8-0", "mixed-8-1", "scattered-6-0", "scattered-6-1")


class HitOrMiss(Perception):
    """Sees nothing; whether a trial hit is told by the protocol."""

    name = "hit"

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Return a reading without numbers."""
        return Reading.only(False, len(goal))


def perception_of(name: str) -> Perception:
    """One of the library's, or `hit`."""
    return HitOrMiss() if name == "hit" else make_perception(name)


def main() -> None:
    """Print a table for each perception."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=["reported"])
    parser.add_argument("--sets", nargs="+", default=SETS)
    parser.add_argument("--adapters", nargs="+", default=ADAPTERS)
    parser.add_argument("--perceptions", nargs="+", default=["exact"])
    parser.add_argument("--goals", type=int, default=8)
    parser.add_argument("--sequences", type=int, default=4)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.goals < 2:
        parser.error("--goals must be at least 2: the first of a sequence does not count")
    warnings.simplefilter("ignore")
    named = {"developed": DEVELOPED_ON, "reported": REPORTED}
    tasks = [make_task(n) for given in arguments.tasks for n in named.get(given, (given,))]
    priors = [
        (task, task.demonstrations(name).without_symmetry())
        for task in tasks
        for name in arguments.sets
    ]
    fitted = [
        (task, prior, make_generator("auto").fit(prior, seed=arguments.seed))
        for task, prior in priors
    ]
    components = np.array([prior.outcome_dim for _, prior in priors])
    for perception in arguments.perceptions:
        took = np.full((len(arguments.adapters), len(fitted)), np.nan)
        for column, (task, prior, generator) in enumerate(fitted):
            rng = np.random.default_rng([arguments.seed, column % len(arguments.sets)])
            size = arguments.sequences * arguments.goals
            goals = task.sample_goals(size, rng).reshape(-1, arguments.goals, prior.outcome_dim)
            for row, adapter in enumerate(arguments.adapters):
                results = run_sequences(
                    task,
                    generator,
                    partial(make_adapter, adapter.rstrip("+")),
                    perception_of(perception),
                    prior,
                    goals,
                    carry_over=adapter.endswith("+"),
                    rounds=arguments.rounds,
                    seed=arguments.seed,
                )
                trials = [[goal.solved_at or arguments.rounds + 1 for goal in of] for of in results]
                took[row, column] = np.mean(np.array(trials)[:, 1:])
        each = {k: components == k for k in (1, 2, 3)}
        groups = {f"k = {k} ({which.sum()})": which for k, which in each.items()}
        groups |= {f"all ({len(fitted)})": components > 0}
        groups = {head: which for head, which in groups.items() if which.any()}
        print(f"\nReadings: {perception}\n\n| adapter | {' | '.join(groups)} |")
        print(f"|---{'|---' * len(groups)}|")
        for name, mean in zip(arguments.adapters, took, strict=True):
            cells = []
            for which in groups.values():
                off = (took[0] - mean)[which]
                error = np.std(off, ddof=1) / np.sqrt(len(off)) if len(off) > 1 else np.nan
                cells.append(f"{mean[which].mean():.2f} ({off.mean():+.2f} ± {error:.2f})")
            print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
