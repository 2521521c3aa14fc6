"""Recipes: one a figure or table of the paper, one file each."""

from __future__ import annotations

from collections.abc import Mapping

from prior_reinforce.experiments.recipes.adapters import Adapters
from prior_reinforce.experiments.recipes.alignment import TimelineAlignment
from prior_reinforce.experiments.recipes.base import QUICK, Picture, Recipe, Run, Scale, Table
from prior_reinforce.experiments.recipes.claims import Claim, Verdict
from prior_reinforce.experiments.recipes.displacement import DisplacementFields
from prior_reinforce.experiments.recipes.generators import Generators
from prior_reinforce.experiments.recipes.process import ProcessPictures
from prior_reinforce.experiments.recipes.trials import TrialsTable
from prior_reinforce.experiments.recipes.zero_shot import ZeroShotErrors

RECIPES: Mapping[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        ZeroShotErrors(),
        Generators(),
        Adapters(),
        TimelineAlignment(),
        DisplacementFields(),
        TrialsTable(),
        ProcessPictures(),
    )
}
"""Every recipe by its name, in the order of the evidence page."""

__all__ = [
    "QUICK",
    "RECIPES",
    "Claim",
    "Picture",
    "Recipe",
    "Run",
    "Scale",
    "Table",
    "Verdict",
]
