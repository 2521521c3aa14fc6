"""Time of one refit of the Gaussian-process adapter, against scikit-learn with 50 restarts.

    python benchmarks/gaussian_process.py [--data-sets 40] [--seed 0]

Both fit the same points (six demonstrations and two trials, k = 2, as in the paper) with the same
kernel, bounds and diagonal term, one after the other in this process, in an order drawn anew for
each data set. Printed are medians with the middle half of the data sets, the ratio of each pair,
and by how much the likelihoods differ: a faster answer counts only if it is as good.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


def observe(adapter: GaussianProcessAdapter, condition: np.ndarray, outcome: np.ndarray) -> None:
    """Take in a trial by its outcome: seen from a goal at 0, that is the error."""
    adapter.observe(condition, np.zeros(len(outcome)), outcome)


N_DEMONSTRATIONS, N_TRIALS, OUTCOME_DIM = 6, 2, 2
REGION = np.array([0.25, 0.50])  # [m]


def adapter_before_its_last_trial(
    rng: np.random.Generator,
) -> tuple[GaussianProcessAdapter, np.ndarray, np.ndarray]:
    """Return an adapter one trial short, and that trial: the refit to be timed."""
    demonstrations = Demonstrations(
        plans=rng.normal(size=(N_DEMONSTRATIONS, 4, 1)),
        outcomes_seen=rng.uniform(size=(N_DEMONSTRATIONS, OUTCOME_DIM)) * REGION,
        format=PlanFormat(("joint1",), ("rad",), 0.02),
    )
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations)
    goal = rng.uniform(size=OUTCOME_DIM) * REGION
    conditions = goal + rng.normal(scale=0.02, size=(N_TRIALS, OUTCOME_DIM))
    outcomes = goal + rng.normal(scale=0.02, size=(N_TRIALS, OUTCOME_DIM))
    for condition, outcome in zip(conditions[:-1], outcomes[:-1], strict=True):
        observe(adapter, condition, outcome)
    return adapter, conditions[-1], outcomes[-1]


def time_ours(
    adapter: GaussianProcessAdapter, condition: np.ndarray, outcome: np.ndarray
) -> tuple[float, float]:
    start = time.perf_counter()
    observe(adapter, condition, outcome)
    return time.perf_counter() - start, adapter.log_marginal_likelihood_


def time_scikit_learn(
    outcomes: np.ndarray, conditions: np.ndarray, jitter: np.ndarray, seed: int
) -> tuple[float, float]:
    regressor = GaussianProcessRegressor(
        ConstantKernel(1.0, (1e-5, 1e5)) * RBF(1.0, (1e-5, 1e5)),
        alpha=jitter,
        n_restarts_optimizer=50,
        random_state=seed,
    )
    start = time.perf_counter()
    regressor.fit(outcomes, conditions)
    return time.perf_counter() - start, regressor.log_marginal_likelihood_value_


def spread(values: np.ndarray, unit: str) -> str:
    least, low, median, high, most = np.percentile(values, [0, 25, 50, 75, 100])
    middle_half = f"middle half {low:.2f} to {high:.2f}"
    return f"{median:8.2f} {unit}  ({middle_half}, all {least:.2f} to {most:.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data-sets", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)

    times, likelihoods = [], []
    for number in range(-3, arguments.data_sets):  # three to warm up, not counted
        rng = np.random.default_rng([arguments.seed, number + 3])
        adapter, condition, outcome = adapter_before_its_last_trial(rng)
        twin, *_ = adapter_before_its_last_trial(
            np.random.default_rng([arguments.seed, number + 3])
        )
        observe(twin, condition, outcome)
        points = twin.memory_outcomes_, twin.memory_conditions_, twin.jitter_
        pair = {}
        for who in rng.permutation(["ours", "theirs"]):
            if who == "ours":
                pair[who] = time_ours(adapter, condition, outcome)
            else:
                pair[who] = time_scikit_learn(*points, seed=number + 3)
        if number >= 0:
            times.append([pair["ours"][0], pair["theirs"][0]])
            likelihoods.append([pair["ours"][1], pair["theirs"][1]])

    ours, theirs = np.array(times).T
    gap = np.subtract(*np.array(likelihoods).T)
    print(f"{len(times)} data sets of {N_DEMONSTRATIONS + N_TRIALS} points, seed {arguments.seed}")
    print(f"ours          {spread(1e3 * ours, 'ms')}")
    print(f"scikit-learn  {spread(1e3 * theirs, 'ms')}")
    print(f"ratio         {spread(theirs / ours, 'x ')}")
    print(f"log likelihood, ours minus scikit-learn's: {gap.min():+.1e} to {gap.max():+.1e}")


if __name__ == "__main__":
    main()
