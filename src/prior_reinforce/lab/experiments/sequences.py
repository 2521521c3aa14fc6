"""Sequences of goals, worked through one after another, with or without memory of earlier goals.

In physics, or by the thousand on a displacement field.

Ours; the paper starts every goal from the demonstrations alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.adapters import make_adapter
from prior_reinforce.lab.experiments.evaluation import GOAL_SEED, Training
from prior_reinforce.lab.experiments.fields import Change, Conditions, FieldTask, MeasuredField
from prior_reinforce.lab.experiments.protocol import GoalTrials, run_sequences
from prior_reinforce.lab.experiments.results import as_text
from prior_reinforce.lab.experiments.units import Unit
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.perception import make_perception


@dataclass(frozen=True)
class Afternoons(Unit):
    """Work through sequences of goals with one learned generator and one adapter."""

    training: Training
    """What was learned."""
    task: str
    """Where it is tried; another hardware variant than the training's, perhaps."""
    adapter: str
    """Adapter, by its choice."""
    perception: str
    """Perception, by its choice."""
    carry_over: bool
    """Whether earlier goals' trials serve later ones."""
    sequences: int
    """Number of sequences."""
    goals: int = 8
    """Goals in each."""
    rounds: int = 10
    """Trials a goal at most."""
    seed: int = GOAL_SEED
    """Seed of the goals; decisions are made on other seeds than the reported one."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""
        carried = ", carried" if self.carry_over else ""
        return f"{self.task}: sequences with {self.adapter}{carried}, {self.training.label}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Run them in lock step, and keep plain numbers, a row a sequence."""
        task, learned = make_task(self.task), self.training.learned(folder)
        goals = task.sample_goals(self.sequences * self.goals, np.random.default_rng(self.seed))
        seed = self.seed + self.training.seed
        with make_perception(self.perception, scene=task.scene, seed=seed) as perception:
            results = run_sequences(
                task,
                learned.generator,
                lambda: make_adapter(self.adapter),
                perception,
                learned.prior,
                goals.reshape(self.sequences, self.goals, -1),
                carry_over=self.carry_over,
                rounds=self.rounds,
                seed=seed,
            )
        return _kept(results)

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        return _rows({**self.training.columns, "task": self.task}, self, result)


@dataclass(frozen=True)
class FieldAfternoons(Unit):
    """Work through a sequence of goals on a field with one adapter."""

    measured: MeasuredField
    """Where."""
    adapter: str
    """Adapter, by its choice."""
    carry_over: bool
    """Whether earlier goals' trials serve later ones."""
    change: Change = field(default_factory=Change)
    """What is different since it was measured."""
    perception: str = "eye"
    """Through which trials are seen."""
    goals: int = 8
    """In the sequence."""
    rounds: int = 10
    """Trials a goal at most."""
    seed: int = GOAL_SEED
    """Seed of the goals."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""
        carried = ", carried" if self.carry_over else ""
        return f"{self.adapter}{carried}, {self.measured.label.removeprefix('measure ')}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Work through them, and keep plain numbers; one row, of the one sequence."""
        task = FieldTask(self.measured.field(folder), self.change)
        prior = task.demonstrations("own")
        goals = task.sample_goals(self.goals, np.random.default_rng(self.seed))
        with make_perception(self.perception, seed=self.seed) as perception:
            results = run_sequences(
                task,
                Conditions().fit(prior, seed=0),
                lambda: make_adapter(self.adapter),
                perception,
                prior,
                goals[None],
                carry_over=self.carry_over,
                rounds=self.rounds,
                seed=self.seed + self.measured.labels,
            )
        return _kept(results)

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        of = self.measured
        told = {
            "learned_on": of.learned_on, "set": of.demonstrations, "seed": of.labels,
            "count": of.count or None, "generator": of.generator, "labels": of.perception,
            "task": of.task,
        }  # fmt: skip
        return _rows(told, self, result)


def _kept(results: Sequence[Sequence[GoalTrials]]) -> dict[str, Any]:
    """Which trial reached each goal, and what was said before each trial and came of it."""
    trials = [trial for of_one in results for goal in of_one for trial in goal.trials]
    return {
        "solved_at": [[goal.solved_at or 0 for goal in of_one] for of_one in results],
        "expected": [[trial.p_hit, trial.hit] for trial in trials if trial.p_hit is not None],
        "first_error": [[float(np.linalg.norm(g.errors[0])) for g in of_one] for of_one in results],
    }


def _rows(
    told: Mapping[str, Any], unit: Afternoons | FieldAfternoons, result: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """A row a goal; results of before first errors were kept leave their cells empty."""
    said, rows = iter(result["expected"]), []
    for i, of_one in enumerate(result["solved_at"]):
        for j, solved_at in enumerate(of_one):
            before = [p for p, _ in islice(said, solved_at or unit.rounds)]
            off = result["first_error"][i][j] if "first_error" in result else None
            rows.append(
                {
                    **told,
                    "adapter": unit.adapter,
                    "remembers": unit.carry_over,
                    "perception": unit.perception,
                    "rounds": unit.rounds,
                    "sequence": i,
                    "goal": j,
                    "solved_at": solved_at,
                    "first_error": None if off is None else round(off, 5),
                    "p_hit": as_text(before, 3) if before else None,
                }
            )
    return rows
