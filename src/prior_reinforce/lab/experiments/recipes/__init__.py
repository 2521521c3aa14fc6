"""Recipes: one a figure or table of the paper, and what goes beyond it, one file each."""

from __future__ import annotations

from collections.abc import Mapping

from prior_reinforce.lab.experiments.recipes import (
    adaptation,
    adapters,
    alignment,
    displacement,
    generators,
    papers_form,
    process,
    robustness,
    sets,
    trials,
    variation,
    ways,
    zero_shot,
)
from prior_reinforce.lab.experiments.recipes.base import QUICK, Picture, Recipe, Run, Scale
from prior_reinforce.lab.experiments.recipes.tables import Table

RECIPES: Mapping[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        zero_shot.RECIPE,
        generators.RECIPE,
        adapters.RECIPE,
        alignment.RECIPE,
        displacement.RECIPE,
        trials.RECIPE,
        process.RECIPE,
        adaptation.RECIPE,
        robustness.RECIPE,
        variation.RECIPE,
        ways.RECIPE,
        sets.RECIPE,
        adaptation.NETWORK,
        papers_form.RECIPE,
        sets.NETWORK,
    )
}
"""Every recipe by its name, in the order of the evidence page."""

__all__ = ["QUICK", "RECIPES", "Picture", "Recipe", "Run", "Scale", "Table"]
