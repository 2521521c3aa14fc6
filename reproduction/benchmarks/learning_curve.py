"""Learning curves of the paper's form of the generator: how many steps until it has learned?

    python reproduction/benchmarks/learning_curve.py OUT    # sets A and B, small widths, seed 0
    ... OUT --widths 256,512,1024 --steps 20000 --device cuda
    ... OUT --only-table --save results/learning-curve.json
    ... OUT --rows results/learning-curve.json --picture curve.png

Paper's form: raw frames, noise predicted, 100-step DDPM, no timing, no correction
(`diffusion-paper`, with SiLU and other widths). Each number of steps is a training
of its own, since the learning rate falls to 0 along a cosine: a snapshot of a longer training is
not what somebody gets who trains for so long. Trainings keep their state every minute, and models
and figures are kept in OUT, so that a run that was stopped goes on where it was.

At each point, without execution's disturbances: rms error of the demonstrations' own plans [mrad]
and how far their landings are from the demonstrated ones [cm]; roughness, the rms of plans at new
goals minus their moving average over three frames [mrad]; the share of these plans that the Panda's
gate lets through. Then Basketball Shot V1 as in `reproduce generators`: uniform goals, GP with
m = 2, amplified noise.

    noise     `shared` by all conditions, as everywhere here; each condition's `own`, so that it has
              one plan; or `fresh` at every trial, the paper's "repeatedly generating actions"
    filter    what stands for the arm's controller: `none`; `100 Hz`, first order on the 1 kHz
              stream, libfranka's default (`franka::kDefaultCutoffFrequency = 100.0` and
              `franka::lowpassFilter` in its API reference); `5 Hz`, a Gaussian of 25 ms over
              time, for a compliant controller (ours, not from a data sheet)
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import lfilter

from prior_reinforce.adapters import make_adapter
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.generators import DiffusionConfig, DiffusionGenerator, Generator, UNetSize
from prior_reinforce.generators.base import Wrapper
from prior_reinforce.perception import make_perception
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.simulation.protocol import run_goals
from prior_reinforce.simulation.tasks.basketball import BasketballShot
from reproduction.recipes.generators import FreshNoise

GOAL_SEED = 3000
"""A tuning seed; the reported goals are of seed 100."""
ROUNDS = 10
STREAM = 1e-3
"""Seconds between two samples that the arm gets."""
SAMPLED = (
    "shared, none, gp", "shared, 100 Hz, gp", "shared, 5 Hz, gp", "own, none, gp", "own, 5 Hz, gp",
    "own, none, frozen", "fresh, none, frozen",
)  # fmt: skip
"""Noise, filter and adapter."""


class Filtered(Wrapper):
    """A generator whose plans pass a low-pass filter, as they would through an arm's controller."""

    name = "filtered"

    def __init__(self, generator: Generator, dt: float, cutoff: str) -> None:
        super().__init__(generator)
        self.dt, self.cutoff = dt, cutoff
        self._outcome_dim = generator._outcome_dim

    def _fit(self, *_: object) -> None:
        raise NotImplementedError("wrap what was fitted")

    def _generate(self, conditions: NDArray[np.float64]) -> NDArray[np.float64]:
        plans = self.generator.generate(conditions)
        if self.cutoff == "5 Hz":
            return gaussian_filter1d(plans, 0.025 / self.dt, axis=1, mode="nearest")
        frames = np.arange(plans.shape[1]) * self.dt
        stream = np.arange(0, frames[-1] + STREAM / 2, STREAM)
        dense = CubicSpline(frames, plans, axis=1)(stream)
        gain = STREAM / (STREAM + 1 / (2 * np.pi * 100.0))  # libfranka's lowpassFilter
        start = (1 - gain) * dense[:, :1]
        smooth, _ = lfilter([gain], [1, gain - 1], dense, axis=1, zi=start)
        return CubicSpline(stream, smooth, axis=1)(frames)


