"""Picture: what generators make of demonstrations of two ways.

    python reproduction/benchmarks/ways.py reproduction/docs/images/ways.png [--task zoo-sidearm] \
        [--set ways-12-0]

One joint over time. Thin: the demonstrations of the two ways. Bold: the plans that each generator
generates for five goals. Closed form of all mixes the ways, and throws nothing; a network that was
trained on mixtures within the ways takes one of them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import reproduction  # noqa: F401  (lets its methods and tasks be chosen by name)
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.generators.patterns import patterns
from prior_reinforce.report.style import calm_axes, new_figure, save_figure
from prior_reinforce.simulation.tasks import make_task

CHOICES = {
    "closed form of all": "interpolation",
    "a network (diffusion-ways)": "diffusion-ways",
    "closed form within each way (auto)": "auto",
}


def main() -> None:
    """Learn, generate, draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("picture", type=Path)
    parser.add_argument("--task", default="zoo-sidearm")
    parser.add_argument("--set", default="ways-12-0")
    parser.add_argument("--channel", type=int, default=0)
    parser.add_argument("--model", type=Path, help="of the network, instead of learning one")
    parser.add_argument("--goal-seed", type=int, default=7000)
    options = parser.parse_args()

    task = make_task(options.task)
    demos = task.demonstrations(options.set)
    goals = task.sample_goals(5, np.random.default_rng(options.goal_seed))
    one = patterns(demos)[0]
    times = np.arange(demos.horizon) * demos.format.dt
    figure = new_figure(12.0, 3.9)
    panels = figure.subplots(1, len(CHOICES), sharey=True)
    for axes, (label, choice) in zip(panels, CHOICES.items(), strict=True):
        if options.model is not None and choice == "diffusion-ways":
            generator = load_generator(options.model)
        else:
            generator = make_generator(choice).fit(demos, seed=0)
        calm_axes(axes)
        for i, plan in enumerate(demos.plans[:, :, options.channel]):
            axes.plot(times, plan, color="tab:blue" if i in one else "tab:orange", linewidth=0.7)
        plans = generator.generate(goals)
        landed = task.rollout(plans, None)
        hits = sum(
            rollout.valid and np.linalg.norm(rollout.outcome - goal) <= 5 * task.tolerance
            for rollout, goal in zip(landed, goals, strict=True)
        )
        axes.plot(times, plans[:, :, options.channel].T, color="black", linewidth=2, alpha=0.75)
        axes.set_title(f"{label}\n{hits} of {len(goals)} land near their goals", fontsize=10)
        axes.set_xlabel("time [s]")
    panels[0].set_ylabel(f"{demos.format.names[options.channel]} [rad]")
    save_figure(figure, options.picture)


if __name__ == "__main__":
    main()
