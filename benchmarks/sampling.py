"""Time to sample plans: the default's annealed mean shift, the paper's 100-step DDPM beside it.

    python benchmarks/sampling.py [--set A] [--plans 1 8] [--rounds 3] [--seed 0]

Three generators, each trained for one step (how long sampling takes does not depend on what was
learned): the default, the default's network sampled by 100-step DDPM, and the paper preset. All
sample the same conditions in this process, on one core as always, in an order drawn anew for each
round. How good the plans are is `training.py`'s business.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from prior_reinforce.generators import DiffusionConfig, make_generator
from prior_reinforce.simulation.tasks.basketball import BasketballShot


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", choices=BasketballShot.demonstration_sets, default="A")
    parser.add_argument("--plans", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    task = BasketballShot()
    demos = task.demonstrations(arguments.set)

    default, paper = DiffusionConfig(), DiffusionConfig.paper()
    choices = {
        f"default, {default.sampler} {default.sampling_steps}": "diffusion",
        f"default's network, ddpm {default.noise_levels}": "diffusion,sampler=ddpm",
        f"paper, ddpm {paper.noise_levels}": "diffusion-paper",
    }
    generators = {
        name: make_generator(f"{choice},training_steps=1").fit(demos, seed=arguments.seed)
        for name, choice in choices.items()
    }
    names = list(generators)
    for n in arguments.plans:
        conditions = task.sample_goals(n, rng)
        times: dict[str, list[float]] = {name: [] for name in names}
        for turn in range(-1, arguments.rounds):  # one to warm up, not counted
            for name in rng.permutation(names):
                start = time.perf_counter()
                generators[name].generate(conditions)
                if turn >= 0:
                    times[name].append(time.perf_counter() - start)
        print(f"{n} plan{'s' if n > 1 else ''} at once, seed {arguments.seed}")
        for name in names:
            low, median, high = 1e3 * np.percentile(times[name], [25, 50, 75])
            ratio = np.median(times[name]) / np.median(times[names[0]])
            print(f"  {name:32} {median:9.1f} ms  (middle half {low:.1f} to {high:.1f})"
                  f"  {ratio:7.1f} x the default's")  # fmt: skip


if __name__ == "__main__":
    main()