def train(
    out: Path, name: str, widths: tuple[int, ...], steps: int, seed: int, device: str
) -> Path:
    """Train, or take what was trained before; a folder with the model and `training.json`."""
    folder = out / f"{name}-{'-'.join(map(str, widths))}-{steps}-{seed}"
    if not (folder / "training.json").exists():
        config = replace(
            DiffusionConfig.paper(),
            network=UNetSize(widths=widths, activation="silu"),
            training_steps=steps,
        )
        losses: list[float] = []
        started = time.process_time()
        generator = DiffusionGenerator(config, device=device, states=out / "states")
        demonstrations = BasketballShot().demonstrations(name)
        generator.fit(demonstrations, seed=seed, progress=lambda p: losses.append(p.loss))
        generator.save(folder)
        done = {"loss": losses[-1] if losses else None, "cpu_s": time.process_time() - started}
        (folder / "training.json").write_text(json.dumps(done))
    return folder


def plans_alone(
    task: BasketballShot, generator: Generator, demos: Demonstrations, goals: NDArray[np.float64]
) -> dict[str, float]:
    """What plans are like before anything is adapted."""
    own, plans = generator.generate(demos.outcomes_seen), generator.generate(goals)
    landed, shown = (
        np.array([rollout.outcome for rollout in task.rollout(each, None)])
        for each in (own, demos.plans)
    )
    limits = robot_limits("panda")
    reports = [check_plan(Plan(plan, demos.format), limits, demos) for plan in plans]
    return {
        "own_mrad": 1e3 * float(np.sqrt(np.mean((own - demos.plans) ** 2, axis=(1, 2))).mean()),
        "own_landing_cm": 100 * float(np.linalg.norm(landed - shown, axis=1).mean()),
        "rough_mrad": 1e3 * float(np.std(plans - uniform_filter1d(plans, 3, axis=1))),
        "gate": float(np.mean([not report.refused for report in reports])),
    }


def trials(
    task: BasketballShot,
    generator: Generator,
    adapter: str,
    demos: Demonstrations,
    goals: NDArray[np.float64],
) -> dict[str, object]:
    """Reach the goals; `solved_at` of each, 0 where none of the rounds did."""
    with make_perception("amplified") as perception:
        results = run_goals(
            task, generator, lambda: make_adapter(adapter), perception, demos, goals,
            rounds=ROUNDS, seed=GOAL_SEED,
        )  # fmt: skip
    return {"solved_at": [result.solved_at or 0 for result in results]}


def evaluate(folder: Path, name: str, n_goals: int, sampled: Sequence[str]) -> None:
    """Measure one model under each way of sampling that was not measured before."""
    path = folder / f"figures-{n_goals}.json"
    figures: dict[str, object] = json.loads(path.read_text()) if path.exists() else {}
    task = BasketballShot()
    demos, goals = (
        task.demonstrations(name),
        task.sample_goals(n_goals, np.random.default_rng(GOAL_SEED)),
    )
    network = DiffusionGenerator.load(folder)
    drawn = {
        "shared": network,
        "own": network.sampled(shared_noise=False),
        "fresh": FreshNoise(network),
    }
    for key in sampled:
        noise, cutoff, adapter = key.split(", ")
        if key not in figures:
            generator = drawn[noise]
            if cutoff != "none":
                generator = Filtered(generator, demos.format.dt, cutoff)
            figures[key] = {
                **plans_alone(task, generator, demos, goals),
                **trials(task, generator, adapter, demos, goals),
            }
            path.write_text(json.dumps(figures))


def collected(out: Path) -> list[dict[str, Any]]:
    """All that was measured in OUT, a row a model and way of sampling."""
    rows = []
    for path in sorted(out.glob("*/figures-*.json")):
        trained = json.loads((path.parent / "training.json").read_text())
        name, *widths, steps, seed = path.parent.name.split("-")
        model = {"set": name, "widths": widths, "steps": int(steps), "seed": int(seed), **trained}
        figures = json.loads(path.read_text())
        rows += [{**model, "sampled": key, **measured} for key, measured in figures.items()]
    return rows


