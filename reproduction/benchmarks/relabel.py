"""What is gained by correcting the demonstrations' outcomes by what trials taught.

    python reproduction/benchmarks/relabel.py FOLDER [--goals 8 20] [--afternoons 2] [--seed 3001]

Basketball V1, sets A and B, by eye, on displacement fields of tuning seeds, which are measured once
and kept in FOLDER. After an afternoon of goals the Bayesian adapter's mean displacement at each
demonstration, without what hardware changed, is added to the outcome that was seen of it, and the
generator is fitted again. Printed: how far labels are off (rms), and for 40 new goals the median
miss in contact physics without noise and the share within the tolerance, of first throws of the
generator as it was, of the same with what the adapter remembers, and of the generator fitted again,
whose conditions mean other plans, so that nothing remembered serves it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.generators import make_generator
from prior_reinforce.perception.eye import Eye
from prior_reinforce.session.session import Session
from prior_reinforce.simulation.protocol import perceive_demonstrations, reach_goals
from prior_reinforce.simulation.tasks import make_task
from reproduction.fields import Conditions, FieldTask, MeasuredField

TASK, LABELS, ROUNDS, NEW_GOALS = "basketball-v1", 10, 10, 40


def say(misses: np.ndarray, tolerance: ArrayLike) -> str:
    return f"{100 * np.median(misses):.2f} cm, {np.mean(misses <= tolerance):.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--goals", type=int, nargs="*", default=[8, 20])
    parser.add_argument("--afternoons", type=int, default=2)
    parser.add_argument("--seed", type=int, default=3001)
    arguments = parser.parse_args()
    physics = make_task(TASK)
    print("| set, afternoon, goals | labels off | as it was | with memory | fitted again |")
    print("|---|---|---|---|---|")
    for key in "AB":
        measured = MeasuredField(TASK, TASK, key, LABELS, seed=arguments.seed)
        task = FieldTask(measured.field(arguments.folder))
        own = task.demonstrations("own")
        recorded = physics.demonstrations(key)
        prior = perceive_demonstrations(physics, recorded, Eye(), seed=100 + LABELS)
        for afternoon in range(arguments.afternoons):
            rng = np.random.default_rng([arguments.seed, afternoon])
            goals, new = (
                task.sample_goals(max(arguments.goals), rng),
                task.sample_goals(NEW_GOALS, rng),
            )
            for n in arguments.goals:
                session = Session(Conditions().fit(own, seed=0), BayesianAdapter(), own)
                for j, goal in enumerate(goals[:n]):
                    session.set_goal(goal, task.tolerance)
                    reach_goals(task, [session], Eye(), rounds=ROUNDS, seed=arguments.seed + j)
                adapter = session.informed_adapter()
                assert isinstance(adapter, BayesianAdapter)
                seen = prior.outcomes_seen
                corrected = replace(
                    prior,
                    outcomes_seen=seen + adapter.displacement(seen, hardware=False),
                    outcome_correction=np.zeros_like(seen),
                )
                off = [
                    100 * np.sqrt(np.square(d.outcomes_seen - recorded.outcomes_seen).sum(1).mean())
                    for d in (prior, corrected)
                ]
                proposed = np.array([adapter.propose(goal) for goal in new])
                again = make_generator(measured.generator).fit(corrected, seed=LABELS).generate(new)
                landed = np.array([r.outcome for r in physics.rollout(again, None)])
                misses = (
                    task.field.at(new), proposed + task.field.at(proposed) - new, landed - new,
                )  # fmt: skip
                cells = [say(np.linalg.norm(miss, axis=1), task.tolerance) for miss in misses]
                print(
                    f"| {key}, {afternoon}, {n} | {off[0]:.1f} to {off[1]:.1f} cm | "
                    f"{' | '.join(cells)} |", flush=True,
                )  # fmt: skip


if __name__ == "__main__":
    main()
