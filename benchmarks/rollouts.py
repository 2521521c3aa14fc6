"""Speed of a task's rollouts against the bare engine on the same model, states and controls.

    python benchmarks/rollouts.py [--plans 128] [--rounds 7] [--seed 0]

`mujoco.rollout` alone is timed on what the task hands it; the task's own time also holds the
splines, the disturbed models, the start states and the reading of outcomes. Both run in this
process, one after the other, in an order drawn anew for each round.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import mujoco.rollout
import numpy as np

from prior_reinforce.simulation.tasks.basketball import BasketballShot


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    task = BasketballShot()
    plans = np.resize(task.demonstrations("A").plans, (arguments.plans, 140, 7))
    models, states, controls = task._prepare(plans, rng)
    workers = [mujoco.MjData(task.model) for _ in task._workers]

    def bare() -> None:
        mujoco.rollout.rollout(models, workers, states, controls)

    def ours() -> None:
        task.rollout(plans, np.random.default_rng(arguments.seed))

    bare()
    ours()
    times: dict[Callable[[], None], list[float]] = {bare: [], ours: []}
    for _ in range(arguments.rounds):
        for work in rng.permutation(np.array([bare, ours], dtype=object)):
            times[work].append(seconds(work))
    ratio = np.array(times[ours]) / np.array(times[bare])
    print(f"{arguments.plans} plans of {controls.shape[1]} steps, {len(workers)} threads")
    for name, work in (("bare engine", bare), ("task", ours)):
        low, middle, high = np.percentile(times[work], [25, 50, 75])
        print(f"{name:>12}: {middle:6.3f} s (middle half {low:.3f} to {high:.3f})")
    low, middle, high = np.percentile(ratio, [25, 50, 75])
    print(f"task / bare : {middle:6.3f}   (middle half {low:.3f} to {high:.3f})")


if __name__ == "__main__":
    main()
