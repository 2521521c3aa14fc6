"""The paper's loop as the paper has it, at the paper's own size: 256, 512 and 1024, Mish.

Outcomes of the demonstrations are read by a camera; each goal is known with an error as large as a
camera's, drawn once; for every trial the network is sampled anew, and the paper's Gaussian process
corrects the condition from what is seen by eye. Controls: goals known exactly; then one noise for
all trials, or no adapter. Whether fewer steps or a smaller network would do better is asked on V1;
a quarter of the width, which does best there, is tried on all variants and on drawn sets.
The networks want a GPU: six minutes of an H100 for A and B at once, eleven of an H200 for fewer
steps, fourteen of an H100 for two smaller sizes, and, where processes share the GPU by NVIDIA's
MPS, thirteen of an H200 for the quarter on A, B and twelve drawn sets; the smallest size takes
three quarters of an hour of a core.

The paper does not say how its plans reach the arm, whose controllers are low-pass filters. Plans of
the network's raw frames, smoothed ones, and ones of a network that learns spline control points are
held against the Panda's limits, and thrown once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arrays import Points
from prior_reinforce.generators import Generator
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.plans.motions import Plan
from prior_reinforce.simulation.protocol import is_hit
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import GOAL_SEED, OfTraining, Training, Trials, ZeroShot
from reproduction.recipes.base import TASK, Planned, Recipe, Scale
from reproduction.recipes.generators import FreshNoise, FreshNoiseTrials
from reproduction.recipes.sets import SETS
from reproduction.recipes.tables import Columns, Table, mean_of
from reproduction.results import FIRST, TRIALS, Results, column, reached, rows_of
from reproduction.statistics import SHARE

FRAMES = "diffusion-paper,training_steps=20000"
SPLINES = "diffusion-paper,training_steps=6000,representation=splines"
"""On spline control points; as many steps as there was time for on the GPU."""
FEWER = {
    f"{steps:,} steps": f"diffusion-paper,training_steps={steps}" for steps in (2500, 5000, 10000)
}
"""Raw frames at the paper's own size, learned in fewer steps."""
SMALLER = {
    f"widths {widths}": f"{FRAMES},network.widths={widths}"
    for widths in ("32:64:128", "64:128:256", "128:256:512")
}
"""Raw frames by smaller networks, an eighth, a quarter and half as wide."""
_ON_A_CORE, QUARTER, _ = SMALLER
"""The smallest, which a core of a CPU learns in three quarters of an hour, and a quarter."""
QUARTER_DRAWN, _DRAWN = f"{QUARTER}, drawn sets", SETS[:8]
"""The same on drawn sets, each with a seed of its own; the first, as many as there was time for."""
_OTHERS = FEWER | SMALLER
_VARIANTS = {"V1": "basketball-v1", "V2": "basketball-v2", "V3": "basketball-v3"}
LOOP, EXACT = "the paper's loop", "goals known exactly"
ONE_NOISE, ALONE = f"{EXACT}, one noise for all trials", f"{EXACT}, no adapter"
GATE, KNOWN = "one throw, before the Panda's gate", "its own demonstrations"
_GOAL_SPREAD = 0.01
"""Standard deviation of a perceived goal in each direction, in [m]: the camera's own."""
_SMOOTHINGS = (0.0, 0.025, 0.04, 0.06)
"""Standard deviations of the Gaussian over time, in [s]."""


@dataclass(frozen=True)
class PerceivedGoalTrials(FreshNoiseTrials):
    """Trials of goals that are only known as they were perceived once."""

    def seen(self, goals: Points) -> Points:
        """Each goal beside where it is."""
        rng = np.random.default_rng([GOAL_SEED, self.training.seed, 6])
        return goals + rng.normal(scale=_GOAL_SPREAD, size=goals.shape)


