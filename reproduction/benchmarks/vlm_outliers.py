"""How many more trials it takes when a vision-language model is wrong in a share of its answers.

    python reproduction/benchmarks/vlm_outliers.py [TASK ...] [--goals 24] [--outliers 0.1] \
        [--votes 3]
        [--generator diffusion] [--seed 0]

The same learned generator reaches the same goals twice, under the same disturbances, with the
Gaussian process adapter: once with every answer right, once with wrong ones (of the right size,
anywhere in the picture) among them. The answers come from `ColourCamera`, which finds the objects
by colour in the very picture. A goal that is not reached counts as one round more than there were;
a picture that cannot be read is judged by eye instead, and counted.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.perception.colour_camera import ColourCamera
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.simulation.protocol import GoalTrials, run_goals
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import Training
from reproduction.statistics import (
    bootstrap_difference,
    bootstrap_mean,
    trials_counted,
)

GOAL_SEED = 500  # of the goals; no other measurement uses them


def reach(training: Training, outliers: float, arguments: argparse.Namespace) -> list[GoalTrials]:
    """Try all goals of one task with a share of wrong answers."""
    task = make_task(training.task)
    learned = training.learned(arguments.folder)
    config = VisionLanguageModelConfig(votes=arguments.votes)
    seed = arguments.seed
    with ColourCamera(task.scene, config, seed=seed, outlier_rate=outliers) as perception:
        return run_goals(
            task,
            learned.generator,
            GaussianProcessAdapter,
            perception,
            learned.prior,
            task.sample_goals(arguments.goals, np.random.default_rng(GOAL_SEED)),
            rounds=arguments.rounds,
            seed=arguments.seed,
        )


def main() -> None:
    """Compare clean and spoilt answers on every task named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="*", default=["basketball-v1", "curling"], metavar="TASK")
    parser.add_argument("--goals", type=int, default=24)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--outliers", type=float, default=0.1, help="share of wrong answers")
    parser.add_argument("--votes", type=int, default=3, help="1 believes every answer")
    parser.add_argument("--generator", default="diffusion")
    parser.add_argument("--set", default="A", help="prior set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("runs/vlm-outliers"))
    arguments = parser.parse_args()

    template = Training("", arguments.set, arguments.generator, arguments.seed)
    for name in arguments.tasks:
        training = replace(template, task=name)
        trials = []
        for outliers in (0.0, arguments.outliers):
            results = reach(training, outliers, arguments)
            solved_at = np.array([[result.solved_at or 0 for result in results]])
            trials.append(trials_counted(solved_at, arguments.rounds))
            by_eye = sum(result.failed_readings for result in results)
            n_readings = sum(len(result.trials) for result in results)
            print(
                f"{name:14} {outliers:4.0%} wrong answers, {arguments.votes} votes: trials "
                f"{bootstrap_mean(trials[-1])}, sd {trials[-1].std(ddof=1):.2f}, "
                f"{(trials[-1] <= arguments.rounds).sum()} of {arguments.goals} goals reached, "
                f"{by_eye} of {n_readings} pictures judged by eye",
                flush=True,
            )
        more = bootstrap_difference(trials[1], trials[0])
        print(f"{name:14} more trials, goal by goal: {more}", flush=True)


if __name__ == "__main__":
    main()
