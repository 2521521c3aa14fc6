"""The paper's table of trials: every task and every sense, on few goals and on many (Table II).

A row is run under the paper's protocol (five unseen goals for each prior set) and beside it on
uniformly drawn goals, both for several training seeds. Demonstrations are executed once and their
outcomes perceived as in the row's trials (paper, Stage 1). V2 and V3 use what was learned from V1's
demonstrations and their outcomes on V1, unchanged. A goal that is not reached counts as one trial
more than there were rounds: never flattering.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from prior_reinforce.lab.experiments.claims import Claim, Verdict, above, all_of, at_most
from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.statistics import (
    SHARE,
    Interval,
    Values,
    bootstrap_difference,
    bootstrap_mean,
    reached_by,
    trials_counted,
)
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

CAMERA = "camera"
"""The perception that reads the pictures where no model is asked."""
_UNSEEN_GOALS = 5
"""Goals a prior set (paper, Section V-A)."""
_PICTURE_GOALS = 30
_PICTURE_SEEDS = 2
"""Most uniformly drawn goals, and training seeds a prior set, where trials are seen in pictures
(ours): drawing and reading one takes ten times as long as simulating a throw, and what is learned
from demonstrations seen in pictures serves these rows alone."""
_HALF = 0.5
"""Ours: the paper says "often" without a number."""


@dataclass(frozen=True)
class PaperRow:
    """One row of the paper's table: Stage-2 trials on a real arm, their mean and deviation."""

    title: str
    task: str
    learned_on: str
    """The task whose demonstrations are learned from."""
    by_model: bool
    """Whether a model looks at pictures; else a person estimates by eye."""
    prior: int
    """|D_prior|."""
    trials: float
    sd: float


ROWS = (
    PaperRow("Basketball Shot", "basketball-v1", "basketball-v1", False, 6, 2.9, 0.9),
    PaperRow("Basketball Shot", "basketball-v1", "basketball-v1", True, 6, 2.1, 1.1),
    PaperRow("Curling", "curling", "curling", False, 6, 3.4, 1.1),
    PaperRow("Curling", "curling", "curling", True, 6, 3.0, 1.2),
    PaperRow("Fishing Rod Swinging", "fishing", "fishing", False, 8, 2.0, 0.8),
    PaperRow("Basketball Shot V2", "basketball-v2", "basketball-v1", False, 6, 3.2, 0.7),
    PaperRow("Basketball Shot V3", "basketball-v3", "basketball-v1", False, 6, 3.7, 1.5),
)
"""Table II of the paper, in its order."""

_Solved = Mapping[tuple[PaperRow, str], tuple[Int[np.ndarray, "n few"], Int[np.ndarray, "n many"]]]
"""By row and adapter: in which trial each unseen goal and each of the many was reached, a row a
training."""


