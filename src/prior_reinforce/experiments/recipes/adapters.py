"""Adapters under amplified noise, behind the same generators (paper, Figure 7b).

The demonstrations' outcomes are seen by eye, as in the table of trials; the noise of the trials is
amplified. So the generator learns from outcomes that are off by up to 5 cm along each axis, and
there is something to adapt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import (
    Family,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.experiments.recipes.claims import Claim, Verdict, above, at_most
from prior_reinforce.experiments.recipes.success import (
    Curve,
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

ADAPTERS = {
    "gp": "GP, m = 2",
    "gp-all": "GP, no forgetting",
    "gp-one-term": "GP, one term, m = 2",
    "gp-one-term-all": "GP, one term, no forgetting",
    "proportional": "proportional, 0.8",
    "frozen": "no adapter",
}
"""What each adapter is called in tables and pictures. GP: Gaussian process, of two noise sizes
(ours) or one (the paper's; docs/decisions-adapter.md)."""
_FORMS = {"gp": "gp-all", "gp-one-term": "gp-one-term-all"}
"""Our Gaussian process and the paper's, whose diagonal has one size for all points; each with its
variant that forgets nothing."""
_MARGINAL = 0.10
"""Ours: the paper calls a difference marginal without a number."""


@dataclass(frozen=True)
class Adapters(Recipe):
    """Success by round of the adapters under amplified noise."""

    name: ClassVar[str] = "adapters"
    title: ClassVar[str] = "Adapters under amplified noise"
    paper: ClassVar[str] = "Figure 7b"
    family: ClassVar[Family | None] = "adapter"

    generator: str = "diffusion"
    """Generator behind every adapter."""

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """The generator, on misaligned demonstrations seen by eye."""
        return trainings_of(scale, self.generator, perception="eye")

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every adapter."""
        scale = run.scale
        trainings = self.trainings(scale, run.include)
        run.learn(trainings)
        names = (*ADAPTERS, *run.include)
        units = [
            Trials(t, t.task, name, "amplified", scale.goals, rounds=scale.rounds)
            for name in names
            for t in trainings
        ]
        all_solved = solved_at(run, units).reshape(len(names), scale.trainings, scale.goals)
        solved = dict(zip(names, all_solved, strict=True))
        others = {name: at for name, at in solved.items() if name != "gp"}
        return {
            "trainings": scale.trainings,
            "generator": self.generator,
            "success": {name: success_curve(at, scale.rounds) for name, at in solved.items()},
            "gp_minus": {
                name: difference_curve(solved["gp"], at, scale.rounds)
                for name, at in others.items()
            },
            "forms": {
                form: {
                    "minus_proportional": difference_curve(
                        solved[form], solved["proportional"], scale.rounds
                    ),
                    "mean_minus_proportional": asdict(
                        mean_success_difference(solved[form], solved["proportional"], scale.rounds)
                    ),
                    "minus_no_forgetting": difference_curve(
                        solved[form], solved[keeps_all], scale.rounds
                    ),
                }
                for form, keeps_all in _FORMS.items()
            },
            "proportional_minus_frozen": difference_curve(
                solved["proportional"], solved["frozen"], scale.rounds
            ),
            "proportional_mean_minus_frozen": asdict(
                mean_success_difference(solved["proportional"], solved["frozen"], scale.rounds)
            ),
        }

    def table(self, figures: Mapping[str, Any]) -> Table:
        """One row an adapter."""
        shown = rounds_shown(len(figures["success"]["gp"]))
        at = 4 if 4 in shown else shown[-1]
        return Table(
            ("adapter", *(f"by round {r}" for r in shown), f"GP minus it, round {at}"),
            tuple(
                (
                    ADAPTERS.get(name, name),
                    *(str(interval_of(curve[r - 1])) for r in shown),
                    f"{interval_of(figures['gp_minus'][name][at - 1]):+.2f}"
                    if name in figures["gp_minus"]
                    else "",
                )
                for name, curve in figures["success"].items()
            ),
        )

    def draw(self, figures: Mapping[str, Any], folder: Path) -> list[Picture]:
        """Shares reached, and how far the Gaussian process is above the others."""

        def lines(curves: Mapping[str, Curve]) -> list[Line]:
            return [
                Line(ADAPTERS.get(name, name), curves[name], place=i, dashed=name not in ADAPTERS)
                for i, name in enumerate(figures["success"])
                if name in curves
            ]

        panels = [
            Panel("", lines(figures["success"])),
            Panel("", lines(figures["gp_minus"]), difference="GP, m = 2, minus it"),
        ]
        path = draw_success(panels, folder / f"{self.name}.png")
        return [
            Picture(
                path,
                f"Left: share of goals reached within so many rounds, {figures['generator']} "
                "behind every adapter, its demonstrations seen by eye, the trials under amplified "
                "noise. Right: the paired difference; above zero the Gaussian process with m = 2 "
                "is ahead. Bars: 95 % intervals over trainings and goals.",
            )
        ]

    def claims(self, figures: Mapping[str, Any]) -> list[Claim]:
        """Over 90 % within 4 rounds; above proportional above none; forgetting helps."""
        trainings, success = figures["trainings"], figures["success"]
        last = len(success["gp"])
        by_four = interval_of(success["gp"][min(4, last) - 1])
        better = interval_of(figures["proportional_mean_minus_frozen"])
        marginal = interval_of(figures["proportional_minus_frozen"][-1])
        return [
            Claim(
                "The Gaussian process reaches more than 90 % of the goals within 4 rounds.",
                f"{by_four}",
                above(by_four, 0.9, trainings),
            ),
            *(
                claim
                for form, differences in figures["forms"].items()
                for claim in _of_form(form, success, differences, trainings)
            ),
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


def _of_form(
    form: str, success: Mapping[str, Curve], differences: Mapping[str, Any], trainings: int
) -> list[Claim]:
    """Hold one form of the Gaussian process against the proportional rule and no forgetting."""
    label = ADAPTERS[form]
    sooner = interval_of(differences["mean_minus_proportional"])
    higher = interval_of(differences["minus_proportional"][-1])
    upper_end = interval_of(differences["minus_no_forgetting"][-1])
    last = len(differences["minus_proportional"])

    def in_the_end(other: str, difference: str) -> Verdict:
        # By round, because where both reach every goal nothing is left to be above in.
        return verdict_by_round(
            success[form], success[other], differences[difference], last, trainings
        )

    return [
        Claim(
            f"{label}: the proportional compensator converges more slowly.",
            f"share reached, mean of all rounds, it minus proportional: {sooner:+.3f}",
            above(sooner, 0.0, trainings),
        ),
        Claim(
            f"{label}: the proportional compensator ends lower.",
            f"it minus proportional, round {last}: {higher:+.3f}",
            in_the_end("proportional", "minus_proportional"),
        ),
        Claim(
            f"{label}: forgetting all but the latest two trials improves the upper end.",
            f"it minus the same without forgetting, round {last}: {upper_end:+.3f}",
            in_the_end(_FORMS[form], "minus_no_forgetting"),
        ),
    ]
