"""Sequences of goals, worked through one after another, with or without memory of earlier goals.

In physics, or by the thousand on a displacement field.

Ours; the paper starts every goal from the demonstrations alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.adapters import make_adapter
from prior_reinforce.environment import Task
from prior_reinforce.perception import make_perception
from prior_reinforce.simulation.protocol import run_sequences
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import GOAL_SEED, LearnedGenerator, Training
from reproduction.fields import Change, Conditions, FieldTask, MeasuredField
from reproduction.results import Row, as_text
from reproduction.units import Unit


@dataclass(frozen=True, kw_only=True)
class InSequence(Unit):
    """Work through sequences of goals with one adapter."""

    adapter: str
    """Adapter, by its choice."""
    carry_over: bool
    """Whether earlier goals' trials serve later ones."""
    perception: str = "eye"
    """Perception, by its choice."""
    goals: int = 8
    """Goals in each."""
    rounds: int = 10
    """Trials a goal at most."""
    seed: int = GOAL_SEED
    """Seed of the goals; decisions are made on other seeds than the reported one."""

    @property
    def _how(self) -> str:
        return f"{self.adapter}{', carried' if self.carry_over else ''}"

    def _try(
        self, task: Task, learned: LearnedGenerator, n: int, seed: int, seed_of_perception: int
    ) -> dict[str, Any]:
        """Which trial reached each goal, and what was said before each trial and came of it."""
        goals = task.sample_goals(n * self.goals, np.random.default_rng(self.seed))
        with make_perception(
            self.perception, scene=task.scene, seed=seed_of_perception
        ) as perception:
            results = run_sequences(
                task,
                learned.generator,
                lambda: make_adapter(self.adapter),
                perception,
                learned.prior,
                goals.reshape(n, self.goals, -1),
                carry_over=self.carry_over,
                rounds=self.rounds,
                seed=seed,
            )
        trials = [trial for of_one in results for goal in of_one for trial in goal.trials]
        return {
            "solved_at": [[goal.solved_at or 0 for goal in of_one] for of_one in results],
            "expected": [
                [trial.expected.p_hit, trial.hit]
                for trial in trials
                if trial.expected.p_hit is not None
            ],
            "first_error": [[float(np.linalg.norm(g.errors[0])) for g in of] for of in results],
        }

    def _rows(self, shared: Row, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal; results of before first errors were kept leave their cells empty."""
        said, rows = iter(result["expected"]), []
        shared = {
            **shared, "adapter": self.adapter, "remembers": self.carry_over,
            "perception": self.perception, "rounds": self.rounds,
        }  # fmt: skip
        for i, of_one in enumerate(result["solved_at"]):
            for j, solved_at in enumerate(of_one):
                before = [p for p, _ in islice(said, solved_at or self.rounds)]
                off = round(result["first_error"][i][j], 5) if "first_error" in result else None
                row = {"sequence": i, "goal": j, "solved_at": solved_at, "first_error": off}
                rows.append({**shared, **row, "p_hit": as_text(before, 3) if before else None})
        return rows


@dataclass(frozen=True)
class Afternoons(InSequence):
    """With one learned generator."""

    training: Training
    """What was learned."""
    task: str
    """Where it is tried; another hardware variant than the training's, perhaps."""
    sequences: int
    """Number of sequences."""

    def __str__(self) -> str:
        return f"{self.task}: sequences with {self._how}, {self.training}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Run them in lock step, and keep plain numbers, a row a sequence."""
        task, seed = make_task(self.task), self.seed + self.training.seed
        return self._try(task, self.training.learned(folder), self.sequences, seed, seed)

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        return self._rows({**self.training.columns, "task": self.task}, result)


@dataclass(frozen=True)
class FieldAfternoons(InSequence):
    """A sequence on a field."""

    measured: MeasuredField
    """Where."""
    change: Change = field(default_factory=Change)
    """What is different since it was measured."""

    def __str__(self) -> str:
        return f"{self._how}, {str(self.measured).removeprefix('measure ')}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Work through it, and keep plain numbers; one row, of the one sequence."""
        task = FieldTask(self.measured.field(folder), self.change)
        prior = task.demonstrations("own")
        learned = LearnedGenerator(Conditions().fit(prior, seed=0), prior)
        return self._try(task, learned, 1, self.seed + self.measured.labels, self.seed)

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        of = self.measured
        shared = {
            "learned_on": of.learned_on, "set": of.demonstrations, "seed": of.labels,
            "count": of.count or None, "generator": of.generator, "labels": of.perception,
            "task": of.task,
        }  # fmt: skip
        return self._rows(shared, result)
