"""Generators behind the same adapter, on demonstrations as recorded and aligned (paper, Figure 7a).

The paper does not say what its adapters see in this figure; here it is the amplified noise of its
other one, for all alike. Beside the network stand its controls: the same network untrained, and the
closed form. The paper's form takes hours to learn: `papers-form`
runs it, and its rows are shown here. Diffusion runs on demonstrations as recorded only: ours finds
the start times itself. Nothing random goes into fitting the nearest neighbours, DMPs and the
closed form; their "seeds" differ in execution and perception.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import pandas as pd

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.plans.motions import Demonstrations
from reproduction.evaluation import (
    LearnedGenerator,
    Trials,
    is_aligned,
)
from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Table, table_by_round
from reproduction.results import TRIALS, Results

_NOT_THE_PAPERS = {"control": " (control)", "other": " (ours)"}
_MINUTES = "network.widths=32:64:128,network.activation=silu,training_steps=20000"
"""The paper's form at a size that a core learns in twenty minutes, with steps enough to come back
to its demonstrations (reproduction/docs/decisions-generator.md)."""
PAPERS_FORM = f"diffusion-paper,{_MINUTES}"
AMPLIFIED = "amplified noise"
FRESH = "no adapter, fresh noise"
_OF_PAPERS_FORM = {
    "GP, m = 2": "the paper's form of it",
    "GP of two terms, m = 2": "the paper's form, GP of two terms",
    "no adapter": "the paper's form, no adapter",
    FRESH: f"the paper's form, {FRESH}",
}
"""What rows of `papers-form` are called here."""


@dataclass(frozen=True)
class Method:
    """One of the generators compared."""

    label: str
    """What it is called in tables and pictures."""
    generator: str
    """Its choice."""
    kind: Literal["method", "baseline", "control", "other"] = "baseline"
    """The paper's method, one of its baselines, a control, or what the paper does not have."""
    adapter: str = "gp-two-term"
    """What corrects its conditions, by its choice."""

    def trials(self, scale: Scale) -> list[Trials]:
        """Trials of one training for each prior set and seed."""
        return [scale.trials(t, self.adapter, "amplified") for t in scale.trainings(self.generator)]


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
    """Trials for each of which the network of a training is sampled anew.

    "Repeatedly generating actions", as the paper has it without an adapter.
    """

    def learned(self, folder: Path) -> LearnedGenerator:
        """What was learned, sampled anew for every trial."""
        learned = self.training.learned(folder)
        return LearnedGenerator(FreshNoise(learned.generator), learned.prior)

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """As of `Trials`; a column tells them apart."""
        return [{**row, "noise": "fresh"} for row in super().rows(result)]


METHODS = (
    Method("diffusion", "diffusion", "method"),
    Method("diffusion, untrained", "diffusion,training_steps=0", "control"),
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
)  # fmt: skip
"""Ours, a network alone; its controls; the paper's baselines; and ours with no adapter."""


KNOWN = {method.label: method for method in METHODS}
OURS = METHODS[0].label


def with_papers_form(results: Results) -> Results:
    """Rows of this recipe, and those of the paper's form under the same conditions."""
    own = results.where(recipe="generators").by("method")
    theirs = results.where(recipe="papers-form", condition=AMPLIFIED).by("method")
    papers = [
        theirs[name].frame.assign(method=label)
        for name, label in _OF_PAPERS_FORM.items()
        if name in theirs
    ]
    first, *others = [of.frame for of in own.values()] or [results.frame.iloc[:0]]
    return replace(results, frame=pd.concat([first, *papers, *others]))


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same goals with every generator, the paper's alone without variants."""
    first, *others = METHODS
    methods = [first, *(m for m in others if scale.variants or m.kind == "baseline")]
    given = {m.generator for m in methods}
    methods += [Method(name, name, "other") for name in include if name not in given]
    return [(unit, {"method": m.label}) for m in methods for unit in m.trials(scale)]


def table(results: Results) -> Table:
    """One row a method."""
    named = {
        name + _NOT_THE_PAPERS.get(_kind(name), ""): of for name, of in results.by("method").items()
    }
    return table_by_round(named, "generator", OURS)


def _kind(name: str) -> str:
    if name == _OF_PAPERS_FORM["GP, m = 2"]:
        return "method"
    return KNOWN[name].kind if name in KNOWN else "other"


def draw(results: Results, folder: Path) -> list[Picture]:
    """Two panels: as recorded, and aligned with diffusion beside."""
    from reproduction.recipes.charts import Line, Panel, curve, draw_success

    # Lines that lie upon each other tell nothing: the table has the frozen ones.
    methods = results.where(adapter="gp-two-term").by("method")
    names = list(dict.fromkeys(name.removesuffix(", aligned") for name in methods))

    def line(name: str, *, aligned: bool) -> Line:
        plain = name.removesuffix(", aligned")
        beside = " (as recorded)" if aligned and name == OURS else ""
        dashed = _kind(name) in _NOT_THE_PAPERS
        return Line(plain + beside, curve(methods[name]), names.index(plain), dashed=dashed)

    panels = [
        Panel(
            title,
            [
                line(name, aligned=aligned)
                for name, rows in methods.items()
                if name == OURS or is_aligned(rows.first("generator")) == aligned
            ],
        )
        for title, aligned in (("as recorded", False), ("aligned in time", True))
    ]
    caption = (
        "Share of goals reached within so many rounds, Gaussian process with m = 2 and amplified "
        "noise behind every generator. Dashed: controls, and "
        "ours."
    )
    return [Picture(draw_success(panels, folder / "generators.png"), caption)]


def remarks(results: Results) -> list[str]:
    """Name every generator that needs fewer trials than ours."""
    methods = results.by("method")
    ours = methods[OURS]
    minus = {name: of.minus(ours, TRIALS) for name, of in methods.items()}
    better = [f"{name} ({of:+.2f})" for name, of in minus.items() if of.high < 0]
    if not better:
        return []
    return [
        f"With fewer trials than {OURS} on this task (it minus ours): {', '.join(better)}. "
        "Simpler generators are enough here; reproduction/docs/baselines.md says why."
    ]


RECIPE = Recipe(
    "generators", "Generators, on demonstrations as recorded and aligned", "Figure 7a",
    units, table, draw, remarks, family="generator", shown=with_papers_form,
)  # fmt: skip
