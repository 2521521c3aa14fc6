"""Generators behind the same adapter, on demonstrations as recorded and aligned (paper, Figure 7a).

The paper does not say what its adapters see in this figure; here it is the amplified noise of its
other one, for all alike. Diffusion runs on demonstrations as recorded only: our default finds the
start times itself, so aligned demonstrations are the same to it. Nothing random goes into fitting
the nearest neighbours, DMPs and the spline; their "seeds" differ in execution and perception.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from prior_reinforce.lab.experiments.claims import (
    LEAST_TRAININGS,
    Claim,
    above,
    above_by_round,
    all_of,
)
from prior_reinforce.lab.experiments.evaluation import Training, Trials, is_aligned
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
    difference_curve,
    mean_success_difference,
    success_curve,
)

_FIRST_CLAIMED = 2
"""The round from which on one generator is to be above another: before it nothing was adapted."""
_IN_FULL = {"diffusion": "our default (spline, timing and network)"}
"""What a label stands for, where a verdict rests on it."""


@dataclass(frozen=True)
class Method:
    """One of the generators compared."""

    label: str
    """What it is called in tables and pictures."""
    generator: str
    """Its choice."""
    kind: Literal["method", "baseline", "other"] = "baseline"
    """The paper's method, one of its baselines, or what the paper does not have."""

    @property
    def aligned(self) -> bool:
        """Whether it learns from aligned demonstrations."""
        return is_aligned(self.generator)


WHOLE_PLANS = "diffusion,timing=none,exact=no,trend=zero,training_steps=1000"
"""Diffusion without what we added to it; the network alone takes twice the steps."""
METHODS = (
    Method("diffusion", "diffusion", "method"),
    Method("diffusion on whole plans", WHOLE_PLANS, "method"),
    Method("nearest neighbours", "nearest"),
    Method("DMP", "dmp,segmented=false,exact=no"),
    Method("U-Net regression", "regression,timing=none,exact=no,trend=zero"),
    Method("segmented DMP", "dmp,exact=no", "other"),
    Method("nearest neighbours, aligned", "nearest,timing=align"),
    Method("DMP, aligned", "dmp,segmented=false,timing=align,exact=no"),
    Method("U-Net regression, aligned", "regression,timing=align,exact=no,trend=zero"),
    Method("smooth interpolation, aligned", "interpolation,timing=align", "other"),
    Method("U-Net regression with timing, trend and correction", "regression", "other"),
)
"""Our default, and a network alone on whole plans; the paper's baselines, without what we added to
diffusion; and, so that nothing is gained by these additions alone, others with them."""


@dataclass(frozen=True)
class Generators(Measurement):
    """Success by round of the generators."""

    methods: tuple[Method, ...] = METHODS
    """What is compared; the first is ours."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Every method, on every prior set."""
        methods = self._methods(scale, include)
        return [training for m in methods for training in trainings_of(scale, m.generator)]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every generator."""
        scale, rounds = run.scale, run.scale.rounds
        methods = self._methods(scale, run.include)
        trainings = self.trainings(scale, run.include)
        run.learn(trainings)
        units = [
            Trials(t, t.task, "gp", "amplified", scale.goals, rounds=rounds) for t in trainings
        ]
        at = run.solved_at(units).reshape(len(methods), scale.trainings, scale.goals)
        solved = {method.label: solved for method, solved in zip(methods, at, strict=True)}
        rows = []
        for method in methods:
            mine = solved[method.label]
            row: dict[str, Any] = {
                **asdict(method),
                "aligned": method.aligned,
                "success": success_curve(mine, rounds),
                "mean_minus": {
                    other.label: mean_success_difference(solved[other.label], mine, rounds)
                    for other in methods
                    if other.kind == "method" and other is not method
                },
            }
            if method is not methods[0]:
                row["ours_minus"] = difference_curve(at[0], mine, rounds)
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
        row["label"] + (" (not in the paper)" if row["kind"] == "other" else ""): row
        for row in figures["rows"]
    }
    success = {label: row["success"] for label, row in rows.items()}
    minus = {label: row["ours_minus"] for label, row in rows.items() if "ours_minus" in row}
    return table_by_round("generator", success, figures["rows"][0]["label"], minus)


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Two panels: as recorded, and aligned with diffusion beside."""
    from prior_reinforce.lab.experiments.recipes.charts import Line, Panel, draw_success

    rows = figures["rows"]
    names = list(dict.fromkeys(_unaligned(row["label"]) for row in rows))
    panels = []
    for title, aligned in (("as recorded", False), ("aligned in time", True)):
        lines = [
            Line(
                _unaligned(row["label"])
                + (" (as recorded)" if aligned and not row["aligned"] else ""),
                row["success"],
                place=names.index(_unaligned(row["label"])),
                dashed=row["kind"] == "other",
            )
            for row in rows
            if row["aligned"] == aligned or row is rows[0]
        ]
        panels.append(Panel(title, lines))
    caption = (
        "Share of goals reached within so many rounds, Gaussian process with m = 2 and amplified "
        "noise behind every generator. Bars: 95 % intervals over trainings and goals. Dashed: not "
        "in the paper."
    )
    return [Picture(draw_success(panels, folder / "generators.png"), caption)]


def claims(figures: Figures) -> list[Claim]:
    """Above the baselines as recorded; alignment lifts them; still above."""
    trainings, ours = figures["trainings"], figures["rows"][0]
    named = _IN_FULL.get(ours["label"], ours["label"])
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
        *_forms_above(recorded, "Misaligned: it is above all three", trainings),
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
        *_forms_above(aligned, "Aligned: all three stay below it", trainings),
    ]


def remarks(figures: Figures) -> list[str]:
    """Name every generator that is above ours."""
    if figures["trainings"] < LEAST_TRAININGS:
        return []
    ours, *others = figures["rows"]
    named = _IN_FULL.get(ours["label"], ours["label"])
    minus = {row["label"]: row["mean_minus"][ours["label"]] for row in others}
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


def _forms_above(baselines: Sequence[Figures], says: str, trainings: int) -> list[Claim]:
    """Hold a network on whole plans against its baselines, on the mean of all rounds."""
    forms = list(baselines[0]["mean_minus"])[1:] if baselines else []
    claims = []
    for form in forms:
        minus = {row["label"]: row["mean_minus"][form] for row in baselines}
        measured = "; ".join(f"{name} {value:+.2f}" for name, value in minus.items())
        claims.append(
            Claim(
                f"{says}: {form}, a network without start times, trend and spline (mean of all "
                "rounds).",
                f"{form} minus {measured}",
                all_of([above(value, 0.0, trainings) for value in minus.values()]),
            )
        )
    return claims


RECIPE = Recipe(
    "generators", "Generators, on demonstrations as recorded and aligned", "Figure 7a",
    Generators(), table, draw, claims, remarks, family="generator",
)  # fmt: skip
