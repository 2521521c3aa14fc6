"""What it costs in trials that demonstrations are seen by eye, and that trials are.

    python reproduction/benchmarks/seen_demonstrations.py [TASK ...] [--goals 50] [--workers 2]

Both prior sets, training seeds 0, 1 and 2, the goals of `reproduce`, Gaussian process adapter: the
demonstrations' outcomes exact or as seen by eye, the trials seen by eye or exactly. A goal
that is not reached in ten trials counts as eleven. In brackets 95 % intervals over trainings and
goals. What was learned is kept in --folder, and not learned again.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from reproduction.evaluation import Trials
from reproduction.recipes import Run, Scale
from reproduction.recipes.base import Planned
from reproduction.results import FIRST, TRIALS, Results
from reproduction.units import Workers


def main() -> None:
    """Print a line for each way of seeing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="*", default=["fishing"], metavar="TASK")
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("runs/seen-demonstrations"))
    arguments = parser.parse_args()

    scale = Scale(goals=arguments.goals)
    run = Run(arguments.folder, Workers(arguments.workers))
    for task in arguments.tasks:
        for way, seen_by in (("exact", None), ("by eye", "eye")):
            trainings = scale.trainings("diffusion", task, perception=seen_by)
            for perception in ("eye", "exact"):
                units: list[Planned] = [
                    (Trials(t, task, "gp-two-term", perception, scale.goals), {}) for t in trainings
                ]
                results = Results(pd.DataFrame(run.rows(units)), {})
                print(
                    f"{task:14} demonstrations {way:11} trials {perception:5}: "
                    f"{results.mean(TRIALS)} trials, first hits {results.mean(FIRST)}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
