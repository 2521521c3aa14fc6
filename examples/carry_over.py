"""What do the trials of earlier goals save on later ones? Prints a line for each adapter.

    python examples/carry_over.py --models runs/model --sequences 40

Each sequence is five goals of the simulated task, worked through in order, once from the
demonstrations alone and once with the trials of the earlier goals; the figures are mean trials on
goals 2 to 5 (a goal that is not reached counts as one more than the rounds), with 95 % intervals.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from prior_reinforce.commands.learning import load_learned
from prior_reinforce.commands.task_options import Simulated
from prior_reinforce.experiments.carry_over import compare, trials_needed
from prior_reinforce.experiments.methods import make_adapter, make_perception

GOALS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", default="basketball-v1")
    parser.add_argument("--demonstrations", default="A", help="learned from: A, B, or a file")
    parser.add_argument("--models", type=Path, nargs="+", required=True, help="made by `learn`")
    parser.add_argument("--adapters", nargs="+", default=["gp", "gp-all"])
    parser.add_argument("--perception", default="eye")
    parser.add_argument("--sequences", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task, demonstrations = Simulated(options.task, options.demonstrations, options.seed).open()
    goals = task.sample_goals(options.sequences * GOALS, np.random.default_rng([options.seed, 6]))
    sequences = goals.reshape(options.sequences, GOALS, -1)
    print("| adapter | without | with earlier goals' trials | saved |")
    print("|---|---|---|---|")
    for adapter in options.adapters:
        needed = {"goal": [], "workspace": []}
        for folder in options.models:
            generator = load_learned(folder, demonstrations)
            for memory, results in needed.items():
                results.append(
                    trials_needed(
                        task,
                        generator,
                        lambda name=adapter: make_adapter(name),
                        make_perception(options.perception),
                        demonstrations,
                        sequences,
                        memory=memory,
                        rounds=options.rounds,
                        seed=options.seed,
                    )
                )
        result = compare(np.array(needed["goal"]), np.array(needed["workspace"]))
        print(f"| {adapter} | {result.without} | {result.with_earlier} | {result.saved} |")


if __name__ == "__main__":
    main()
