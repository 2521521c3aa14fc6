"""Tune a generator: how far from goals of their own does the first throw land, without an adapter?

    python reproduction/benchmarks/zero_shot.py --methods nearest nearest,timing=align dmp

prints a line for each method and prior set: the median error with its quartiles, the share of goals
within the task's tolerance, and the share of lost balls.

`python -m reproduction zero-shot` reports, and this is for what comes before: there, goals are
the fixed grid that figures are published on; here, they are drawn with any seed, so that a setting
is chosen on other goals than it is judged on. 3000 and above are for tuning, never for reported
figures. reproduction/docs/baselines.md was made with it.
"""

from __future__ import annotations

import argparse

import numpy as np

import prior_reinforce as pr
import reproduction  # noqa: F401  (lets its methods and tasks be chosen by name)


def main() -> None:
    """Print a line a method and prior set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["nearest", "nearest,timing=align", "dmp", "dmp,timing=align"],
        help="names, with settings",
    )
    parser.add_argument("--sets", nargs="+", default=["A", "B"])
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--goal-seed", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    options = parser.parse_args()

    task = pr.make_task("basketball-v1")
    goals = task.sample_goals(options.goals, np.random.default_rng(options.goal_seed))
    print("| method | set | median error [cm] (quartiles) | reached | lost |")
    print("|---|---|---|---|---|")
    for method in options.methods:
        for prior_set in options.sets:
            demonstrations = task.demonstrations(prior_set).without_symmetry()
            generator = pr.make_generator(method).fit(demonstrations, seed=options.seed)
            rollouts = task.rollout(generator.generate(goals), None)
            outcomes = np.array([rollout.outcome for rollout in rollouts])
            lost = np.mean([not rollout.valid for rollout in rollouts])
            errors = np.linalg.norm(outcomes - goals, axis=1)
            low, median, high = 100 * np.percentile(errors, [25, 50, 75])
            print(
                f"| {method} | {prior_set} | {median:.2f} ({low:.2f}-{high:.2f}) "
                f"| {np.mean(errors <= task.tolerance):.2f} | {lost:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
