"""The paper's table of trials: every task and every sense, on few goals and on many.

A row is run under the paper's protocol (five unseen goals for each prior set) and beside it on
uniformly drawn goals, both for several training seeds. Demonstrations are executed once and seen as
the row's trials are (paper, Stage 1). V2 and V3 use what was learned from V1's demonstrations and
their outcomes on V1, unchanged. A goal that is not reached counts as one trial more than there were
rounds: never flattering.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import (
    Family,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.experiments.recipes.claims import Claim
from prior_reinforce.experiments.recipes.success import interval_of
from prior_reinforce.experiments.recipes.trials_claims import trials_claims
from prior_reinforce.experiments.recipes.trials_picture import TrialsRow, draw_trials
from prior_reinforce.experiments.recipes.trials_rows import ROWS, PaperRow, sense_of
from prior_reinforce.experiments.sight import MODEL, STAND_IN
from prior_reinforce.experiments.statistics import (
    SHARE,
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    reached_by,
    trials_counted,
)
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

_UNSEEN_GOALS = 5
"""Goals a prior set (paper, Section V-A)."""
_MODEL_GOALS = 30
_MODEL_SEEDS = 2
"""Most uniformly drawn goals, and training seeds a prior set, where trials are seen in pictures
(ours): drawing and reading one takes ten times as long as simulating a throw, and what is learned
from demonstrations seen in pictures serves these rows alone."""


_Solved = Mapping[tuple[PaperRow, str], tuple[np.ndarray, np.ndarray]]
"""Of a row and an adapter: in which trial each unseen goal and each of the many was reached, shapes
(trainings, goals)."""


@dataclass(frozen=True)
class TrialsTable(Recipe):
    """Stage-2 trials of every row."""

    name: ClassVar[str] = "trials"
    title: ClassVar[str] = "Trials to reach a new goal"
    paper: ClassVar[str] = "Table II"
    family: ClassVar[Family | None] = "adapter"

    rows: tuple[PaperRow, ...] = ROWS
    """Which rows."""
    generator: str = "diffusion"
    """What is learned."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint that reads the pictures; None for the stand-in that finds objects by colour."""

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """One for each task with demonstrations, sense, prior set and seed."""
        rows = self._rows(scale)
        return list(dict.fromkeys(t for row in rows for t in self._trainings(row, scale)))

    def run(self, run: Run) -> dict[str, Any]:
        """Try the paper's number of goals, and many, through every sense."""
        scale = run.scale
        rows = self._rows(scale)
        judged_by_eye = run.learn(self.trainings(scale, run.include))
        tried = [(row, adapter) for row in rows for adapter in ("gp", *run.include)]
        units = {
            (row, adapter, unseen): self._units(row, adapter, scale, unseen=unseen)
            for row, adapter in tried
            for unseen in (True, False)
        }
        # All at once, so that no core waits for one row's last unit.
        results = iter(run.results([unit for some in units.values() for unit in some]))
        got = {key: [next(results) for _ in some] for key, some in units.items()}
        at = {key: np.array([r["solved_at"] for r in some]) for key, some in got.items()}
        solved = {(row, a): (at[row, a, True], at[row, a, False]) for row, a in tried}
        by_eye = {row.task: row for row in rows if not row.by_model}
        return {
            "rounds": scale.rounds,
            "generator": self.generator,
            "model": STAND_IN if self.model is None else self.model.model,
            "readings_judged_by_eye": judged_by_eye
            + sum(sum(result["failed_readings"]) for some in got.values() for result in some),
            "rows": [
                {
                    **asdict(row),
                    "adapter": adapter,
                    "trainings": len(many),
                    "unseen": _summary(unseen, scale.rounds),
                    "many": _summary(many, scale.rounds),
                    "first_throws": asdict(first_throws_that_hit(many)),
                }
                for (row, adapter), (unseen, many) in solved.items()
            ],
            "eye_minus_model": {
                row.task: asdict(self._eye_minus_model(by_eye[row.task], row, solved, scale))
                for row in rows
                if row.by_model and row.task in by_eye
            },
        }

    def table(self, figures: Mapping[str, Any]) -> Table:
        """The paper's columns, its own numbers beside them."""
        return Table(
            (
                "task", "sense", "prior", "trials, unseen goals", "trials, many goals", "total",
                "not reached", "first throws that hit, many goals", "paper: trials (total)",
            ),
            tuple(
                (
                    row["title"],
                    sense_of(row, figures) + _own(row["adapter"]),
                    str(row["prior"]),
                    _trials(row["unseen"]),
                    _trials(row["many"]),
                    f"{row['prior'] + row['many']['trials']['value']:.1f}",
                    f"{row['unseen']['not_reached'] + row['many']['not_reached']} of "
                    f"{row['unseen']['goals']} + {row['many']['goals']}",
                    str(interval_of(row["first_throws"])),
                    f"{row['trials']:.1f} ± {row['sd']:.1f} ({row['prior'] + row['trials']:.1f})",
                )
                for row in figures["rows"]
            ),
        )  # fmt: skip

    def draw(self, figures: Mapping[str, Any], folder: Path) -> list[Picture]:
        """All rows beside the paper's."""
        rows = [
            TrialsRow(
                f"{row['title']}, {sense_of(row, figures)}",
                interval_of(row["unseen"]["trials"]),
                interval_of(row["many"]["trials"]),
                row["trials"],
                row["sd"],
            )
            for row in figures["rows"]
            if row["adapter"] == "gp"
        ]
        read = figures["model"] == STAND_IN and any(row["by_model"] for row in figures["rows"])
        stand_in = (
            " The stand-in finds objects by colour in the very pictures that a model would be sent."
        )
        path = draw_trials(rows, folder / f"{self.name}.png")
        return [
            Picture(
                path,
                "Mean Stage-2 trials to the first hit, with 95 % intervals over trainings and "
                "goals, beside the paper's mean and standard deviation on a real arm."
                + (stand_in if read else ""),
            )
        ]

    def claims(self, figures: Mapping[str, Any]) -> list[Claim]:
        """Each mean is at most the paper's; first throws miss; a VLM needs fewer than an eye."""
        return trials_claims(figures)

    def remarks(self, figures: Mapping[str, Any]) -> list[str]:
        """Who read the pictures."""
        if not any(row["by_model"] for row in figures["rows"]):
            return []
        reader = figures["model"]
        if reader == STAND_IN:
            reader = "a stand-in that finds objects by colour, not by a model"
        return [
            f"The pictures of the VLM rows were read by {reader}; "
            f"{figures['readings_judged_by_eye']} of them could not be read and were judged by "
            f"eye. Drawing them takes long, so these rows have at most {_MODEL_GOALS} uniformly "
            f"drawn goals a training, and {_MODEL_SEEDS} training seeds a prior set."
        ]

    def _rows(self, scale: Scale) -> list[PaperRow]:
        return [row for row in self.rows if scale.read_pictures or not row.by_model]

    def _seen_by(self, row: PaperRow) -> str:
        if not row.by_model:
            return "eye"
        return STAND_IN if self.model is None else MODEL

    def _trainings(self, row: PaperRow, scale: Scale) -> list[Training]:
        return [
            Training(
                row.learned_on,
                name,
                self.generator,
                seed,
                perception=self._seen_by(row),
                model=self.model if row.by_model else None,
            )
            for name in scale.sets
            for seed in scale.seeds[: _MODEL_SEEDS if row.by_model else None]
        ]

    def _units(self, row: PaperRow, adapter: str, scale: Scale, *, unseen: bool) -> list[Trials]:
        """One row's units, one a training."""
        goals = min(scale.goals, _MODEL_GOALS) if row.by_model else scale.goals
        return [
            Trials(
                training,
                row.task,
                adapter,
                self._seen_by(row),
                _UNSEEN_GOALS if unseen else goals,
                unseen=unseen,
                rounds=scale.rounds,
                model=self.model if row.by_model else None,
            )
            for training in self._trainings(row, scale)
        ]

    def _eye_minus_model(
        self, eye: PaperRow, model: PaperRow, solved: _Solved, scale: Scale
    ) -> Interval:
        """How many more trials it takes by eye, for the prior sets, seeds and goals of both.

        Goals are drawn one after another from one seed, so the smaller sample begins the larger.
        """
        by_eye = self._trainings(eye, scale)
        same = [
            by_eye.index(replace(training, perception="eye", model=None))
            for training in self._trainings(model, scale)
        ]
        read = solved[model, "gp"]
        judged = solved[eye, "gp"][0][same], solved[eye, "gp"][1][same, : read[1].shape[1]]
        return bootstrap_difference(
            trials_counted(np.hstack(judged), scale.rounds),
            trials_counted(np.hstack(read), scale.rounds),
        )


def first_throws_that_hit(solved: np.ndarray) -> Interval:
    """Share of the goals that the first trial reached.

    Nothing was told before it: its condition is the goal itself, to half a millimetre that the
    Gaussian process makes of the demonstrations (docs/evidence.md).

    Args:
        solved: Trial that reached each goal, 0 where none did, shape (trainings, goals).
    """
    return bootstrap_mean(reached_by(solved, 1), within=SHARE)


def _summary(solved: np.ndarray, rounds: int) -> dict[str, Any]:
    trials = trials_counted(solved, rounds)
    return {
        "goals": int(solved.size),
        "trials": asdict(bootstrap_mean(trials, within=(1, rounds + 1))),
        "sd": float(trials.std(ddof=1)),
        "not_reached": int(np.sum(solved == 0)),
    }


def _own(adapter: str) -> str:
    return "" if adapter == "gp" else f", {adapter}"


def _trials(summary: Mapping[str, Any]) -> str:
    interval = interval_of(summary["trials"])
    return f"{interval.value:.1f} ± {summary['sd']:.1f} [{interval.low:.2f}, {interval.high:.2f}]"
