"""The zoo at a glance: a table of its tasks, and a picture of how demonstrations vary.

    python reproduction/benchmarks/zoo.py [--goals 60] [--sets 6] [--seed 0] [--picture FILE.png]

First throws are those of smooth interpolation between six demonstrations of one pattern, as
recorded (`zoo-arrival`: with the start apart), disturbed, at uniform goals. Tolerances were set so
that their share is between .3 and .75.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from prior_reinforce.environment import Task
from prior_reinforce.generators import make_generator
from prior_reinforce.simulation.protocol import is_hit
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.wording import say_tolerance
from reproduction.zoo import DEVELOPED_ON, MEMBERS
from reproduction.zoo.base import ZooTask
from reproduction.zoo.human import KINDS

SHOWN = "zoo-scoop"
"""Task whose demonstrations show what each kind of set varies."""


def first_throws(task: Task, kind: str, sets: int, goals: int, seed: int) -> float:
    """Share of goals that a first throw hits."""
    rng, hits = np.random.default_rng(seed), []
    timing = "start" if task.name == "zoo-arrival" else "none"
    for number in range(sets):
        prior = task.demonstrations(f"{kind}-6-{number}").without_symmetry()
        generator = make_generator(f"interpolation,kernel=thin-plate,timing={timing}").fit(
            prior, seed=0
        )
        aims = task.sample_goals(goals, rng)
        for rollout, aim in zip(task.rollout(generator.generate(aims), rng), aims, strict=True):
            hits.append(is_hit(rollout, aim, task.tolerance))
    return float(np.mean(hits))


def row(task: Task, arguments: argparse.Namespace) -> str:
    """One line of the table."""
    assert isinstance(task, ZooTask)
    prior = task.demonstrations("clean-6-0")
    plans = np.repeat(prior.plans, 20, axis=0)
    begun = time.perf_counter()
    rollouts = task.rollout(plans, np.random.default_rng(arguments.seed))
    each = (time.perf_counter() - begun) / len(plans)
    outcomes = np.array([rollout.outcome for rollout in rollouts]).reshape(6, 20, -1)
    repeated = np.linalg.norm(outcomes.std(axis=1) / task.tolerance, axis=1).mean()
    counts = arguments.sets, arguments.goals, arguments.seed
    clean, postures = (first_throws(task, kind, *counts) for kind in ("clean", "postures"))
    what = (type(task).__doc__ or "").splitlines()[0].rstrip(".")
    tolerance = say_tolerance(prior.outcome_format.within(task.tolerance))
    units = ", ".join(dict.fromkeys(prior.outcome_format.units))
    return (
        f"| `{task.name}` | {what} | {task.format.action_dim}, {prior.horizon} | "
        f"{', '.join(task.outcome_format.names)} [{units}] | {task.release} | {tolerance} | "
        f"{clean:.2f}, {postures:.2f} | {repeated:.1f} | {1000 * each:.1f} |"
    )


def curves(axes: Axes, task: Task, name: str) -> None:
    """The channel that moves most, of every demonstration of a set."""
    plans = task.demonstrations(name).plans
    units = np.array(task.format.units)
    swings = np.ptp(plans, axis=1).mean(axis=0) * (units != "1")
    channel = int(np.argmax(swings))
    times = np.arange(plans.shape[1]) * task.format.dt
    axes.plot(times, plans[:, :, channel].T, linewidth=0.8)
    axes.set_yticks([])
    axes.tick_params(labelsize=5, length=2)


def draw(path: Path) -> None:
    """Draw every task's demonstrations, and every kind of demonstrations of one task."""
    figure, grid = plt.subplots(4, 7, figsize=(11, 6), layout="constrained")
    places = iter(grid.ravel())
    for name in MEMBERS:
        axes, task = next(places), make_task(name)
        curves(axes, task, "mixed-8-0")
        half = "developed on" if name in DEVELOPED_ON else "reported"
        axes.set_title(f"{name}\n{half}", fontsize=6)
    for kind in KINDS:
        axes = next(places)
        curves(axes, make_task(SHOWN), f"{kind}-8-1")
        axes.set_title(f"{SHOWN}, {kind}", fontsize=6)
    for axes in places:
        axes.set_axis_off()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the table, or draw the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--goals", type=int, default=60)
    parser.add_argument("--sets", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path, help="draw this file, and print nothing")
    arguments = parser.parse_args()
    if arguments.picture is not None:
        draw(arguments.picture)
        return
    print(
        "| task | what | D, H | outcome | what decides the release | tolerance | first throws, "
        "`clean`, `postures` | repeated, sd / tolerance | ms a rollout |"
    )
    print("|---" * 9 + "|")
    for name in MEMBERS:
        print(row(make_task(name), arguments), flush=True)


if __name__ == "__main__":
    main()
