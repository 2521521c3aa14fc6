"""Recipes: one a figure or table of the paper, and what goes beyond it, one file each."""

from __future__ import annotations

from collections.abc import Mapping

from reproduction.recipes import (
    adaptation,
    adapters,
    afternoon,
    alignment,
    displacement,
    generators,
    once,
    papers_form,
    papers_loop,
    process,
    robustness,
    sets,
    trials,
    variation,
    ways,
    zero_shot,
)
from reproduction.recipes.base import QUICK, Picture, Recipe, Run, Scale
from reproduction.recipes.tables import Table

RECIPES: Mapping[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        trials.RECIPE,
        process.RECIPE,
        alignment.RECIPE,
        generators.RECIPE,
        adapters.RECIPE,
        displacement.RECIPE,
        papers_form.RECIPE,
        papers_loop.RECIPE,
        sets.RECIPE,
        sets.NETWORK,
        zero_shot.RECIPE,
        adaptation.RECIPE,
        adaptation.NETWORK,
        robustness.RECIPE,
        variation.RECIPE,
        ways.RECIPE,
        once.RECIPE,
        afternoon.RECIPE,
    )
}
"""Every recipe by its name, in the order of the evidence page."""

__all__ = ["QUICK", "RECIPES", "Picture", "Recipe", "Run", "Scale", "Table"]
