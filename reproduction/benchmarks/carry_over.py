"""What do the trials of earlier goals save on later ones? Prints a line for each adapter.

    python reproduction/benchmarks/carry_over.py --models runs/model --sequences 40

Each sequence is five goals of the simulated task, worked through in order, once from the
demonstrations alone and once with the trials of the earlier goals; the figures are mean trials on
goals 2 to 5 (a goal that is not reached counts as one more than the rounds), with 95 % intervals.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import numpy as np

import prior_reinforce as pr
from reproduction.statistics import bootstrap_difference, bootstrap_mean

GOALS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", default="basketball-v1")
    parser.add_argument("--demonstrations", default="A", help="learned from: A, B, or a file")
    parser.add_argument("--models", type=Path, nargs="+", required=True, help="made by `learn`")
    parser.add_argument("--adapters", nargs="+", default=["gp-two-term", "gp-two-term-all"])
    parser.add_argument("--perception", default="eye")
    parser.add_argument("--sequences", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = pr.make_task(options.task)
    if options.demonstrations in task.demonstration_sets:
        demonstrations = task.demonstrations(options.demonstrations).without_symmetry()
    else:
        demonstrations = pr.Demonstrations.load(options.demonstrations)
    goals = task.sample_goals(options.sequences * GOALS, np.random.default_rng([options.seed, 6]))
    generators = [pr.load_learned(folder, demonstrations) for folder in options.models]
    print("| adapter | without | with earlier goals' trials | saved |")
    print("|---|---|---|---|")
    for adapter in options.adapters:
        without, with_earlier = (
            np.array(
                [
                    later_trials(
                        pr.run_sequences(
                            task,
                            generator,
                            partial(pr.make_adapter, adapter),
                            pr.make_perception(options.perception, scene=task.scene),
                            demonstrations,
                            goals.reshape(options.sequences, GOALS, -1),
                            carry_over=carry_over,
                            rounds=options.rounds,
                            seed=options.seed,
                        ),
                        options.rounds,
                    )
                    for generator in generators
                ]
            )
            for carry_over in (False, True)
        )
        saved = bootstrap_difference(without, with_earlier)
        means = bootstrap_mean(without), bootstrap_mean(with_earlier)
        print(f"| {adapter} | {means[0]} | {means[1]} | {saved} |")


def later_trials(sequences: list[list[pr.GoalTrials]], rounds: int) -> np.ndarray:
    """Mean trials on goals 2, 3, ... of each sequence.

    A sequence is one draw, as its goals share what was remembered.
    """
    needed = [[result.solved_at or rounds + 1 for result in results] for results in sequences]
    return np.array(needed, dtype=float)[:, 1:].mean(axis=1)


if __name__ == "__main__":
    main()
