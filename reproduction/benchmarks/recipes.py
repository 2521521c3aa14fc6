"""Time of whole recipes at a small scale, their training apart.

    python reproduction/benchmarks/recipes.py [--recipes zero-shot adapters] [--goals 10] \
        [--workers 1]

A recipe's generators are learned first, on set A with seed 0; models that several recipes share are
learned once. Printed are the seconds of each part. Scale up by hand: units grow with trainings
(sets times seeds), and those that try goals with the number of goals.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from reproduction.recipes import RECIPES, Run, Scale
from reproduction.units import Workers


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recipes", nargs="+", choices=list(RECIPES), default=list(RECIPES))
    parser.add_argument("--goals", type=int, default=10)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    scale = Scale(goals=arguments.goals, seeds=(0,), sets=("A",))
    workers = Workers(arguments.workers)
    print(f"{arguments.goals} goals, set A, seed 0, workers: {arguments.workers}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in arguments.recipes:
            run, planned = Run(folder, workers), RECIPES[name].units(scale, ())
            start = time.perf_counter()
            run.prepare([unit for unit, _ in planned])
            learned = time.perf_counter()
            run.rows(planned)
            done = time.perf_counter()
            print(
                f"{name:14} {done - learned:7.1f} s, after {learned - start:7.1f} s of learning "
                "what was not learned before",
                flush=True,
            )


if __name__ == "__main__":
    main()
