"""How many plans of unseen goals pass the Panda's gate, and what refuses the others.

    python benchmarks/gate.py                                   # trains; two cores: minutes a set
    python benchmarks/gate.py --tasks basketball-v1 --sets A --generator interpolation

Goals are drawn uniformly in the task's region. Each is the condition of a first trial, so that
what is checked is what `ask` would hand out for it.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from prior_reinforce import make_task
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.robots.report import LimitReport
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.plans.motions import Plan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=["basketball-v1", "curling"])
    parser.add_argument("--sets", nargs="+", default=["A", "B"])
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--generator", default="diffusion")
    parser.add_argument("--model", type=Path, help="a saved model instead of a training")
    parser.add_argument("--seed", type=int, default=0, help="of the goals and the training")
    options = parser.parse_args()
    limits = robot_limits("panda")
    for task in map(make_task, options.tasks):
        rng = np.random.default_rng(options.seed)
        goals = task.sample_goals(options.goals, rng)
        for name in options.sets:
            demonstrations = task.demonstrations(name)
            if options.model is not None:
                generator = load_generator(options.model)
            else:
                generator = make_generator(options.generator)
                generator.fit(demonstrations, seed=options.seed)
            reports = [
                check_plan(Plan(frames, demonstrations.format), limits, demonstrations)
                for frames in generator.generate(goals)
            ]
            print(f"{task.name} {name}: {say(reports)}", flush=True)


def say(reports: Sequence[LimitReport]) -> str:
    """The share that passes, with the lines that refuse and those that warn."""
    passed = sum(not report.refused for report in reports)
    said = [f"{passed} of {len(reports)} pass"]
    for status in ("refuse", "warn"):
        lines = Counter(
            line.check for report in reports for line in report.lines if line.status == status
        )
        if lines:
            said.append(
                f"{status}: " + ", ".join(f"{n} x {line}" for line, n in lines.most_common())
            )
    return "; ".join(said)


if __name__ == "__main__":
    main()
