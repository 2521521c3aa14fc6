"""Adapters under amplified noise, behind the same generators (paper, Figure 7b).

The demonstrations' outcomes are perceived by eye, as in the table of trials; the noise of the
trials is amplified. So the generator learns from outcomes that are off by up to 5 cm along each
axis, and there is something to adapt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prior_reinforce.lab.experiments.claims import Claim, above, above_by_round, at_most
from prior_reinforce.lab.experiments.evaluation import Training, Trials
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
    Curve,
    Interval,
    difference_curve,
    mean_success_difference,
    success_curve,
)

LABELS = {
    "gp": "GP, m = 2",
    "gp-all": "GP, no forgetting",
    "gp-one-term": "GP, one term, m = 2",
    "gp-one-term-all": "GP, one term, no forgetting",
    "proportional": "proportional, 0.8",
    "frozen": "no adapter",
}
"""The adapters compared, and what each is called in tables and pictures. GP: Gaussian process, of
two noise sizes (ours) or one (the paper's; docs/decisions-adapter.md)."""
_FORMS = {"gp": "gp-all", "gp-one-term": "gp-one-term-all"}
"""Our Gaussian process and the paper's, whose diagonal has one size for all points; each with its
variant that forgets nothing."""
_MARGINAL = 0.10
"""Ours: the paper calls a difference marginal without a number."""


@dataclass(frozen=True)
class Adapters(Measurement):
    """Success by round of the adapters under amplified noise."""

    generator: str = "diffusion"
    """Generator behind every adapter."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """The generator, on misaligned demonstrations perceived by eye."""
        return trainings_of(scale, self.generator, perception="eye")

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every adapter."""
        scale, rounds = run.scale, run.scale.rounds
        trainings = self.trainings(scale)
        run.learn(trainings)
        names = list(dict.fromkeys((*LABELS, *run.include)))
        units = [
            Trials(t, t.task, name, "amplified", scale.goals, rounds=rounds)
            for name in names
            for t in trainings
        ]
        at = run.solved_at(units).reshape(len(names), scale.trainings, scale.goals)
        solved = dict(zip(names, at, strict=True))

        def minus(one: str, other: str) -> Curve:
            return difference_curve(solved[one], solved[other], rounds)

        def mean_minus(one: str, other: str) -> Interval:
            return mean_success_difference(solved[one], solved[other], rounds)

        return {
            "trainings": scale.trainings,
            "generator": self.generator,
            "success": {name: success_curve(at, rounds) for name, at in solved.items()},
            "gp_minus": {name: minus("gp", name) for name in names if name != "gp"},
            "forms": {
                form: {
                    "minus_proportional": minus(form, "proportional"),
                    "mean_minus_proportional": mean_minus(form, "proportional"),
                    "minus_no_forgetting": minus(form, keeps_all),
                }
                for form, keeps_all in _FORMS.items()
            },
            "proportional_minus_frozen": minus("proportional", "frozen"),
            "proportional_mean_minus_frozen": mean_minus("proportional", "frozen"),
        }


def table(figures: Figures) -> Table:
    """One row an adapter."""
    success, minus = (
        {LABELS.get(name, name): curve for name, curve in figures[of].items()}
        for of in ("success", "gp_minus")
    )
    return table_by_round("adapter", success, "GP", minus)


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Shares reached, and how far the Gaussian process is above the others."""
    from prior_reinforce.lab.experiments.recipes.charts import Line, Panel, draw_success

    def lines(curves: Mapping[str, Sequence[Interval]]) -> list[Line]:
        return [
            Line(LABELS.get(name, name), curves[name], place=i, dashed=name not in LABELS)
            for i, name in enumerate(figures["success"])
            if name in curves
        ]

    panels = [
        Panel("", lines(figures["success"])),
        Panel("", lines(figures["gp_minus"]), difference="GP, m = 2, minus it"),
    ]
    caption = (
        f"Left: share of goals reached within so many rounds, {figures['generator']} behind every "
        "adapter, its demonstrations seen by eye, the trials under amplified noise. Right: the "
        "paired difference; above zero the Gaussian process with m = 2 is ahead. Bars: 95 % "
        "intervals over trainings and goals."
    )
    return [Picture(draw_success(panels, folder / "adapters.png"), caption)]


def claims(figures: Figures) -> list[Claim]:
    """Over 90 % within 4 rounds; above proportional above none; forgetting helps."""
    trainings, success = figures["trainings"], figures["success"]
    last = len(success["gp"])
    by_four = success["gp"][min(4, last) - 1]
    better = figures["proportional_mean_minus_frozen"]
    marginal = figures["proportional_minus_frozen"][-1]
    return [
        Claim(
            "The Gaussian process reaches more than 90 % of the goals within 4 rounds.",
            f"{by_four}",
            above(by_four, 0.9, trainings),
        ),
        *(claim for form in figures["forms"] for claim in _claims_of_form(form, figures)),
        Claim(
            "The proportional compensator outperforms no adapter,",
            f"share reached, mean of all rounds, it minus no adapter: {better:+.2f}",
            above(better, 0.0, trainings),
        ),
        Claim(
            f"but only marginally (here: by at most {_MARGINAL:.2f} in the end).",
            f"it minus no adapter, round {last}: {marginal:+.2f}",
            at_most(marginal, _MARGINAL, trainings),
        ),
    ]


def _claims_of_form(form: str, figures: Figures) -> list[Claim]:
    """Hold one form of the Gaussian process against the proportional rule and no forgetting."""
    label, trainings, differences = LABELS[form], figures["trainings"], figures["forms"][form]
    success, last = figures["success"], len(figures["success"][form])
    sooner = differences["mean_minus_proportional"]

    def in_the_end(says: str, it_minus: str, other: str, difference: Curve) -> Claim:
        # By round, because where both reach every goal nothing is left to be above in.
        return Claim(
            f"{label}: {says}",
            f"it minus {it_minus}, round {last}: {difference[-1]:+.3f}",
            above_by_round(success[form], success[other], difference, last, trainings),
        )

    return [
        Claim(
            f"{label}: the proportional compensator converges more slowly.",
            f"share reached, mean of all rounds, it minus proportional: {sooner:+.3f}",
            above(sooner, 0.0, trainings),
        ),
        in_the_end(
            "the proportional compensator ends lower.",
            "proportional",
            "proportional",
            differences["minus_proportional"],
        ),
        in_the_end(
            "forgetting all but the latest two trials improves the upper end.",
            "the same without forgetting",
            _FORMS[form],
            differences["minus_no_forgetting"],
        ),
    ]


RECIPE = Recipe(
    "adapters", "Adapters under amplified noise", "Figure 7b",
    Adapters(), table, draw, claims, family="adapter",
)  # fmt: skip
