"""Generators behind the same adapter, on demonstrations as recorded and aligned (paper, Figure 7a).

The paper does not say what its adapters see in this figure; here it is the amplified noise of its
other one, for all alike. Beside the network stand its controls: the same network untrained, the
closed form that `correction=spline` puts around it, and both together, so that what a network has
learned can be told from what is around it. Diffusion runs on demonstrations as recorded only: ours
finds the start times itself. Nothing random goes into fitting the nearest neighbours, DMPs and the
closed form; their "seeds" differ in execution and perception.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.generators.base import Generator, OnProgress
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.wrapping import Wrapper
from prior_reinforce.lab.experiments.claims import (
    LEAST_TRAININGS,
    Claim,
    above,
    above_by_round,
    all_of,
)
from prior_reinforce.lab.experiments.evaluation import (
    LearnedGenerator,
    Training,
    Trials,
    is_aligned,
)
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
    table_by_round,
    trainings_of,
)
from prior_reinforce.lab.experiments.statistics import (
    Values,
    difference_curve,
    mean_success_difference,
    success_curve,
)
from prior_reinforce.plans.motions import Demonstrations

_NOT_THE_PAPERS = {"control": " (control)", "other": " (not in the paper)"}
_FIRST_CLAIMED = 2
"""The round from which on one generator is to be above another: before it nothing was adapted."""
_MINUTES = "network.widths=32:64:128,network.activation=silu,training_steps=20000"
"""The paper's form at a size that a core learns in twenty minutes, with steps enough to come back
to its demonstrations (docs/decisions-generator.md)."""
PAPERS_FORM = f"diffusion-paper,{_MINUTES}"


@dataclass(frozen=True)
class Method:
    """One of the generators compared."""

    label: str
    """What it is called in tables and pictures."""
    generator: str
    """Its choice."""
    kind: Literal["method", "baseline", "control", "other"] = "baseline"
    """The paper's method, one of its baselines, a control, or what the paper does not have."""
    adapter: str = "gp"
    """What corrects its conditions, by its choice."""
    fresh: bool = False
    """Whether noise is drawn anew for every trial, as in "repeatedly generating actions"."""
    one_seed: bool = False
    """Whether it is learned once a prior set only, since that takes long."""

    @property
    def aligned(self) -> bool:
        """Whether it learns from aligned demonstrations."""
        return is_aligned(self.generator)

    def trainings(self, scale: Scale) -> list[Training]:
        """One for each prior set and seed."""
        return trainings_of(replace(scale, seeds=scale.seeds[: self._seeds]), self.generator)

    def trials(self, scale: Scale) -> list[Trials]:
        """Trials of each training."""
        kind = FreshNoiseTrials if self.fresh else Trials
        return [
            kind(t, t.task, self.adapter, "amplified", scale.goals, rounds=scale.rounds)
            for t in self.trainings(scale)
        ]

    @property
    def _seeds(self) -> int | None:
        return 1 if self.one_seed else None


class FreshNoise(Wrapper):
    """A network that is sampled anew whenever it is asked, so no function of the condition."""

    name: ClassVar[str] = "fresh-noise"

    def __init__(self, generator: Generator) -> None:
        """Wrap a fitted generator with a diffusion network in it, timed or not."""
        super().__init__(generator)
        self._asked, self._outcome_dim = 0, generator._fitted_to()

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        raise NotImplementedError("wrap what was fitted")

    def _generate(self, conditions: Points) -> Plans:
        self._asked += 1
        return self._sampled(self.generator).generate(conditions)

    def _sampled(self, generator: Generator) -> Generator:
        if isinstance(generator, Wrapper):
            outer = copy(generator)
            outer.generator = self._sampled(generator.generator)
            return outer
        assert isinstance(generator, DiffusionGenerator)
        return generator.sampled(shared_noise=False, seed=self._asked)


@dataclass(frozen=True)
class FreshNoiseTrials(Trials):
    """Trials for each of which the network of a training is sampled anew."""

    def learned(self, folder: Path) -> LearnedGenerator:
        """What was learned, sampled anew for every trial."""
        learned = self.training.learned(folder)
        return LearnedGenerator(FreshNoise(learned.generator), learned.prior)


