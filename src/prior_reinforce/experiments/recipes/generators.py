"""Generators behind the same adapter, on demonstrations as recorded and aligned (paper, Figure 7a).

The paper does not say what its adapters see in this figure; here it is the amplified noise of its
other one, for all alike. Diffusion runs on demonstrations as recorded only: our default finds the
start times itself, so aligned demonstrations are the same to it. Nothing random goes into fitting
the nearest neighbours, DMPs and the spline; their "seeds" differ in execution and perception.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import (
    Family,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.experiments.recipes.claims import (
    LEAST_TRAININGS,
    Claim,
    Verdict,
    above,
    all_of,
)
from prior_reinforce.experiments.recipes.success import (
    difference_curve,
    interval_of,
    mean_success_difference,
    rounds_shown,
    solved_at,
    success_curve,
    trainings_of,
    verdict_by_round,
)
from prior_reinforce.experiments.recipes.success_picture import Line, Panel, draw_success

_FIRST_CLAIMED = 2
"""The round from which on one generator is to be above another: before it nothing was adapted."""


Kind = Literal["method", "baseline", "other"]


@dataclass(frozen=True)
class Method:
    """A generator, and what it learns from."""

    label: str
    """What it is called in tables and pictures."""
    generator: str
    """Name for `make_generator`."""
    aligned: bool
    """Whether it learns from aligned demonstrations."""
    kind: Kind = "baseline"
    """The paper's method, one of its baselines, or what the paper does not have."""


OURS = Method("diffusion", "diffusion", aligned=False, kind="method")
METHODS = (
    OURS,
    Method("diffusion on whole plans", "diffusion,timing=none", aligned=False, kind="method"),
    Method("nearest neighbours", "nearest", aligned=False),
    Method("DMP", "dmp,segmented=false", aligned=False),
    Method("U-Net regression", "regression,timing=none", aligned=False),
    Method("segmented DMP", "dmp", aligned=False, kind="other"),
    Method("nearest neighbours, aligned", "nearest", aligned=True),
    Method("DMP, aligned", "dmp,segmented=false", aligned=True),
    Method("U-Net regression, aligned", "regression,timing=none", aligned=True),
    Method("smooth interpolation, aligned", "interpolation", aligned=True, kind="other"),
)
"""Our default, and the same network on whole plans; the paper's baselines; and, so that nothing is
gained by start times alone, simple generators that know them too."""


