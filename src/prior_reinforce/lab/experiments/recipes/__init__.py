"""Recipes: one a figure or table of the paper, and what goes beyond it, one file each."""

from __future__ import annotations

from collections.abc import Mapping

from prior_reinforce.lab.experiments.recipes import (
    adaptation,
    adapters,
    alignment,
    displacement,
    generators,
    process,
    robustness,
    trials,
    variation,
    ways,
    zero_shot,
)
from prior_reinforce.lab.experiments.recipes.base import (
    QUICK,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)

RECIPES: Mapping[str, Recipe] = {
    module.RECIPE.name: module.RECIPE
    for module in (
        zero_shot,
        generators,
        adapters,
        alignment,
        displacement,
        trials,
        process,
        adaptation,
        robustness,
        variation,
        ways,
    )
}
"""Every recipe by its name, in the order of the evidence page."""

__all__ = ["QUICK", "RECIPES", "Measurement", "Picture", "Recipe", "Run", "Scale", "Table"]
