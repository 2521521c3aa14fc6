"""What `auto` gains by the turn about the base that demonstrations show (`plans.symmetry.found`).

    python reproduction/benchmarks/found_turn.py [--tasks NAME ...] [--sets 20] [--count 6]
        [--goals 10] [--perception eye|exact]

A row a task: on how many drawn sets a turn was found, first throws that hit and trials a goal
without it (`auto,symmetry=none`) and with it, and the differences with 95 % intervals over sets.
Goals are single, the same for both; ten trials at most, and not reached counts 11.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from pathlib import Path

import numpy as np

from prior_reinforce.plans.symmetry.found import find_turn
from reproduction.demonstrations import DRAWN
from reproduction.evaluation import Trials
from reproduction.recipes.once import Shown
from reproduction.statistics import bootstrap_mean

TASKS = ("basketball-v1", "zoo-lob", "zoo-scoop", "zoo-bounce", "zoo-strike", "zoo-overarm")
GENERATORS = ("auto,symmetry=none", "auto")


def tried(
    task: str, number: int, arguments: argparse.Namespace, folder: Path
) -> tuple[bool, list[tuple[float, float]]]:
    """Whether a turn was found on a set, and with each generator the mean of hits and trials."""
    name = f"mixed-8-{number}" if task.startswith("zoo-") else DRAWN[number]
    subset = tuple(range(arguments.count))
    means = list[tuple[float, float]]()
    for generator in GENERATORS:
        training = Shown(task, name, generator, number, subset, symmetry="none")
        trials = Trials(training, task, "bayes", arguments.perception, arguments.goals)
        used = np.array([result.solved_at or 11 for result in trials.trials(folder)])
        means.append((float(np.mean(used == 1)), float(used.mean())))
    return find_turn(training.recorded().only(subset)) is not None, means


def main() -> None:
    """Print a row a task."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--count", type=int, default=6)
    parser.add_argument("--goals", type=int, default=10)
    parser.add_argument("--perception", choices=("eye", "exact"), default="eye")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| task | turn found | first throws that hit | | trials a goal | |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for task in arguments.tasks:
            rows = [tried(task, n, arguments, Path(folder)) for n in range(arguments.sets)]
            found, means = sum(turn for turn, _ in rows), np.array([of for _, of in rows])
            cells = [f"{task} | {found} of {len(rows)}"]
            for measure in (0, 1):
                without, with_it = means[:, :, measure].T
                cells.append(f"{without.mean():.2f}, {with_it.mean():.2f}")
                cells.append(str(bootstrap_mean((with_it - without)[:, None])))
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
