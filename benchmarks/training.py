"""Time to train the default diffusion generator, against the paper preset, on a shipped prior set.

    python benchmarks/training.py [--set A] [--steps 20] [--paper-steps 5] [--seed 0] [--threads 2]

Both presets train on the same demonstrations in this process, in turns of a few steps, so that
whatever else the machine does hits both. Then the default trains in full and is thrown in
simulation. The paper preset is extrapolated: its median step times its 5,000 steps, taking for
granted that these give it at least the default's zero-shot quality. `--paper-full` trains it too,
which takes an hour or more on a CPU, and throws it as well.
"""

from __future__ import annotations

import argparse
import time

import joblib
import numpy as np
from scipy.spatial import Delaunay

from prior_reinforce.generators import DiffusionConfig, Generator, make_generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.basketball import BasketballShot

N_TURNS = 3
N_GOALS = 60


def step_times(
    choice: str, demos: Demonstrations, n_steps: int, seed: int, threads: int
) -> list[float]:
    """Return the duration of each step but the first, which warms up, in [s]."""
    ends: list[float] = []
    generator = make_generator(f"{choice},training_steps={n_steps + 1}", threads=threads)
    generator.fit(demos, seed=seed, progress=lambda _: ends.append(time.perf_counter()))
    return np.diff(ends).tolist()


def train_in_full(
    choice: str, demos: Demonstrations, seed: int, threads: int
) -> tuple[Generator, float, float]:
    """Return the generator, the wall time and the processor time of its fit, in [s]."""
    wall, processor = time.perf_counter(), time.process_time()
    generator = make_generator(choice, threads=threads).fit(demos, seed=seed)
    return generator, time.perf_counter() - wall, time.process_time() - processor


def zero_shot(generator: Generator, demos: Demonstrations, seed: int) -> str:
    """Throw at random goals in the demonstrations' hull, without disturbances."""
    rng, hull = np.random.default_rng(seed), Delaunay(demos.outcomes_seen)
    low, high = demos.outcomes_seen.min(axis=0), demos.outcomes_seen.max(axis=0)
    candidates = rng.uniform(low, high, (20 * N_GOALS, 2))
    goals = candidates[hull.find_simplex(candidates) >= 0][:N_GOALS]
    rollouts = BasketballShot().rollout(generator.generate(goals), None)
    outcomes = np.array([rollout.outcome for rollout in rollouts])
    errors = 100 * np.linalg.norm(outcomes - goals, axis=1)
    lost = sum(not rollout.valid for rollout in rollouts)
    return (
        f"median error {np.median(errors):.1f} cm, {lost} of {len(goals)} throws lost "
        f"(goals in the hull, seed {seed})"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", choices=BasketballShot.demonstration_sets, default="A")
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--paper-steps", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=joblib.cpu_count())
    parser.add_argument("--paper-full", action="store_true")
    arguments = parser.parse_args()
    demos = BasketballShot().demonstrations(arguments.set)
    default, paper = DiffusionConfig(), DiffusionConfig.paper()
    run = {"seed": arguments.seed, "threads": arguments.threads}

    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(N_TURNS):
        ours += step_times("diffusion", demos, arguments.steps, **run)
        theirs += step_times("diffusion-paper", demos, arguments.paper_steps, **run)
    print(f"prior set {arguments.set}, {arguments.threads} threads, seed {arguments.seed}")
    for name, times in (("default", ours), ("paper", theirs)):
        low, median, high = 1e3 * np.percentile(times, [25, 50, 75])
        print(f"{name:8} {median:8.1f} ms a step  (middle half {low:.1f} to {high:.1f})")
    print(f"ratio    {np.median(theirs) / np.median(ours):8.1f} in time per step")

    generator, wall, processor = train_in_full("diffusion", demos, **run)
    print(
        f"default  {wall:8.1f} s in full, {default.training_steps} steps "
        f"({processor:.1f} s of processor time)"
    )
    print(f"         {zero_shot(generator, demos, arguments.seed + 1000)}")
    if arguments.paper_full:
        generator, paper_wall, _ = train_in_full("diffusion-paper", demos, **run)
        print(f"paper    {paper_wall:8.1f} s in full, {paper.training_steps} steps")
        print(f"         {zero_shot(generator, demos, arguments.seed + 1000)}")
    else:
        paper_wall = float(np.median(theirs)) * paper.training_steps
        print(
            f"paper    {paper_wall:8.0f} s in full, {paper.training_steps} steps, "
            f"extrapolated from {len(theirs)}"
        )
    print(f"ratio    {paper_wall / wall:8.1f} in time to quality")


if __name__ == "__main__":
    main()
