"""P(hit) of first throws at first goals, as said and as it came, over many people's demonstrations.

    python reproduction/benchmarks/first_throws.py [--tasks NAME ...] [--sets NAME ...] [--goals 40]
        [--perception eye|exact] [--generator interpolation,timing=align]
        [--p-changed 0.2 0.05] [--seed 71000]

A row a task: P(hit) said, share that hit (true outcomes), the least and greatest share among sets,
and hit minus said with its 95 % interval over sets and goals. All goals of one set share the errors
of its labels, so a thousand throws behind two sets say little. Below, said and hit in bins of 50
throws or more. With several probabilities of changed hardware beforehand, a table for each: before
any trial it changes what is said, and no throw.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.adapters.displacement import BayesianConfig
from prior_reinforce.generators import make_generator
from prior_reinforce.perception import make_perception
from prior_reinforce.simulation.protocol import is_hit, perceive_demonstrations
from prior_reinforce.simulation.tasks import make_task
from reproduction.demonstrations import DRAWN, prior_set
from reproduction.statistics import bootstrap_mean

TASKS = ("basketball-v1", "curling", "fishing")
FEWEST = 50
"""Throws in a bin that is shown."""


def thrown(
    arguments: argparse.Namespace, name: str, number: int
) -> tuple[list[np.ndarray], np.ndarray]:
    """P(hit) said under each probability of changed hardware, and which throws hit."""
    task, key = make_task(name), arguments.sets[number]
    seed, prior = arguments.seed + number, prior_set(task, key)
    if arguments.perception != "exact":
        perception = make_perception(arguments.perception)
        prior = perceive_demonstrations(task, prior, perception, seed=seed)
    generator = make_generator(arguments.generator).fit(prior, seed=seed)
    goals = task.sample_goals(arguments.goals, np.random.default_rng([arguments.seed + 1, number]))
    adapters = [BayesianAdapter(BayesianConfig(p_changed=p)) for p in arguments.p_changed]
    for adapter in adapters:
        adapter.start(prior)
    conditions = np.array([adapters[0].propose(goal) for goal in goals])
    noise = np.random.default_rng([arguments.seed + 2, number])
    rollouts = task.rollout(generator.generate(conditions), noise)
    hit = [is_hit(r, goal, task.tolerance) for r, goal in zip(rollouts, goals, strict=True)]
    tolerance = prior.outcome_format.within(task.tolerance).half_axes
    return [a.p_hit(conditions, goals, tolerance) for a in adapters], np.array(hit)


def main() -> None:
    """Print a table for each probability of changed hardware."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--sets", nargs="+", default=DRAWN)
    parser.add_argument("--goals", type=int, default=40)
    parser.add_argument("--perception", choices=("eye", "exact"), default="eye")
    parser.add_argument("--generator", default="interpolation,timing=align")
    parser.add_argument("--p-changed", type=float, nargs="+", default=[0.2, 0.05])
    parser.add_argument("--seed", type=int, default=71000)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = {
        name: [thrown(arguments, name, number) for number in range(len(arguments.sets))]
        for name in arguments.tasks
    }
    for i, p_changed in enumerate(arguments.p_changed):
        print(f"\nChanged hardware beforehand: {p_changed:g}\n")
        print("| task | said | hit | of sets, least and greatest | hit less said |")
        print("|---|---|---|---|---|")
        for name, sets in rows.items():
            said, hit = np.array([p[i] for p, _ in sets]), np.array([hits for _, hits in sets])
            share = hit.mean(axis=1)
            print(
                f"| {name} | {said.mean():.2f} | {hit.mean():.2f} "
                f"| {share.min():.2f}, {share.max():.2f} | {bootstrap_mean(hit - said):+.2f} |"
            )
        said = np.concatenate([p[i] for sets in rows.values() for p, _ in sets])
        hit = np.concatenate([hits for sets in rows.values() for _, hits in sets])
        which = [np.floor(10.0 * said) == b for b in range(10)]
        bins = [f"{said[w].mean():.2f} {hit[w].mean():.2f}" for w in which if w.sum() >= FEWEST]
        print(f"\n{len(hit)} throws, bins: {', '.join(bins)}")
        print(f"Brier score {np.mean((said - hit) ** 2):.3f}", flush=True)


if __name__ == "__main__":
    main()