METHODS = (
    Method("diffusion", "diffusion", "method"),
    Method("the paper's form of it", PAPERS_FORM, "method", one_seed=True),
    Method("diffusion, untrained", "diffusion,training_steps=0", "control"),
    Method("diffusion with correction", "diffusion,correction=spline", "other"),
    Method(
        "diffusion with correction, untrained",
        "diffusion,correction=spline,training_steps=0",
        "control",
    ),
    Method("closed form", "interpolation", "control"),
    Method("nearest neighbours", "nearest"),
    Method("DMP", "dmp,segmented=false"),
    Method("U-Net regression", "regression,timing=none"),
    Method("segmented DMP", "dmp", "other"),
    Method("nearest neighbours, aligned", "nearest,timing=align"),
    Method("DMP, aligned", "dmp,segmented=false,timing=align"),
    Method("U-Net regression, aligned", "regression,timing=align"),
    Method("closed form, aligned", "interpolation,timing=align", "control"),
    Method("diffusion, no adapter", "diffusion", "other", "frozen"),
    Method("the paper's form, no adapter", PAPERS_FORM, "other", "frozen", one_seed=True),
    Method("the paper's form, no adapter, fresh noise", PAPERS_FORM, "other", "frozen", True, True),
)
"""Ours, a network alone, and the paper's form; their controls; the paper's baselines; and diffusion
with no adapter, which repeats one plan or, as in the paper, draws noise for every trial."""


@dataclass(frozen=True)
class Generators(Measurement):
    """Success by round of the generators."""

    methods: tuple[Method, ...] = METHODS
    """What is compared; the first is ours."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Every method, on every prior set."""
        methods = self._methods(scale, include)
        return list(dict.fromkeys(t for m in methods for t in m.trainings(scale)))

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every generator."""
        scale, rounds = run.scale, run.scale.rounds
        methods = self._methods(scale, run.include)
        run.learn(self.trainings(scale, run.include))
        trials = [method.trials(scale) for method in methods]
        at = run.solved_at([unit for units in trials for unit in units])
        parts = np.split(at, np.cumsum([len(units) for units in trials])[:-1])
        solved = {method.label: part for method, part in zip(methods, parts, strict=True)}

        def paired(one: str, other: str) -> tuple[Values, Values]:
            """The trainings that both have: all, or those of the first seed."""
            a, b = solved[one], solved[other]
            if len(a) == len(b):
                return a, b
            every = len(scale.seeds)
            return (a[::every], b) if len(a) > len(b) else (a, b[::every])

        rows = []
        ours = methods[0]
        for method in methods:
            mine = solved[method.label]
            row: dict[str, Any] = {
                **asdict(method),
                "aligned": method.aligned,
                "trainings": len(mine),
                "success": success_curve(mine, rounds),
                "mean_minus": {
                    other.label: mean_success_difference(*paired(other.label, method.label), rounds)
                    for other in methods
                    if other.kind == "method" and other is not method
                },
                "solved_at": [" ".join(map(str, training)) for training in mine],
            }
            if method is not ours:
                row["ours_minus"] = difference_curve(*paired(ours.label, method.label), rounds)
            recorded = solved.get(_unaligned(method.label))
            if method.aligned and recorded is not None:
                row["alignment_gain"] = mean_success_difference(mine, recorded, rounds)
            rows.append(row)
        return {"trainings": scale.trainings, "rows": rows}

    def _methods(self, scale: Scale, include: Sequence[str]) -> tuple[Method, ...]:
        compared = (m for m in self.methods[1:] if scale.variants or m.kind == "baseline")
        known = (self.methods[0], *compared)
        given = {m.generator for m in known}
        return (*known, *(Method(name, name, "other") for name in include if name not in given))


def table(figures: Figures) -> Table:
    """One row a method."""
    rows = {
        row["label"] + _NOT_THE_PAPERS.get(row["kind"], "") + _few(row["trainings"]): row
        for row in figures["rows"]
    }
    success = {label: row["success"] for label, row in rows.items()}
    minus = {label: row["ours_minus"] for label, row in rows.items() if "ours_minus" in row}
    return table_by_round("generator", success, figures["rows"][0]["label"], minus)


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Two panels: as recorded, and aligned with diffusion beside."""
    from prior_reinforce.lab.experiments.recipes.charts import Line, Panel, draw_success

    rows = figures["rows"]
    # Lines that lie upon each other tell nothing: the table has the corrected and the frozen ones.
    shown = [row for row in rows if row["adapter"] == "gp" and "correction" not in row["label"]]
    names = list(dict.fromkeys(_unaligned(row["label"]) for row in shown))
    panels = []
    for title, aligned in (("as recorded", False), ("aligned in time", True)):
        lines = [
            Line(
                _unaligned(row["label"])
                + (" (as recorded)" if aligned and not row["aligned"] else ""),
                row["success"],
                place=names.index(_unaligned(row["label"])),
                dashed=row["kind"] in _NOT_THE_PAPERS,
            )
            for row in shown
            if row["aligned"] == aligned or row is rows[0]
        ]
        panels.append(Panel(title, lines))
    caption = (
        "Share of goals reached within so many rounds, Gaussian process with m = 2 and amplified "
        "noise behind every generator. Bars: 95 % intervals over trainings and goals. Dashed: "
        "controls, and what is not in the paper."
    )
    return [Picture(draw_success(panels, folder / "generators.png"), caption)]


