"""Generators on demonstrations that vary as people's do: first throws and trials over the zoo.

    python reproduction/benchmarks/zoo_generators.py [--tasks developed|reported|NAME ...]
        [--kinds KIND-COUNT ...] [--sets 3] [--goals 30] [--seed 0] [--methods NAME ...] [--trials]

A table with a row a task and a column a method, means over kinds and sets of demonstrations, and
the standard error over these sets in parentheses. With `--trials` also the mean number of trials of
the better of `gp` and `proportional`, seen exactly, at most 8; a goal that is not reached counts 9.

`plain` is what anyone would write in a hundred lines, and the yardstick: each plan is moved so that
the middles of the motions coincide, ends go on with their last slope, and a thin-plate spline with
an affine part mixes them. It is written here from that description, apart from the library.
"""

from __future__ import annotations

import argparse
import warnings
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, RBFInterpolator

from prior_reinforce.adapters import make_adapter
from prior_reinforce.environment import Task
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.perception import make_perception
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.protocol import is_hit, run_goals
from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import DEVELOPED_ON, REPORTED

METHODS = (
    "plain",
    "auto",
    "interpolation,timing=none",
    "interpolation,timing=start",
    "interpolation,timing=tempo",
    "nearest",
)
KINDS = ("clean-6", "delayed-6", "tempo-6", "warped-8", "paused-8", "cut-6", "short-rest-8",
         "postures-6", "styles-9", "outlier-8", "jitter-6", "mixed-8", "mixed-12", "scattered-6",
         "scattered-8")  # fmt: skip
ROUNDS = 8


class Plain(Generator):
    """The yardstick; see above."""

    name = "plain"

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: object) -> None:
        plans, self.outcomes = demonstrations.plans, demonstrations.outcomes_seen
        n, horizon, _ = plans.shape
        frames = np.arange(horizon, dtype=float)
        energy = np.sum((np.gradient(plans, axis=1) / plans.std()) ** 2, axis=2)
        middles = energy @ frames / energy.sum(axis=1)
        self.moved = np.empty_like(plans)
        for i in range(n):
            at = frames + middles[i] - middles.mean()
            inside = np.clip(at, 0, horizon - 1)
            self.moved[i] = CubicSpline(frames, plans[i])(inside)
            before, after = plans[i, 1] - plans[i, 0], plans[i, -1] - plans[i, -2]
            self.moved[i] += np.minimum(at, 0)[:, None] * before
            self.moved[i] += np.maximum(at - horizon + 1, 0)[:, None] * after

    def _generate(self, conditions: NDArray[np.float64]) -> NDArray[np.float64]:
        n, scale = len(self.outcomes), np.ptp(self.outcomes, axis=0)
        affine = n > self.outcomes.shape[1]
        spline = RBFInterpolator(
            self.outcomes / scale,
            self.moved.reshape(n, -1),
            kernel="thin_plate_spline" if affine else "linear",
            degree=1 if affine else 0,
        )
        return np.asarray(spline(conditions / scale)).reshape(len(conditions), *self.moved[0].shape)


def made(method: str) -> Generator:
    """A generator that is not fitted yet."""
    return Plain() if method == "plain" else make_generator(method)


def first_throws(task: Task, generator: Generator, goals: NDArray[np.float64], seed: int) -> float:
    """Share of the goals that a first throw hits."""
    rollouts = task.rollout(generator.generate(goals), np.random.default_rng(seed))
    hits = [is_hit(r, goal, task.tolerance) for r, goal in zip(rollouts, goals, strict=True)]
    return float(np.mean(hits))


def trials(
    task: Task,
    generator: Generator,
    demonstrations: Demonstrations,
    goals: NDArray[np.float64],
    seed: int,
) -> float:
    """Mean trials to a hit, of the better adapter."""
    means = []
    for adapter in ("gp-two-term", "proportional"):
        results = run_goals(
            task,
            generator,
            partial(make_adapter, adapter),
            make_perception("exact"),
            demonstrations,
            goals,
            rounds=ROUNDS,
            seed=seed,
        )
        means.append(float(np.mean([result.solved_at or ROUNDS + 1 for result in results])))
    return min(means)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=["reported"])
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--methods", nargs="+", default=METHODS)
    parser.add_argument("--sets", type=int, default=3)
    parser.add_argument("--goals", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    named = {"developed": DEVELOPED_ON, "reported": REPORTED}
    tasks = [name for given in arguments.tasks for name in named.get(given, (given,))]
    print(f"| task | {' | '.join(arguments.methods)} |")
    print(f"|---{'|---' * len(arguments.methods)}|")
    for name in tasks:
        task = make_task(name)
        found: dict[str, list[tuple[float, float]]] = {method: [] for method in arguments.methods}
        for kind in arguments.kinds:
            for number in range(arguments.sets):
                prior = task.demonstrations(f"{kind}-{number}").without_symmetry()
                rng = np.random.default_rng([arguments.seed, number])
                goals = task.sample_goals(arguments.goals, rng)
                for method, rows in found.items():
                    generator = made(method).fit(prior, seed=arguments.seed)
                    first = first_throws(task, generator, goals, arguments.seed)
                    took = np.nan
                    if arguments.trials:
                        took = trials(task, generator, prior, goals, arguments.seed)
                    rows.append((first, took))
        cells = []
        for rows in found.values():
            mean = np.mean(rows, axis=0)
            error = np.std(rows, axis=0) / np.sqrt(len(rows))
            cell = f"{mean[0]:.2f} ({error[0]:.2f})"
            cells.append(cell + (f" / {mean[1]:.2f} ({error[1]:.2f})" if arguments.trials else ""))
        print(f"| `{name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
