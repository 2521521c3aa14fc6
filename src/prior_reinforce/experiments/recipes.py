"""Recipes: one a figure or table of the paper. Each says which units it needs, and what they mean.

A recipe's numbers are a JSON file: what was run (seeds, goals, version, commit), and the figures
with their intervals.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.experiments.evaluation import GOAL_SEED, Training, Trials, ZeroShot
from prior_reinforce.experiments.statistics import (
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    reached_by,
)
from prior_reinforce.experiments.units import Unit, Workers, run_units

ADAPTERS = ("gp", "gp-all", "proportional", "frozen")


@dataclass(frozen=True)
class Scale:
    """How much of a recipe is run."""

    goals: int = 100
    """Goals a training, as in the paper."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    sets: tuple[str, ...] = ("A", "B")
    """Prior sets."""
    rounds: int = 10
    """Trials a goal at most."""


def adapters(
    folder: Path, scale: Scale, workers: Workers, progress: Progress, include: Sequence[str]
) -> dict[str, Any]:
    """Success by round of the adapters under amplified noise (paper, Figure 6b)."""
    trainings = _trainings(scale)
    solved = {
        name: _solved(
            [
                Trials(t, t.task, name, "amplified", scale.goals, rounds=scale.rounds)
                for t in trainings
            ],
            folder,
            workers,
            progress,
            first=trainings,
        )
        for name in (*ADAPTERS, *include)
    }
    rounds = range(1, scale.rounds + 1)
    return {
        "success": {
            name: [asdict(bootstrap_mean(reached_by(at, r))) for r in rounds]
            for name, at in solved.items()
        },
        "gp_minus": {
            name: [
                asdict(bootstrap_difference(reached_by(solved["gp"], r), reached_by(at, r)))
                for r in rounds
            ]
            for name, at in solved.items()
            if name != "gp"
        },
    }


def eye(
    folder: Path, scale: Scale, workers: Workers, progress: Progress, include: Sequence[str]
) -> dict[str, Any]:
    """Stage-2 trials by eye: five unseen goals a set, as in the paper, and many (Table II)."""
    trainings = _trainings(scale)
    result: dict[str, Any] = {}
    for adapter in ("gp", *include):
        for name, goals, unseen in (("unseen", 5, True), ("uniform", scale.goals, False)):
            solved = _solved(
                [
                    Trials(t, t.task, adapter, "eye", goals, unseen=unseen, rounds=scale.rounds)
                    for t in trainings
                ],
                folder,
                workers,
                progress,
                first=trainings,
            )
            # A goal that was not reached counts with all rounds and one more: never flattering.
            trials = np.where(solved > 0, solved, scale.rounds + 1)
            result[f"{adapter}, {name} goals"] = {
                "trials": asdict(bootstrap_mean(trials)),
                "sd": float(trials.std()),
                "not_reached": int(np.sum(solved == 0)),
                "total": 6 + float(trials.mean()),
            }
    return {"trials": result, "paper": {"trials": 2.9, "sd": 0.9, "total": 8.9}}


def zero_shot(
    folder: Path, scale: Scale, workers: Workers, progress: Progress, include: Sequence[str]
) -> dict[str, Any]:
    """How near generated plans come without any trial, and at the demonstrations' own outcomes."""
    rows: list[dict[str, Any]] = []
    for generator in ("diffusion", *include):
        units = [ZeroShot(t) for t in _trainings(scale, generator)]
        for unit, row in zip(units, run_units(units, folder, workers, progress), strict=True):
            rows.append({"generator": generator, **asdict(unit.training), **row["result"]})
    return {"rows": rows}


Progress = Callable[[int, int, str], None]
Recipe = Callable[[Path, Scale, Workers, Progress, Sequence[str]], dict[str, Any]]

RECIPES: Mapping[str, Recipe] = {"zero-shot": zero_shot, "adapters": adapters, "eye": eye}
"""Every recipe by its name on the command line."""


def provenance(scale: Scale) -> dict[str, Any]:
    """What made a result."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parent,
        check=False,
    )
    return {
        "version": version("prior-reinforce"),
        "commit": commit.stdout.strip() or "not a checkout",
        "scale": asdict(scale),
        "goal_seed": GOAL_SEED,
    }


def interval(values: Mapping[str, float]) -> Interval:
    """An interval as it was before it became JSON."""
    return Interval(**values)


def _trainings(scale: Scale, generator: str = "diffusion") -> list[Training]:
    return [
        Training("basketball-v1", name, generator, seed)
        for name in scale.sets
        for seed in scale.seeds
    ]


def _solved(
    units: Sequence[Trials],
    folder: Path,
    workers: Workers,
    progress: Progress,
    *,
    first: Sequence[Unit],
) -> np.ndarray:
    """Trial that reached each goal, 0 where none did, shape (units, goals)."""
    run_units(first, folder, workers, progress)
    rows = run_units(units, folder, workers, progress)
    return np.array([row["result"]["solved_at"] for row in rows])
