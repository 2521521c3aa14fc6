"""The paper's table of trials: every task and every sense, on few goals and on many (Table II).

A row is run under the paper's protocol (five unseen goals for each prior set) and beside it on
uniformly drawn goals, both for several training seeds. Demonstrations are executed once and their
outcomes perceived as in the row's trials (paper, Stage 1). V2 and V3 use what was learned from V1's
demonstrations and their outcomes on V1, unchanged. A goal that is not reached counts as one trial
more than there were rounds: never flattering.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from reproduction.evaluation import Training
from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Columns, Table
from reproduction.results import FIRST, TRIALS, Results
from reproduction.statistics import Interval

CAMERA = "camera"
"""The perception that reads the pictures where no model is asked."""
_UNSEEN_GOALS = 5
"""Goals a prior set (paper, Section V-A)."""
_PICTURE_GOALS = 30
_PICTURE_SEEDS = 2
"""Most uniformly drawn goals, and training seeds a prior set, where trials are seen in pictures
(ours): drawing and reading one takes ten times as long as simulating a throw, and what is learned
from demonstrations seen in pictures serves these rows alone."""


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

    @property
    def looks(self) -> str:
        """Who looks, in a word."""
        return "camera" if self.by_model else "eye"

    def sense(self, model: VisionLanguageModelConfig | None) -> str:
        """How it is seen; the camera stands in where no model is asked."""
        if not self.by_model:
            return "eye"
        return f"VLM ({model.model})" if model else "camera (objects found by colour)"

    def perception(self, model: VisionLanguageModelConfig | None) -> str:
        """The same as a choice of perception."""
        return "eye" if not self.by_model else "vlm" if model else CAMERA


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


def units(scale: Scale, include: Sequence[str] = (), generator: str = "diffusion") -> list[Planned]:
    """The paper's number of goals, and many, through every sense."""
    planned: list[Planned] = []
    for row in ROWS:
        if row.by_model and not scale.read_pictures:
            continue
        learned, model = trainings(row, scale, generator), scale.model if row.by_model else None
        goals = min(scale.goals, _PICTURE_GOALS) if row.by_model else scale.goals
        planned += [(t.perceived, {}) for t in learned if t.perceived and t.task == row.task]
        planned += [
            (
                scale.trials(
                    training, adapter, row.perception(scale.model), task=row.task, model=model,
                    goals=_UNSEEN_GOALS if unseen else goals, unseen=unseen,
                ),
                {"method": adapter, "condition": f"{row.title}, {row.sense(scale.model)}"},
            )
            for adapter in ("gp-two-term", *include)
            for unseen in (True, False)
            for training in learned
        ]  # fmt: skip
    return planned


def trainings(row: PaperRow, scale: Scale, generator: str) -> list[Training]:
    """What a row's trials start from, its demonstrations perceived as the trials are."""
    perception, model = row.perception(scale.model), scale.model if row.by_model else None
    seeds = scale.seeds[: _PICTURE_SEEDS if row.by_model else None]
    learned = replace(scale, seeds=seeds).trainings(
        generator, row.learned_on, perception=perception
    )
    return [replace(training, model=model) for training in learned]


def told(results: Results, method: str = "gp-two-term") -> list[tuple[PaperRow, Results]]:
    """The paper's rows that were run, each with its trials."""
    of = results.where(method=method)
    by_sense = [
        (row, of.where(task=row.task, perception=("camera", "vlm") if row.by_model else "eye"))
        for row in ROWS
    ]
    return [(row, rows) for row, rows in by_sense if not rows.empty]


def papers_procedure(of: Results) -> tuple[float, float, int]:
    """Mean and standard deviation of the runs that the paper has: unseen goals, one seed."""
    trials = TRIALS.of(of.where(unseen=True, seed=of.frame["seed"].min()).frame)
    return float(trials.mean()), float(trials.std(ddof=1)), len(trials)


def table(results: Results) -> Table:
    """The paper's columns, its own numbers beside them."""

    def sense(row: PaperRow, of: Results, method: str) -> str:
        seen = str(of.first("condition")).removeprefix(f"{row.title}, ")
        return seen if method == "gp-two-term" else f"{seen}, {method}"

    def ten(of: Results) -> str:
        mean, sd, runs = papers_procedure(of)
        return f"{mean:.1f} ± {sd:.1f} ({runs})"

    rows = {
        (row.title, sense(row, of, method)): (row, of, of.where(unseen=False))
        for method in results.by("method")
        for row, of in told(results, method)
    }
    columns: Columns = {
        "prior": lambda r: r[0].prior,
        "the paper's procedure: mean ± sd (runs)": lambda r: ten(r[1]),
        "trials, unseen goals": lambda r: r[1].where(unseen=True).mean(TRIALS),
        "trials, uniform goals": lambda r: r[2].mean(TRIALS),
        "total": lambda r: f"{r[0].prior + r[2].mean(TRIALS).value:.1f}",
        "not reached": lambda r: f"{(r[1].frame['solved_at'] == 0).sum()} of {r[1].n}",
        "first trials that hit, uniform goals": lambda r: r[2].mean(FIRST),
        "paper: trials (total)": lambda r: (
            f"{r[0].trials:.1f} ± {r[0].sd:.1f} ({r[0].prior + r[0].trials:.1f})"
        ),
    }
    return Table.of(("task", "sense"), rows, columns)


def draw(results: Results, folder: Path) -> list[Picture]:
    """All rows beside the paper's."""
    from prior_reinforce.report.style import GOAL
    from reproduction.recipes.charts import COLOURS, Mark, draw_rows

    def spread(mean: float, sd: float) -> Interval:
        return Interval(mean, mean - sd, mean + sd)

    rows = told(results)
    many = [of.where(unseen=False).mean(TRIALS) for _, of in rows]
    papers = [spread(row.trials, row.sd) for row, _ in rows]
    runs = [papers_procedure(of) for _, of in rows]
    few = [spread(mean, sd) for mean, sd, _ in runs]
    marks = {
        "paper, ten runs on a real arm: mean ± standard deviation of a run": Mark(
            "D", GOAL, papers
        ),
        f"ours, {runs[0][2]} simulated runs by that procedure: the same": Mark(
            "s", COLOURS[5], few
        ),
        "ours, uniform goals: mean and its 95 % interval": Mark("o", COLOURS[0], many),
    }
    labels = [of.first("condition") for _, of in rows]
    path = draw_rows(labels, marks, "Stage-2 trials to the first hit", folder / "trials.png")
    caption = (
        "Stage-2 trials to the first hit. Wide bars: how far single runs spread (standard "
        "deviation), the paper's and ours by its procedure. Narrow ones: how far the mean is "
        "known (95 % interval over sets and goals)."
    )
    return [Picture(path, caption)]


def remarks(results: Results) -> list[str]:
    """Who read the pictures."""
    read = results.where(perception=(CAMERA, "vlm"))
    if read.empty:
        return []
    reader = "a camera that finds objects by colour to a centimetre, not a model"
    if CAMERA not in set(read.frame["perception"]):
        reader = "the model that its rows name"
    return [
        f"The pictures of rows not seen by eye were read by {reader}; "
        f"{read.frame['failed_readings'].sum():.0f} of them could not be read and were judged by "
        f"eye. Drawing them takes long, so these rows have at most {_PICTURE_GOALS} uniformly "
        f"drawn goals a training, and {_PICTURE_SEEDS} training seeds a prior set."
    ]


RECIPE = Recipe(
    "trials", "Trials to reach a new goal", "Table II", units, table, draw, remarks,
    family="adapter",
)  # fmt: skip