@dataclass(frozen=True)
class Generators(Recipe):
    """Success by round of the generators."""

    name: ClassVar[str] = "generators"
    title: ClassVar[str] = "Generators, on demonstrations as recorded and aligned"
    paper: ClassVar[str] = "Figure 7a"
    family: ClassVar[Family | None] = "generator"

    methods: tuple[Method, ...] = METHODS
    """What is compared; the first is ours."""

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """Every method, on every prior set."""
        return [
            training
            for method in self._methods(scale, include)
            for training in trainings_of(scale, method.generator, aligned=method.aligned)
        ]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every generator."""
        scale = run.scale
        methods = self._methods(scale, run.include)
        trainings = self.trainings(scale, run.include)
        run.learn(trainings)
        units = [
            Trials(t, t.task, "gp", "amplified", scale.goals, rounds=scale.rounds)
            for t in trainings
        ]
        solved = solved_at(run, units).reshape(len(methods), scale.trainings, scale.goals)
        ours, rounds = solved[0], scale.rounds
        recorded = {m.generator: at for m, at in zip(methods, solved, strict=True) if not m.aligned}
        rows = []
        for method, at in zip(methods, solved, strict=True):
            row: dict[str, Any] = {
                **asdict(method),
                "success": success_curve(at, rounds),
                "mean_minus": {
                    other.label: asdict(mean_success_difference(theirs, at, rounds))
                    for other, theirs in zip(methods, solved, strict=True)
                    if other.kind == "method" and other is not method
                },
            }
            if method is not methods[0]:
                row["ours_minus"] = difference_curve(ours, at, rounds)
            if method.aligned and method.generator in recorded:
                row["alignment_gain"] = asdict(
                    mean_success_difference(at, recorded[method.generator], rounds)
                )
            rows.append(row)
        return {"trainings": scale.trainings, "rows": rows}

    def table(self, figures: Mapping[str, Any]) -> Table:
        """One row a method."""
        rows = figures["rows"]
        shown = rounds_shown(len(rows[0]["success"]))
        at = 4 if 4 in shown else shown[-1]
        return Table(
            (
                "generator",
                *(f"by round {r}" for r in shown),
                f"{rows[0]['label']} minus it, round {at}",
            ),
            tuple(
                (
                    row["label"] + (" (not in the paper)" if row["kind"] == "other" else ""),
                    *(str(interval_of(row["success"][r - 1])) for r in shown),
                    f"{interval_of(row['ours_minus'][at - 1]):+.2f}" if "ours_minus" in row else "",
                )
                for row in rows
            ),
        )

    def draw(self, figures: Mapping[str, Any], folder: Path) -> list[Picture]:
        """Two panels: as recorded, and aligned with diffusion beside."""
        rows = figures["rows"]
        names = list(dict.fromkeys(row["generator"] for row in rows))
        panels = []
        for title, aligned in (("as recorded", False), ("aligned in time", True)):
            lines = [
                Line(
                    _unaligned(row["label"])
                    + (" (as recorded)" if aligned and not row["aligned"] else ""),
                    row["success"],
                    place=names.index(row["generator"]),
                    dashed=row["kind"] == "other",
                )
                for row in rows
                if row["aligned"] == aligned or row is rows[0]
            ]
            panels.append(Panel(title, lines))
        path = draw_success(panels, folder / f"{self.name}.png")
        return [
            Picture(
                path,
                "Share of goals reached within so many rounds, Gaussian process with m = 2 and "
                "amplified noise behind every generator. Bars: 95 % intervals over trainings and "
                "goals. Dashed: not in the paper.",
            )
        ]

    def claims(self, figures: Mapping[str, Any]) -> list[Claim]:
        """Above the baselines as recorded; alignment lifts them; still above."""
        trainings, ours = figures["trainings"], figures["rows"][0]
        baselines = [row for row in figures["rows"] if row["kind"] == "baseline"]
        recorded = [row for row in baselines if not row["aligned"]]
        aligned = [row for row in baselines if row["aligned"]]
        by_four = interval_of(ours["success"][min(4, len(ours["success"])) - 1])
        gains = [interval_of(row["alignment_gain"]) for row in aligned]
        return [
            Claim(
                "Over 90 % of the goals are reached within 4 rounds, demonstrations misaligned and "
                "noise amplified.",
                f"{ours['label']}: {by_four}",
                above(by_four, 0.9, trainings),
            ),
            *(
                Claim(
                    f"Misaligned: diffusion is above {row['label']} at every round from "
                    f"{_FIRST_CLAIMED} on.",
                    _by_round(row, ours["label"]),
                    _verdict(ours, row, trainings),
                )
                for row in recorded
            ),
            *_forms_above(recorded, "Misaligned: it is above all three", trainings),
            Claim(
                "Timeline alignment significantly improves the other three generators.",
                "gain in the share reached, mean of all rounds: "
                + "; ".join(
                    f"{_unaligned(row['label'])} {gain:+.2f}"
                    for row, gain in zip(aligned, gains, strict=True)
                ),
                all_of([above(gain, 0.0, trainings) for gain in gains]),
            ),
            *(
                Claim(
                    f"Aligned: {_unaligned(row['label'])} stays below diffusion on misaligned "
                    f"demonstrations, at every round from {_FIRST_CLAIMED} on.",
                    _by_round(row, ours["label"]),
                    _verdict(ours, row, trainings),
                )
                for row in aligned
            ),
            *_forms_above(aligned, "Aligned: all three stay below it", trainings),
        ]

    def remarks(self, figures: Mapping[str, Any]) -> list[str]:
        """Name every generator that is above ours."""
        if figures["trainings"] < LEAST_TRAININGS:
            return []
        ours, *others = figures["rows"]
        better = [
            f"{row['label']} ({interval_of(row['mean_minus'][ours['label']]):+.2f})"
            for row in others
            if interval_of(row["mean_minus"][ours["label"]]).high < 0
        ]
        if not better:
            return []
        return [
            f"Measured above {ours['label']} on this task ({ours['label']} minus it, mean of all "
            f"rounds): {', '.join(better)}. Simpler generators are enough here; "
            "docs/baselines.md says why."
        ]

    def _methods(self, scale: Scale, include: Sequence[str]) -> tuple[Method, ...]:
        compared = (m for m in self.methods[1:] if scale.variants or m.kind == "baseline")
        own = (Method(name, name, aligned=False, kind="other") for name in include)
        return (self.methods[0], *compared, *own)


def _unaligned(label: str) -> str:
    """A label where it is plain from elsewhere that demonstrations are aligned."""
    return label.removesuffix(", aligned")


def _verdict(ours: Mapping[str, Any], row: Mapping[str, Any], trainings: int) -> Verdict:
    return verdict_by_round(
        ours["success"], row["success"], row["ours_minus"], _FIRST_CLAIMED, trainings
    )


def _by_round(row: Mapping[str, Any], ours: str) -> str:
    """By how much our default is above a method at some rounds."""
    rounds = [r for r in (2, 4, 10) if r <= len(row["ours_minus"])]
    return f"{ours} minus it: " + "; ".join(
        f"round {r} {interval_of(row['ours_minus'][r - 1]):+.2f}" for r in rounds
    )


def _forms_above(baselines: Sequence[Mapping[str, Any]], says: str, trainings: int) -> list[Claim]:
    """Hold our network on whole plans against its baselines, on the mean of all rounds."""
    forms = list(baselines[0]["mean_minus"])[1:] if baselines else []
    claims = []
    for form in forms:
        differences = {row["label"]: interval_of(row["mean_minus"][form]) for row in baselines}
        measured = "; ".join(f"{name} {value:+.2f}" for name, value in differences.items())
        verdict = all_of([above(value, 0.0, trainings) for value in differences.values()])
        claims.append(
            Claim(
                f"{says}: {form}, our network without start times (mean of all rounds).",
                f"{form} minus {measured}",
                verdict,
            )
        )
    return claims