@dataclass(frozen=True)
class Executable(OfTraining):
    """Which plans for goals pass the Panda's gate, and where they throw, at one smoothing."""

    goals: int
    """Number of goals."""
    smoothing_s: float
    """Standard deviation of the Gaussian over time, in [s]."""
    what: ClassVar[str] = "plans before the gate"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Generate, check and throw, with execution's disturbances."""
        task, learned = make_task(self.training.task), self.training.learned(folder)
        generator = FreshNoise(
            smoothed(learned.generator, self.smoothing_s / learned.prior.format.dt)
        )
        goals = task.sample_goals(self.goals, np.random.default_rng(GOAL_SEED))
        plans = generator.generate(goals)
        limits = robot_limits("panda")
        reports = [check_plan(Plan(p, learned.prior.format), limits, learned.prior) for p in plans]
        thrown = task.rollout(plans, np.random.default_rng([GOAL_SEED, self.training.seed]))
        return {
            "passed": [not report.refusals for report in reports],
            "hit": [
                is_hit(of, goal, task.tolerance) for of, goal in zip(thrown, goals, strict=True)
            ],
            "error": [
                float(np.linalg.norm(of.outcome - goal))
                for of, goal in zip(thrown, goals, strict=True)
            ],
        }

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal: one throw."""
        told = {**self.columns, "adapter": "frozen", "noise": "fresh", "rounds": 1}
        return rows_of(
            {**told, "smoothing_s": self.smoothing_s},
            goal=range(len(result["hit"])),
            solved_at=[int(hit) for hit in result["hit"]],
            first_error=[round(error, 5) for error in result["error"]],
            passed=[int(passed) for passed in result["passed"]],
        )


def smoothed(generator: Generator, frames: float) -> Generator:
    """A fitted network whose plans are smoothed by so many frames."""
    assert isinstance(generator, DiffusionGenerator)
    assert generator._learned is not None
    other, learned = copy(generator), generator._learned
    other._learned = replace(learned, codec=replace(learned.codec, smoothing=frames))
    return other


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Trials and plans of one training a set and form of network."""
    forms = {"frames": FRAMES, "splines": SPLINES} | _OTHERS
    planned = list[Planned]()
    for form, generator in forms.items():
        device = "cpu" if form == _ON_A_CORE else scale.device
        for name in scale.sets:
            training = Training(
                TASK, name, generator, scale.seeds[0], perception="camera", device=device
            )
            planned += _of_training(form, training, scale)
    for name, seed in _DRAWN if scale.variants else ():
        training = Training(
            TASK, name, SMALLER[QUARTER], seed, perception="camera", device=scale.device
        )
        planned += _of_training(QUARTER_DRAWN, training, scale)
    return planned


def _of_training(form: str, training: Training, scale: Scale) -> list[Planned]:
    """The loop, and but for splines and drawn sets its controls on V1; plans before the gate."""

    def tried(kind: type[Trials], adapter: str, variant: str, method: str) -> Planned:
        unit = scale.trials(training, adapter, "eye", task=_VARIANTS[variant])
        told = {"condition": f"{variant}, by eye", "method": f"{form}: {method}"}
        return kind(**vars(unit)), told

    whole, splines = form == "frames", form == "splines"
    planned = [
        tried(PerceivedGoalTrials, "gp", variant, LOOP)
        for variant in (_VARIANTS if form in ("frames", QUARTER, QUARTER_DRAWN) else ["V1"])
    ]
    if form not in ("splines", QUARTER_DRAWN):
        planned += [
            tried(FreshNoiseTrials, "gp", "V1", EXACT),
            tried(Trials, "gp", "V1", ONE_NOISE),
            tried(FreshNoiseTrials, "frozen", "V1", ALONE),
        ]
    planned.append((ZeroShot(training), {"condition": KNOWN, "method": form}))
    for by in _SMOOTHINGS if whole else _SMOOTHINGS[: int(splines)]:
        method = f"{form}, smoothed by {1000 * by:.0f} ms" if by else form
        told = {"condition": GATE, "method": method}
        planned.append((Executable(training, scale.goals, by), told))
    return planned


def table(results: Results) -> Table:
    """Of the paper's own size and a quarter of it: trials on each variant, more on V1."""
    on_v1 = _VARIANTS["V1"]
    columns: Columns = {
        **{label: mean_of(TRIALS, task=task) for label, task in _VARIANTS.items()},
        "V1, first trials": mean_of(FIRST, task=on_v1),
        "V1, within 4": mean_of(reached(4), task=on_v1),
    }
    looped = results.having("failed_readings").by("method")
    hidden = _OTHERS.keys() - {QUARTER}
    shown = {name: rows for name, rows in looped.items() if name.partition(": ")[0] not in hidden}
    return Table.of(("trials to a goal",), shown, columns)


def remarks(results: Results) -> list[str]:
    """How well each form knows its demonstrations, trials of others, plans the gate lets pass."""
    off = [
        f"{form} {1000 * rows.where(quantity='own_rms_rad').frame['value'].mean():.1f}"
        for form, rows in results.where(condition=KNOWN).by("method").items()
    ]
    gate = [
        f"{plans.removeprefix('frames, ')} {rows.mean(column('passed', SHARE)).value:.2f}, "
        f"{rows.mean(FIRST).value:.2f}"
        for plans, rows in results.where(condition=GATE).by("method").items()
    ]
    on_v1 = results.where(task=_VARIANTS["V1"]).having("failed_readings").by("method")
    others = [
        f"{form} " + ", ".join(str(on_v1[f"{form}: {of}"].mean(TRIALS)) for of in (LOOP, ONE_NOISE))
        for form in _OTHERS
        if f"{form}: {ONE_NOISE}" in on_v1
    ]
    said = [f"Off its own demonstrations, rms in mrad: {'; '.join(off)}."] if off else []
    if others:
        said.append(f"Trials on V1, the paper's loop and one noise: {'; '.join(others)}.")
    if gate:
        said.append(f"Plans that pass the Panda's gate, and hits: {'; '.join(gate)}.")
    return said


RECIPE = Recipe(
    "papers-loop", "The paper's loop at its own size", "Figure 7b, Table II", units, table,
    remarks=remarks, apart=True, on_device=True,
)  # fmt: skip
