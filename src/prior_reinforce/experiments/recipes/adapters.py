"""Adapters under amplified noise, behind the same generators (paper, Figure 6b)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import Family, Recipe, Run, Scale, Table
from prior_reinforce.experiments.recipes.success import (
    difference_curve,
    interval_of,
    solved_at,
    success_curve,
    trainings_of,
)

ADAPTERS = ("gp", "gp-all", "proportional", "frozen")
_ROUNDS_SHOWN = (1, 2, 4, 8, 10)


class Adapters(Recipe):
    """Success by round of the adapters under amplified noise."""

    name: ClassVar[str] = "adapters"
    title: ClassVar[str] = "Adapters under amplified noise"
    paper: ClassVar[str] = "Figure 6b"
    family: ClassVar[Family | None] = "adapter"

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """Diffusion, on misaligned demonstrations."""
        return trainings_of(scale, "diffusion")

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every adapter."""
        scale = run.scale
        trainings = self.trainings(scale, run.include)
        run.results(trainings)
        solved = {
            name: solved_at(
                run,
                [
                    Trials(t, t.task, name, "amplified", scale.goals, rounds=scale.rounds)
                    for t in trainings
                ],
            )
            for name in (*ADAPTERS, *run.include)
        }
        return {
            "success": {name: success_curve(at, scale.rounds) for name, at in solved.items()},
            "gp_minus": {
                name: difference_curve(solved["gp"], at, scale.rounds)
                for name, at in solved.items()
                if name != "gp"
            },
        }

    def table(self, figures: Mapping[str, Any]) -> Table:
        """One row an adapter."""
        n_rounds = len(next(iter(figures["success"].values())))
        shown = [r for r in _ROUNDS_SHOWN if r <= n_rounds]
        return Table(
            ("adapter", *(f"by round {r}" for r in shown)),
            tuple(
                (name, *(str(interval_of(curve[r - 1])) for r in shown))
                for name, curve in figures["success"].items()
            ),
        )
