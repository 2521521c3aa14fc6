"""The paper's generator as we read it, in full, beside ours (ours; the paper has no such figures).

Diffusion Policy's low-dimensional training: 69 million parameters, raw frames, 5,000 steps, DDPM.
It is learned once a prior set (hours on a CPU) and sampled twice: with noise that all conditions
share, as everywhere here, and with independent noise for each condition, as where plans are sampled
at random. Adapter, noise and goals are those of the generators' comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.generators import DiffusionGenerator
from prior_reinforce.lab.experiments.evaluation import Learned, Training, Trials
from prior_reinforce.lab.experiments.recipes.base import (
    TASK,
    Figures,
    Measurement,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.recipes.generators import WHOLE_PLANS
from prior_reinforce.lab.experiments.statistics import (
    SHARE,
    bootstrap_difference,
    bootstrap_mean,
    trials_counted,
)

_GOALS = 30
"""At most: a plan takes 100 passes through a large network."""


@dataclass(frozen=True)
class IndependentNoiseTrials(Trials):
    """Trials with the network of a training, sampled with independent noise for each condition."""

    def learned(self, folder: Path) -> Learned:
        """What was learned, sampled otherwise."""
        shared = self.training.learned(folder)
        assert isinstance(shared.generator, DiffusionGenerator)
        return Learned(shared.generator.sampled(shared_noise=False), shared.prior)


METHODS = (
    ("diffusion", "diffusion", False),
    ("diffusion on whole plans", WHOLE_PLANS, False),
    ("the paper's preset, shared noise", "diffusion-paper", False),
    ("the paper's preset, independent noise", "diffusion-paper", True),
)
"""What is compared is called, its choice, and whether noise is independent between conditions."""


@dataclass(frozen=True)
class PaperPreset(Measurement):
    """First throws and trials of the paper's preset and of ours."""

    methods: tuple[tuple[str, str, bool], ...] = METHODS
    """What is compared; the first is ours."""
    seed: int = 0
    """Of every training."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Every generator on every prior set, once."""
        choices = dict.fromkeys(choice for _, choice, _ in self.methods)
        return [Training(TASK, name, c, self.seed) for c in choices for name in scale.sets]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every method."""
        scale = run.scale
        run.learn(self.trainings(scale))
        goals, rounds = min(scale.goals, _GOALS), scale.rounds
        units = [
            (IndependentNoiseTrials if own else Trials)(
                Training(TASK, name, choice, self.seed),
                TASK, "gp", "amplified", goals, rounds=rounds,
            )
            for _, choice, own in self.methods
            for name in scale.sets
        ]  # fmt: skip
        results = run.results(units)
        shape = len(self.methods), len(scale.sets), goals
        solved = np.array([result["solved_at"] for result in results]).reshape(shape)
        error = np.array([result["first_error"] for result in results]).reshape(shape)
        took = trials_counted(solved, rounds)
        return {
            "sets": list(scale.sets),
            "goals": goals,
            "rows": [
                {
                    "label": label,
                    "first": bootstrap_mean((solved[i] == 1).astype(float), within=SHARE),
                    "first_error_m": np.median(error[i], axis=1).tolist(),
                    "trials": bootstrap_mean(took[i], within=(1, rounds + 1)),
                    "trials_of_each": took[i].mean(axis=1).tolist(),
                    "ours_minus": bootstrap_difference(took[0], took[i]),
                }
                for i, (label, _, _) in enumerate(self.methods)
            ],
        }


def table(figures: Figures) -> Table:
    """One row a method."""
    sets = figures["sets"]
    return Table(
        (
            "generator", "first throws that hit", *(f"median miss, {s} [cm]" for s in sets),
            "trials", *(f"trials, {s}" for s in sets), "ours minus it",
        ),
        tuple(
            (
                row["label"],
                str(row["first"]),
                *(f"{100 * error:.1f}" for error in row["first_error_m"]),
                str(row["trials"]),
                *(f"{trials:.2f}" for trials in row["trials_of_each"]),
                f"{row['ours_minus']:+.2f}" if i else "",
            )
            for i, row in enumerate(figures["rows"])
        ),
    )  # fmt: skip


RECIPE = Recipe(
    "preset", "The paper's preset in full", "not in the paper", PaperPreset(), table,
    by_name_only=True,
)  # fmt: skip
