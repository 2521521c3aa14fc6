"""Stage-2 trials by eye: five unseen goals a set, as in the paper, and many (paper, Table II)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import Family, Recipe, Run, Scale, Table
from prior_reinforce.experiments.recipes.success import interval_of, solved_at, trainings_of
from prior_reinforce.experiments.statistics import bootstrap_mean


class TrialsByEye(Recipe):
    """Stage-2 trials on the basketball task, with errors judged by eye."""

    name: ClassVar[str] = "eye"
    title: ClassVar[str] = "Trials by eye"
    paper: ClassVar[str] = "Table II, row 1"
    family: ClassVar[Family | None] = "adapter"

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """Diffusion, on misaligned demonstrations."""
        return trainings_of(scale, "diffusion")

    def run(self, run: Run) -> dict[str, Any]:
        """Try unseen goals and uniform ones."""
        scale = run.scale
        trainings = self.trainings(scale, run.include)
        run.results(trainings)
        rows: dict[str, Any] = {}
        for adapter in ("gp", *run.include):
            for name, goals, unseen in (("unseen", 5, True), ("uniform", scale.goals, False)):
                units = [
                    Trials(t, t.task, adapter, "eye", goals, unseen=unseen, rounds=scale.rounds)
                    for t in trainings
                ]
                solved = solved_at(run, units)
                # A goal not reached counts with all rounds and one more: never flattering.
                trials = np.where(solved > 0, solved, scale.rounds + 1)
                rows[f"{adapter}, {name} goals"] = {
                    "trials": asdict(bootstrap_mean(trials)),
                    "sd": float(trials.std()),
                    "not_reached": int(np.sum(solved == 0)),
                    "total": 6 + float(trials.mean()),
                }
        return {"trials": rows, "paper": {"trials": 2.9, "sd": 0.9, "total": 8.9}}

    def table(self, figures: Mapping[str, Any]) -> Table:
        """One row a kind of goals, and the paper's."""
        rows = [
            (
                goals,
                str(interval_of(row["trials"])),
                f"{row['sd']:.1f}",
                f"{row['total']:.1f}",
                str(row["not_reached"]),
            )
            for goals, row in figures["trials"].items()
        ]
        return Table(
            ("goals", "Stage-2 trials", "sd", "total N", "not reached"),
            (*rows, ("paper, real arm", "2.9", "0.9", "8.9", "")),
        )