def shares(row: Mapping[str, Any]) -> tuple[float, list[float]]:
    """Trials a goal, one more than there were rounds where none hit; and shares by 1, 2, 4, 10."""
    solved = np.array(row["solved_at"])
    by = [float(np.mean((solved > 0) & (solved <= n))) for n in (1, 2, 4, ROUNDS)]
    return float(np.where(solved > 0, solved, ROUNDS + 1).mean()), by


def table(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print rows."""
    print(
        "| set, widths, steps, seed | noise, filter, adapter | loss | own plans [mrad] "
        "| own landing [cm] | rough [mrad] | gate passes | first throws | trials | by 1, 2, 4, 10 |"
    )
    print("|" + "---|" * 10)
    for f in rows:
        took, by = shares(f)
        print(
            f"| {f['set']}, {'-'.join(f['widths'])}, {f['steps']}, {f['seed']} | {f['sampled']} "
            f"| {f['loss']:.4f} | {f['own_mrad']:.1f} "
            f"| {f['own_landing_cm']:.1f} | {f['rough_mrad']:.2f} | {f['gate']:.2f} "
            f"| {by[0]:.2f} | {took:.2f} | {' '.join(f'{share:.2f}' for share in by)} |"
        )


def draw(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw share by round 4 and trials against steps, of what is sampled with shared noise."""
    from prior_reinforce.report.style import calm_axes, new_figure, save_figure

    figure = new_figure(9.6, 3.8)
    by_four, trials_of = figure.subplots(1, 2)
    shown = [row for row in rows if row["sampled"] == "shared, none, gp"]
    for marker, name in zip("os", ("A", "B"), strict=True):
        mine = sorted((r for r in shown if r["set"] == name), key=lambda r: r["steps"])
        steps, took = [r["steps"] for r in mine], [shares(r) for r in mine]
        by_four.plot(steps, [by[2] for _, by in took], marker + "-", label=f"set {name}")
        trials_of.plot(steps, [trials for trials, _ in took], marker + "-", label=f"set {name}")
    by_four.axhline(0.9, color="grey", linestyle="--", linewidth=1)
    by_four.annotate("the paper: over 90 %", (0.02, 0.92), xycoords=("axes fraction", "data"))
    by_four.set(ylim=(0, 1.05), ylabel="goals reached within 4 trials")
    trials_of.set(ylim=(0, ROUNDS + 1), ylabel="trials a goal")
    for axes in (by_four, trials_of):
        calm_axes(axes)
        axes.set(xlabel="optimiser steps", xlim=(0, None))
        axes.legend(frameon=False)
    save_figure(figure, path)


def main() -> None:
    """Train and measure every point, one after another, then print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--sets", nargs="+", default=["A", "B"])
    parser.add_argument("--steps", nargs="+", type=int, default=[1000, 2000, 5000, 10000, 20000])
    parser.add_argument("--widths", default="32,64,128")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--goals", type=int, default=40)
    parser.add_argument("--sampled", nargs="+", default=SAMPLED, choices=SAMPLED)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--only-table", action="store_true")
    parser.add_argument("--save", type=Path, help="write all rows to this JSON file")
    parser.add_argument("--rows", type=Path, help="take rows from such a file, train nothing")
    parser.add_argument("--picture", type=Path, help="draw trials against steps as this PNG")
    options = parser.parse_args()
    widths = tuple(map(int, options.widths.split(",")))
    for seed in () if options.only_table or options.rows else options.seeds:
        for steps in options.steps:
            for name in options.sets:
                folder = train(options.out, name, widths, steps, seed, options.device)
                evaluate(folder, name, options.goals, options.sampled)
    rows = json.loads(options.rows.read_text()) if options.rows else collected(options.out)
    table(rows)
    if options.save:
        options.save.write_text(json.dumps(rows, indent=1) + "\n")
    if options.picture:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()
