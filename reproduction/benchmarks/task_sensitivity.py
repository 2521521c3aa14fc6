"""How far errors in a plan move its outcome, and how far a repeated plan spreads.

    python reproduction/benchmarks/task_sensitivity.py [TASK ...] [--copies 8] [--seed 0]

Without names, all tasks. Every plan of both prior sets is executed undisturbed, then in copies with
an error added: the same in every frame (a joint's zero, a calibration) or another in every frame
(white noise). Angles err by 2 mrad and by parts of it, positions by half of that in metres: 1 mm.
Last, copies without error are executed with the task's disturbances. Each line is the shift against
the undisturbed outcome: its mean, its root mean square along x and y, and the lost executions.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from prior_reinforce.environment import Rollout, Task
from prior_reinforce.simulation.tasks import TASKS, make_task

ANGLE = 0.002  # [rad]
POSITION = 0.001  # [m]


def spoilt(
    task: Task, plans: np.ndarray, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield plans with errors of each kind, shape (n, H, D), and what was done to them."""
    one = np.where([unit == "rad" for unit in task.format.units], ANGLE, POSITION)
    yield "constant 2 mrad", plans + rng.normal(0.0, one, (len(plans), 1, len(one)))
    for part in (0.25, 0.5, 1.0):
        noise = rng.normal(0.0, part * one, plans.shape)
        yield f"white {1000 * part * ANGLE:g} mrad", plans + noise


def line(kind: str, rollouts: list[Rollout], origins: np.ndarray) -> str:
    """One line of the table, from executions and their undisturbed outcomes, shape (n, 2)."""
    valid = np.array([rollout.valid for rollout in rollouts])
    shifts = 100 * (np.array([rollout.outcome for rollout in rollouts]) - origins)[valid]
    mean, rms = shifts.mean(axis=0), np.sqrt((shifts**2).mean(axis=0))
    return (
        f"| {kind} | {mean[0]:+.2f}, {mean[1]:+.2f} cm | {rms[0]:.2f} cm | {rms[1]:.2f} cm "
        f"| {np.sum(~valid)} of {len(valid)} |"
    )


def spread(rollouts: list[Rollout], copies: int) -> str:
    """Standard deviation of each plan's own outcomes: mean and range over the plans."""
    outcomes = np.array([rollout.outcome for rollout in rollouts]).reshape(-1, copies, 2)
    deviations = 100 * outcomes.std(axis=1, ddof=1)
    mean, low, high = deviations.mean(axis=0), deviations.min(axis=0), deviations.max(axis=0)
    return "sd of a repeated plan: " + "; ".join(
        f"{mean[i]:.2f} cm along {'xy'[i]} ({low[i]:.2f} to {high[i]:.2f})" for i in (0, 1)
    )


def main() -> None:
    """Measure every task named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "tasks", nargs="*", metavar="TASK", help="all that have a scene when none is named"
    )
    parser.add_argument("--copies", type=int, default=8, help="of each plan, for each kind")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.copies < 2:
        parser.error("--copies must be at least 2, or there is no spread")
    for name in arguments.tasks or [each for each in TASKS.members if TASKS.resolve(each).scene]:
        task, rng = make_task(name), np.random.default_rng(arguments.seed)
        plans = np.concatenate([task.demonstrations(key).plans for key in task.demonstration_sets])
        outcomes = np.array([rollout.outcome for rollout in task.rollout(plans, None)])
        plans = np.repeat(plans, arguments.copies, axis=0)
        outcomes = np.repeat(outcomes, arguments.copies, axis=0)
        print(f"{name}\n| error | mean shift x, y | rms x | rms y | lost |\n|---|---|---|---|---|")
        for kind, spoilt_plans in spoilt(task, plans, rng):
            print(line(kind, task.rollout(spoilt_plans, None), outcomes), flush=True)
        repeated = task.rollout(plans, rng)
        print(line("disturbed", repeated, outcomes))
        print(spread(repeated, arguments.copies), flush=True)


if __name__ == "__main__":
    main()
