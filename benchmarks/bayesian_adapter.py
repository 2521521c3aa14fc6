"""Processor time of one trial of the Bayesian adapter, beside a refit of the Gaussian process.

    python benchmarks/bayesian_adapter.py [--repeats 20] [--seed 0] [--trials 1 3 10 30 100 200]

For each number of trials in memory, k = 2 and 3, seen by eye: one reading observed, the next
condition proposed, and P(hit) evaluated; the same where the last trial was told as "a miss" and
nothing else, so that the next is searched for beside it; and the Gaussian process, m = 2, taking in
the reading. All in this process, one after the other, in an order drawn anew each time. Printed are
medians and the median of the ratios; other processes do not count. A session that is brought back
observes every reading again: that is the last column.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.perception.eye import Eye
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading

REGION = np.array([0.25, 0.50, 0.40])  # [m]
TOLERANCE = 0.015  # [m]


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", type=int, nargs="+", default=[1, 3, 10, 30, 100, 200])
    arguments = parser.parse_args()
    print("k  trials  one trial  after a miss  GP refit  ratio  all observed again")
    for k in (2, 3):
        for n in arguments.trials:
            times = []
            for repeat in range(-2, arguments.repeats):  # two to warm up, not counted
                rng = np.random.default_rng([arguments.seed, k, n, repeat + 2])
                outcomes = rng.uniform(size=(6, k)) * REGION[:k]
                format_ = PlanFormat(("joint1",), ("rad",), 0.02)
                demonstrations = Demonstrations(rng.normal(size=(6, 4, 1)), outcomes, format_)
                goals = rng.uniform(size=(n, k)) * REGION[:k]
                conditions = goals + rng.normal(scale=0.02, size=(n, k))
                landed = conditions + 0.03 + rng.normal(scale=0.01, size=(n, k))
                seen = [
                    Eye().perceive(Rollout(r, True), g, rng)
                    for r, g in zip(landed, goals, strict=True)
                ]
                trials = list(zip(conditions, goals, seen, strict=True))
                ours, missing, theirs = (
                    BayesianAdapter(),
                    BayesianAdapter(),
                    GaussianProcessAdapter(),
                )
                adapters: tuple[Adapter, ...] = (ours, missing, theirs)
                miss = Reading.only(False, k).within(np.full(k, TOLERANCE))

                def again(adapter: Adapter) -> None:
                    adapter.start(demonstrations)  # noqa: B023
                    for trial in trials[:-1]:  # noqa: B023
                        adapter.observe(*trial)

                def one_more(adapter: BayesianAdapter, condition: Point, seen: Reading) -> None:
                    adapter.observe(condition, goals[-1], seen)  # noqa: B023
                    proposed = adapter.propose(goals[-1])  # noqa: B023
                    adapter.expect(proposed, goals[-1], TOLERANCE)  # noqa: B023

                replay = [seconds(partial(again, adapter)) for adapter in adapters]
                missed = missing.propose(goals[-1])
                works = [
                    lambda: one_more(ours, conditions[-1], seen[-1]),  # noqa: B023
                    lambda: one_more(missing, missed, miss),  # noqa: B023
                    lambda: theirs.observe(*trials[-1]),  # noqa: B023
                ]
                taken = np.zeros(3)
                for i in rng.permutation(3):
                    taken[i] = seconds(works[i])
                if repeat >= 0:
                    times.append([*taken, replay[0]])
            one, after, refit, replayed = np.median(1e3 * np.array(times), axis=0)
            ratio = np.median([row[0] / row[2] for row in times])
            print(
                f"{k}  {n:6d}  {one:6.1f} ms  {after:9.1f} ms  {refit:5.1f} ms  {ratio:5.1f}"
                f"  {replayed:9.1f} ms"
            )


if __name__ == "__main__":
    main()
