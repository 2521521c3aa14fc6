"""The command that runs shipped rows again: `python -m reproduction verify`."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from prior_reinforce.errors import ConfigurationError
from reproduction.recipes import RECIPES, Run, Scale
from reproduction.recipes.base import Planned
from reproduction.results import read_results, write_rows

_GAVE = {"solved_at", "first_error", "lost", "failed_readings", "p_hit", "unlike", "commit"}
"""Columns that say what came of a row; the others say which row it is."""
_COMPARED = ["solved_at", "first_error", "unlike"]
_ROWS_A_UNIT = 5
"""Rows compared of each unit that is drawn: a unit runs whole."""
_ROUNDED = 1e-5
"""Shipped errors are rounded to this, in [m]."""
_HOURS, _NETWORKS = "diffusion-paper", ("diffusion", "regression")
"""Generators that take twenty minutes to learn, and those that take half a minute."""


@dataclass(frozen=True)
class Verify:
    """Run rows drawn at random again, and say how many agree with the shipped ones.

    For example:
        python -m reproduction verify --sample 200
    """

    sample: int = 200
    """Rows to compare."""
    seed: int = 0
    """Of the drawing."""
    quick: bool = False
    """Only what is learned in a second: no networks, drawn sets alone."""
    results: Path = Path("results")
    """Folder of shipped rows."""

    def run(self) -> int:
        """Draw units, run them, and compare; 1 where a row does not agree."""
        if self.sample < 1 or self.seed < 0:
            raise ConfigurationError("--sample must be at least 1, and --seed not negative")
        shipped = read_results(self.results)
        rng = np.random.default_rng(self.seed)
        planned = self._planned(set(shipped.made_by))
        agree = compared = 0
        with tempfile.TemporaryDirectory() as folder:
            for i in rng.permutation(len(planned)):
                recipe, unit = planned[i]
                again = _again(Path(folder), recipe, unit)
                both = _side_by_side(again, shipped.where(recipe=recipe).frame)
                if both.empty:
                    continue  # a training that was not shipped
                n = min(_ROWS_A_UNIT, len(both), self.sample - compared)
                drawn = both.sample(n, random_state=int(rng.integers(2**31)))
                same = _equal(drawn)
                agree, compared = agree + int(same.sum()), compared + n
                print(f"{recipe}: {same.sum()} of {n} agree ({unit[0]})", flush=True)
                if compared >= self.sample:
                    break
        print(f"{agree} of {compared} rows agree (seed {self.seed})")
        return 0 if agree == compared > 0 else 1

    def _planned(self, shipped: set[str]) -> list[tuple[str, Planned]]:
        """Units of goals that were tried, without those that take hours to learn."""
        left_out = _NETWORKS if self.quick else (_HOURS,)
        return [
            (name, unit)
            for name, recipe in RECIPES.items()
            if name in shipped and (name == "sets" or not self.quick)
            for unit in recipe.units(Scale(), ())
            if not any(word in str(unit[0]) for word in left_out)
        ]


def _again(folder: Path, recipe: str, unit: Planned) -> pd.DataFrame:
    """A unit's rows, run now, as they are read from a file."""
    write_rows(folder / "again", recipe, Run(folder).rows([unit]), "verify")
    return read_results(folder / "again").where(recipe=recipe).frame


def _side_by_side(again: pd.DataFrame, shipped: pd.DataFrame) -> pd.DataFrame:
    """Rows that both have; `displacement` and the like have none that is compared."""
    if again.reindex(columns=_COMPARED).isna().all(axis=None):
        return again.iloc[:0]
    names = [name for name in shipped if name not in _GAVE]
    a, b = (
        of.reindex(columns=names).astype(object).map(_text).join(of.reindex(columns=_COMPARED))
        for of in (again, shipped)
    )
    return a.merge(b, on=names, suffixes=("", "_shipped"))


def _text(cell: Any) -> str:
    """One text for a number whether or not its column has gaps."""
    if isinstance(cell, (bool, np.bool_, str)):
        return str(cell)
    return f"{cell:g}"


def _equal(both: pd.DataFrame) -> pd.Series:
    """Whether each row came out as shipped; what neither has is equal."""
    off = (both["first_error"] - both["first_error_shipped"]).abs()
    same = ~(off > 1.5 * _ROUNDED)
    for of in ("solved_at", "unlike"):
        one, two = both[of], both[f"{of}_shipped"]
        same &= (one == two) | (one.isna() & two.isna())
    return same