@dataclass(frozen=True)
class TrialsTable(Measurement):
    """Stage-2 trials of every row."""

    rows: tuple[PaperRow, ...] = ROWS
    """Which rows."""
    generator: str = "diffusion"
    """What is learned."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint that reads the pictures; None for the camera that finds objects by colour."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """One for each task with demonstrations, sense, prior set and seed."""
        rows = self._rows(scale)
        return list(dict.fromkeys(t for row in rows for t in self._trainings(row, scale)))

    def run(self, run: Run) -> dict[str, Any]:
        """Try the paper's number of goals, and many, through every sense."""
        scale = run.scale
        rows = self._rows(scale)
        judged_by_eye = run.learn(self.trainings(scale))
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
            "model": CAMERA if self.model is None else self.model.model,
            "readings_judged_by_eye": judged_by_eye
            + sum(sum(result["failed_readings"]) for some in got.values() for result in some),
            "rows": [
                {
                    **asdict(row),
                    "adapter": adapter,
                    "trainings": len(many),
                    "unseen": _summary(unseen, scale.rounds),
                    "many": _summary(many, scale.rounds),
                    "first_throws": first_throws_that_hit(many),
                }
                for (row, adapter), (unseen, many) in solved.items()
            ],
            "eye_minus_model": {
                row.task: self._eye_minus_model(by_eye[row.task], row, solved, scale)
                for row in rows
                if row.by_model and row.task in by_eye
            },
        }

    def _rows(self, scale: Scale) -> list[PaperRow]:
        return [row for row in self.rows if scale.read_pictures or not row.by_model]

    def _seen_by(self, row: PaperRow) -> tuple[str, VisionLanguageModelConfig | None]:
        """Perception of a row, and the endpoint that it asks."""
        if not row.by_model:
            return "eye", None
        return (CAMERA if self.model is None else "vlm"), self.model

    def _trainings(self, row: PaperRow, scale: Scale) -> list[Training]:
        perception, model = self._seen_by(row)
        return [
            Training(row.learned_on, name, self.generator, seed, perception=perception, model=model)
            for name in scale.sets
            for seed in scale.seeds[: _PICTURE_SEEDS if row.by_model else None]
        ]

    def _units(self, row: PaperRow, adapter: str, scale: Scale, *, unseen: bool) -> list[Trials]:
        """One row's units, one a training."""
        perception, model = self._seen_by(row)
        goals = min(scale.goals, _PICTURE_GOALS) if row.by_model else scale.goals
        return [
            Trials(
                training,
                row.task,
                adapter,
                perception,
                _UNSEEN_GOALS if unseen else goals,
                unseen=unseen,
                rounds=scale.rounds,
                model=model,
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


def first_throws_that_hit(solved_at: Values) -> Interval:
    """Share of the goals that the first trial reached.

    Nothing was told before it: its condition is the goal itself, to half a millimetre that the
    Gaussian process makes of the demonstrations (docs/evidence.md).
    """
    return bootstrap_mean(reached_by(solved_at, 1), within=SHARE)


def _summary(solved_at: Values, rounds: int) -> dict[str, Any]:
    trials = trials_counted(solved_at, rounds)
    return {
        "goals": int(solved_at.size),
        "trials": bootstrap_mean(trials, within=(1, rounds + 1)),
        "sd": float(trials.std(ddof=1)),
        "not_reached": int(np.sum(solved_at == 0)),
    }


def _sense(row: Figures, figures: Figures) -> str:
    """How a row was seen."""
    if not row["by_model"]:
        return "eye"
    by_colour = figures["model"] == CAMERA
    return "camera (objects found by colour)" if by_colour else f"VLM ({figures['model']})"


def table(figures: Figures) -> Table:
    """The paper's columns, its own numbers beside them."""

    def missed(row: Figures) -> str:
        n, goals = (row["unseen"][key] + row["many"][key] for key in ("not_reached", "goals"))
        return f"{n} of {row['unseen']['goals']} + {goals - row['unseen']['goals']}"

    columns = {
        "task": lambda row: row["title"],
        "sense": lambda row: (
            _sense(row, figures) + ("" if row["adapter"] == "gp" else f", {row['adapter']}")
        ),
        "prior": lambda row: row["prior"],
        "trials, unseen goals": lambda row: _trials(row["unseen"]),
        "trials, many goals": lambda row: _trials(row["many"]),
        "total": lambda row: f"{row['prior'] + row['many']['trials'].value:.1f}",
        "not reached": missed,
        "first throws that hit, many goals": lambda row: row["first_throws"],
        "paper: trials (total)": lambda row: (
            f"{row['trials']:.1f} ± {row['sd']:.1f} ({row['prior'] + row['trials']:.1f})"
        ),
    }
    return Table.of(figures["rows"], columns)


def _trials(summary: Figures) -> str:
    interval = summary["trials"]
    return f"{interval.value:.1f} ± {summary['sd']:.1f} [{interval.low:.2f}, {interval.high:.2f}]"


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """All rows beside the paper's."""
    from prior_reinforce.lab.experiments.recipes.charts import COLOURS, Mark, draw_rows
    from prior_reinforce.report.style import GOAL

    rows = [row for row in figures["rows"] if row["adapter"] == "gp"]
    paper = [(row["trials"], row["sd"]) for row in rows]
    many, unseen = ([row[goals]["trials"] for row in rows] for goals in ("many", "unseen"))
    marks = {
        "paper, real arm (standard deviation)": Mark(
            "D", GOAL, [Interval(mean, mean - sd, mean + sd) for mean, sd in paper]
        ),
        "ours, many goals (95 % interval)": Mark("o", COLOURS[0], many),
        "ours, five unseen goals a set (95 % interval)": Mark("s", COLOURS[5], unseen),
    }
    labels = [f"{row['title']}, {_sense(row, figures)}" for row in rows]
    label = "Stage-2 trials to the first hit"
    path = draw_rows(labels, marks, label, folder / "trials.png")
    caption = (
        "Mean Stage-2 trials to the first hit, with 95 % intervals over trainings and goals, "
        "beside the paper's mean and standard deviation on a real arm."
    )
    if _read(figures) and figures["model"] == CAMERA:
        caption += (
            " The camera's rows find objects by colour in the very pictures that a model would be "
            "sent."
        )
    return [Picture(path, caption)]


def claims(figures: Figures) -> list[Claim]:
    """Each mean is at most the paper's; first throws miss; a VLM needs fewer trials than an eye."""
    rows = [row for row in figures["rows"] if row["adapter"] == "gp"]
    return [
        *(_claim_of_mean(row, figures) for row in rows),
        *(_claim_of_first_throws(row, figures) for row in rows),
        *_claim_of_model(figures),
    ]


def _claim_of_mean(row: Figures, figures: Figures) -> Claim:
    # The paper's goals lie far from the demonstrations; a mean has to hold there and everywhere.
    unseen, many = (row[goals]["trials"] for goals in ("unseen", "many"))
    n = _speaking(row, figures)
    return Claim(
        f"{row['title']}, {_sense(row, figures)}: {row['trials']:.1f} trials on average (here: at "
        "most).",
        f"{unseen} on {row['unseen']['goals']} unseen goals, {many} on {row['many']['goals']} "
        "uniform ones",
        all_of([at_most(mean, row["trials"], n) for mean in (unseen, many)]),
    )


def _claim_of_first_throws(row: Figures, figures: Figures) -> Claim:
    hit = row["first_throws"]
    return Claim(
        "The goal itself as the condition often leads to inaccurate outcomes (here: the first "
        f"trial, in more than half of the cases; {row['title']}, {_sense(row, figures)}).",
        f"share reached at the first trial: {hit}",
        at_most(hit, _HALF, _speaking(row, figures)),
    )


def _claim_of_model(figures: Figures) -> list[Claim]:
    fewer = {task: value for task, value in figures["eye_minus_model"].items()}
    if not fewer:
        return []
    n = min(_speaking(row, figures) for row in figures["rows"] if row["task"] in fewer)
    verdicts = [above(interval, 0.0, n) for interval in fewer.values()]
    # Of "in some tasks" one is enough.
    some = Verdict.CONFIRMED if Verdict.CONFIRMED in verdicts else Verdict.OPEN
    if all(verdict is Verdict.NOT_CONFIRMED for verdict in verdicts):
        some = Verdict.NOT_CONFIRMED
    said = "; ".join(f"{task} {interval:+.2f}" for task, interval in fewer.items())
    measured = f"eye minus {figures['model']}, same goals: {said}"
    return [Claim("Seeing by a VLM slightly reduces the trials in some tasks.", measured, some)]


def _speaking(row: Figures, figures: Figures) -> int:
    """How many trainings speak for a row: none for a VLM's whose pictures the camera read."""
    return 0 if row["by_model"] and figures["model"] == CAMERA else int(row["trainings"])


def _read(figures: Figures) -> bool:
    """Whether there are rows whose trials were read from pictures."""
    return any(row["by_model"] for row in figures["rows"])


def remarks(figures: Figures) -> list[str]:
    """Who read the pictures."""
    if not _read(figures):
        return []
    reader = figures["model"]
    if reader == CAMERA:
        reader = "a camera that finds objects by colour to a centimetre, not by a model"
    return [
        f"The pictures of the VLM rows were read by {reader}; "
        f"{figures['readings_judged_by_eye']} of them could not be read and were judged by "
        f"eye. Drawing them takes long, so these rows have at most {_PICTURE_GOALS} uniformly "
        f"drawn goals a training, and {_PICTURE_SEEDS} training seeds a prior set."
    ]


RECIPE = Recipe(
    "trials", "Trials to reach a new goal", "Table II",
    TrialsTable(), table, draw, claims, remarks, family="adapter",
)  # fmt: skip
