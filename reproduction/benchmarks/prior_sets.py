"""What a generator is up against: how far each prior set reaches, and how well it can be mixed.

    python reproduction/benchmarks/prior_sets.py [TASK ...] [--goals 50] [--seed 0]

Without names, the three tasks that have sets of their own. Prints, for each set, the share of the
region's goals that lie inside the hull of its outcomes, and how far smooth interpolation of its
plans lands from goals inside the hull, undisturbed: of plans aligned in time, and as recorded.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.spatial import Delaunay

import reproduction  # noqa: F401  (lets its methods and tasks be chosen by name)
from prior_reinforce.environment import Task
from prior_reinforce.generators import make_generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks import make_task

HULL_GOALS = 2000


def misses(task: Task, prior: Demonstrations, goals: np.ndarray, timing: str) -> str:
    """How far plans mixed for goals, shape (n, 2), land from them, in [cm]."""
    plans = make_generator(f"interpolation,timing={timing}").fit(prior, seed=0).generate(goals)
    rollouts = task.rollout(plans, None)
    landed = np.array([rollout.outcome for rollout in rollouts])
    distances = 100 * np.linalg.norm(landed - goals, axis=1)
    lost = sum(not rollout.valid for rollout in rollouts)
    return f"{np.median(distances):.1f} cm ({distances.max():.1f} cm), {lost} lost"


def main() -> None:
    """Measure every task named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tasks", nargs="*", default=["basketball-v1", "curling", "fishing"])
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print("| task, set | inside the hull | aligned: median (largest) | as recorded |")
    print("|---|---|---|---|")
    for name in arguments.tasks:
        task = make_task(name)
        goals = task.sample_goals(HULL_GOALS, np.random.default_rng(arguments.seed))
        for key in task.demonstration_sets:
            prior = task.demonstrations(key)
            is_inside = Delaunay(prior.outcomes_seen).find_simplex(goals) >= 0
            chosen = goals[is_inside][: arguments.goals]
            aligned = misses(task, prior, chosen, "align")
            recorded = misses(task, prior, chosen, "none")
            print(
                f"| {name}, {key} | {is_inside.mean():.0%} | {aligned} | {recorded} |", flush=True
            )


if __name__ == "__main__":
    main()