def claims(figures: Figures) -> list[Claim]:
    """Above the baselines as recorded; alignment lifts them; still above."""
    trainings, ours = figures["trainings"], figures["rows"][0]
    named = ours["label"]
    baselines = [row for row in figures["rows"] if row["kind"] == "baseline"]
    recorded = [row for row in baselines if not row["aligned"]]
    aligned = [row for row in baselines if row["aligned"]]
    by_four = ours["success"][min(4, len(ours["success"])) - 1]
    gains = {_unaligned(row["label"]): row["alignment_gain"] for row in aligned}

    def by_round(row: Figures, says: str) -> Claim:
        curves = ours["success"], row["success"], row["ours_minus"]
        rounds = [r for r in (2, 4, 10) if r <= len(row["ours_minus"])]
        measured = [f"round {r} {row['ours_minus'][r - 1]:+.2f}" for r in rounds]
        return Claim(
            f"{says} at every round from {_FIRST_CLAIMED} on.",
            f"{named} minus it: {'; '.join(measured)}",
            above_by_round(*curves, _FIRST_CLAIMED, trainings),
        )

    return [
        Claim(
            "Over 90 % of the goals are reached within 4 rounds, demonstrations misaligned and "
            "noise amplified.",
            f"{named}: {by_four}",
            above(by_four, 0.9, trainings),
        ),
        *(by_round(row, f"Misaligned: diffusion is above {row['label']}") for row in recorded),
        *_forms_above(figures, recorded, "Misaligned: it is above all three"),
        Claim(
            "Timeline alignment significantly improves the other three generators.",
            "gain in the share reached, mean of all rounds: "
            + "; ".join(f"{label} {gain:+.2f}" for label, gain in gains.items()),
            all_of([above(gain, 0.0, trainings) for gain in gains.values()]),
        ),
        *(
            by_round(
                row,
                f"Aligned: {_unaligned(row['label'])} stays below diffusion on misaligned "
                "demonstrations,",
            )
            for row in aligned
        ),
        *_forms_above(figures, aligned, "Aligned: all three stay below it"),
    ]


def remarks(figures: Figures) -> list[str]:
    """Name every generator that is above ours."""
    if figures["trainings"] < LEAST_TRAININGS:
        return []
    ours, *others = figures["rows"]
    named = ours["label"]
    minus = {row["label"]: row["mean_minus"][named] for row in others}
    better = [f"{label} ({value:+.2f})" for label, value in minus.items() if value.high < 0]
    if not better:
        return []
    return [
        f"Measured above {named} on this task (it minus them, mean of all rounds): "
        f"{', '.join(better)}. Simpler generators are enough here; "
        "docs/baselines.md says why."
    ]


def _unaligned(label: str) -> str:
    """A label where it is plain from elsewhere that demonstrations are aligned."""
    return label.removesuffix(", aligned")


def _few(trainings: int) -> str:
    """Said of a row whose interval decides nothing."""
    return f" ({trainings} trainings)" if 1 < trainings < LEAST_TRAININGS else ""


def _forms_above(figures: Figures, baselines: Sequence[Figures], says: str) -> list[Claim]:
    """Hold the paper's form against its baselines, on the mean of all rounds."""
    claims = []
    for form in figures["rows"][1:]:
        if form["kind"] != "method" or not baselines:
            continue
        name = form["label"]
        minus = {row["label"]: row["mean_minus"][name] for row in baselines}
        measured = "; ".join(f"{label} {value:+.2f}" for label, value in minus.items())
        claims.append(
            Claim(
                f"{says}: {name} (mean of all rounds).",
                f"{name} minus {measured}; {form['trainings']} trainings",
                all_of([above(value, 0.0, form["trainings"]) for value in minus.values()]),
            )
        )
    return claims


RECIPE = Recipe(
    "generators", "Generators, on demonstrations as recorded and aligned", "Figure 7a",
    Generators(), table, draw, claims, remarks, family="generator",
)  # fmt: skip
