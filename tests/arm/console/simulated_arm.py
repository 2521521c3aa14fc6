"""The arm of the console's tests: a program that executes a plan file on a simulated task.

    python simulated_arm.py TASK PLAN TRUTHS [SECONDS]

It says how far it is, and adds where the object ended to TRUTHS, a line an execution: so that the
test knows where to touch, and how often anything was executed.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np


def main(task: str, plan: str, truths: str, seconds: str = "0") -> None:
    actions = np.load(plan)["q"]
    for step in range(3):
        print(f"moving, {step + 1} of 3", flush=True)
        time.sleep(float(seconds) / 3)
    with Path(truths).open("a") as file:
        file.write(json.dumps(outcome(task, actions)) + "\n")
    print("done", flush=True)


def outcome(task: str, actions: np.ndarray) -> list[float]:
    if task == "planar":  # what `workspace.planar` throws, on an arm that throws longer and left
        x, y = actions[-1]
        return [1.06 * x, y + 0.03]
    from prior_reinforce.simulation.tasks import make_task

    rng = np.random.default_rng(len(actions))
    return make_task(task).rollout(actions[None], rng)[0].outcome.tolist()


if __name__ == "__main__":
    main(*sys.argv[1:])
