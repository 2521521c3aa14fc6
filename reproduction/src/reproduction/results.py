"""One tidy table of raw results, from which every figure, interval and verdict is made.

A row is a goal that was tried, or a place that was thrown at; columns say by what (recipe, method,
task, set, generator, adapter, perception, seed, ...) and what came of it (solved_at, first_error,
P(hit) said before each trial, ...). Cells that have no meaning for a row are empty. Each recipe
keeps its rows in a file of its own, `raw/RECIPE.csv.gz`, whose first line is the command that made
them; equal rows give equal bytes. Without this package: `pandas.read_csv(path, comment="#")`.
"""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import write
from reproduction.statistics import (
    SHARE,
    Interval,
    Values,
    mean_of_groups,
    p_above,
    reached_by,
    trials_counted,
)

Row = Mapping[str, Any]
INCOMPLETE = "; units found: "
"""In the first line of a file some of whose units were not run."""
_TEXTS = (
    "recipe", "method", "condition", "task", "learned_on", "set", "generator", "adapter",
    "perception", "labels", "noise", "place", "p_hit", "seen", "outcome", "key_state", "quantity",
    "commit",
)  # fmt: skip
"""Columns that are text even where every cell looks like a number."""
_SET = ["learned_on", "set", "count"]
_TRAINING = [*_SET, "seed"]
_GOAL = ["task", "unseen", "sequence", "goal"]


@dataclass(frozen=True)
class Measure:
    """What is said of a goal that was tried, as a number."""

    of: Callable[[pd.DataFrame], Any]
    """From rows."""
    within: tuple[float, float] = SHARE
    """What its mean can be."""


def reached(by: int) -> Measure:
    """Whether the goal was reached within so many trials."""
    return Measure(lambda rows: reached_by(rows["solved_at"].to_numpy(), by))


ROUNDS = 10
"""Trials a goal at most, as in the paper's figures."""
FIRST = reached(1)
"""Whether the first trial hit: nothing was told before it."""
TRIALS = Measure(
    lambda rows: trials_counted(rows["solved_at"].to_numpy(), rows["rounds"].to_numpy()),
    (1, ROUNDS + 1),
)
"""Trials to the first hit; a goal that is not reached counts as one trial more than there were
rounds. The mean share reached over rounds 1 to R, the area under a curve of the paper, is
(R + 1 - trials) / R: who needs fewer trials has the higher curve, in the mean."""


def column(name: str, within: tuple[float, float] = (-np.inf, np.inf)) -> Measure:
    """A column as it stands."""
    return Measure(lambda rows: rows[name].to_numpy(dtype=float), within)


@dataclass(frozen=True, eq=False)
class Results:
    """Rows, and what is estimated from them."""

    frame: pd.DataFrame
    """A row a goal, or a place."""
    made_by: Mapping[str, str]
    """The command that made the rows of each recipe."""

    def where(self, **equal: Any) -> Results:
        """The rows whose columns are equal to these; a tuple: to one of these."""
        keep = np.ones(len(self.frame), dtype=bool)
        for name, value in equal.items():
            has = self.frame.get(name)
            if has is None:
                return replace(self, frame=self.frame.iloc[:0])
            keep &= has.isin(value if isinstance(value, tuple) else (value,)).to_numpy()
        return replace(self, frame=self.frame[keep])

    def having(self, name: str) -> Results:
        """The rows that have something in a column."""
        told = self.frame[name].notna() if name in self.frame else []
        return replace(self, frame=self.frame[told] if len(told) else self.frame.iloc[:0])

    def by(self, name: str) -> dict[Any, Results]:
        """The rows of each value of a column, in the order in which they come."""
        if self.empty or name not in self.frame:
            return {}
        groups = self.frame.groupby(name, sort=False)
        return {value: replace(self, frame=rows) for value, rows in groups}

    def first(self, name: str) -> Any:
        """What the first row says in a column."""
        return self.frame[name].iloc[0]

    @property
    def empty(self) -> bool:
        """Whether there are no rows."""
        return self.frame.empty

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.frame)

    @cached_property
    def sets(self) -> int:
        """How many sets of demonstrations were learned from: more seeds are no more sets."""
        return self._distinct(_SET)

    @property
    def trained(self) -> str:
        """The same in words, and how often they were learned where that is more."""
        trainings = self._distinct(_TRAINING)
        said = f"{self.sets} set{'' if self.sets == 1 else 's'}"
        return said if trainings == self.sets else f"{said}, {trainings} trainings"

    def _distinct(self, columns: Sequence[str]) -> int:
        return len(self.frame[[c for c in columns if c in self.frame]].drop_duplicates())

    def mean(self, measure: Measure) -> Interval:
        """Mean over tasks, sets, seeds and goals; empty rows have none (NaN)."""
        return _estimate([self._pivot(measure)], measure.within)

    def minus(self, other: Results, measure: Measure) -> Interval:
        """Mean of the difference, paired: over the trainings and goals that both have."""
        low, high = measure.within
        return _estimate([self._pivot(measure), other._pivot(measure)], (low - high, high - low))

    def beside(self, other: Results, measure: Measure = TRIALS) -> str:
        """The difference as a table shows it; nothing where both are the same rows."""
        if self.frame.equals(other.frame):
            return ""
        return f"{self.minus(other, measure):+.2f}"

    def p_above(self, bound: float, measure: Measure, other: Results | None = None) -> float:
        """One-sided p-value of "the mean (minus that of the other) is above the bound"."""
        groups, weights = _groups([of._pivot(measure) for of in (self, other) if of is not None])
        return p_above(groups, bound, weights) if groups else float("nan")

    def texts(self, name: str) -> Iterator[np.ndarray]:
        """Numbers of a text column, row by row."""
        for text in self.frame[name]:
            yield np.array(text.split(), dtype=float)

    def _pivot(self, measure: Measure) -> pd.DataFrame:
        """A row a training, a column a goal."""
        if self.empty:
            return pd.DataFrame()
        values = np.append(np.asarray(measure.of(self.frame), dtype=float), np.nan)
        places = self._places
        return pd.DataFrame(values[places.to_numpy()], places.index, places.columns)

    @cached_property
    def _places(self) -> pd.DataFrame:
        """Which row is of a training and a goal; -1: none. It is the same for every measure."""
        rows = [c for c in _TRAINING if c in self.frame and self.frame[c].notna().all()]
        columns = [c for c in _GOAL if c in self.frame and self.frame[c].notna().all()]
        index = pd.MultiIndex.from_frame(self.frame[rows + columns])
        return pd.Series(np.arange(self.n), index).unstack(columns, fill_value=-1)


def _groups(tables: Sequence[pd.DataFrame]) -> tuple[list[Values], list[int]]:
    """What all tables have, the first minus the others, a table for each source: a row a set.

    Tasks whose demonstrations are the same share sets; others are independent, and weigh as many as
    there are tasks. A training that has not tried every goal yet is left out.
    """
    if any(table.empty for table in tables):
        return [], []
    first, *others = tables
    for other in others:
        rows = first.index.intersection(other.index)
        columns = first.columns.intersection(other.columns)
        first = first.loc[rows, columns] - other.loc[rows, columns]
    groups, weights = [], []
    sources = first.index.get_level_values("learned_on")
    of_set = first.index.droplevel([c for c in first.index.names if c not in _SET])
    known = first.notna().to_numpy()
    for source in sources.unique():
        rows = np.asarray(sources == source)
        columns = known[rows].any(axis=0)
        rows &= known[:, columns].all(axis=1)
        if rows.any() and columns.any():
            groups.append(_of_sets(first.to_numpy(dtype=float)[rows][:, columns], of_set[rows]))
            weights.append(len(set(first.columns[columns].get_level_values("task"))))
    return groups, weights


def _of_sets(values: Values, sets: pd.Index) -> Values:
    """The mean of each set's trainings."""
    if sets.is_unique:
        return values
    means = pd.DataFrame(values, sets).groupby(level=list(range(sets.nlevels))).mean()
    return means.to_numpy(dtype=float)


def _estimate(tables: Sequence[pd.DataFrame], within: tuple[float, float]) -> Interval:
    groups, weights = _groups(tables)
    if not groups:
        return Interval(*[float("nan")] * 3)
    return mean_of_groups(groups, weights, within=within)


def rows_of(shared: Row, **columns: Iterable[Any]) -> list[dict[str, Any]]:
    """Rows from what they share and from columns, each with a value a row."""
    cells = zip(*columns.values(), strict=True)
    return [{**shared, **dict(zip(columns, of_row, strict=True))} for of_row in cells]


def as_text(numbers: Any, digits: int = 5) -> str:
    """Numbers in one cell."""
    return " ".join(f"{round(float(x), digits):g}" for x in np.ravel(numbers))


def write_rows(folder: Path, recipe: str, rows: Sequence[Row], command: str) -> Path:
    """Write a recipe's rows, and the command that makes them again."""
    frame = pd.DataFrame(rows)
    frame.insert(0, "recipe", recipe)
    text = f"# {command}\n{frame.to_csv(index=False, lineterminator=chr(10))}"
    (folder / "raw").mkdir(parents=True, exist_ok=True)
    return write(raw_path(folder, recipe), gzip.compress(text.encode(), mtime=0))


def raw_path(folder: Path, recipe: str) -> Path:
    """Where a recipe's rows lie."""
    return folder / "raw" / f"{recipe}.csv.gz"


def read_results(folder: Path) -> Results:
    """Read the rows of all recipes in a folder as one table.

    Raises:
        FileFormatError: A file is damaged.
    """
    frames, made_by = [], {}
    for path in sorted(folder.glob("raw/*.csv.gz")):
        recipe = path.name.removesuffix(".csv.gz")
        try:
            text = gzip.decompress(path.read_bytes()).decode()
            made_by[recipe] = text.partition("\n")[0].removeprefix("# ")
            types = dict.fromkeys(_TEXTS, str)
            frame = pd.read_csv(
                io.StringIO(text), comment="#", dtype=types, keep_default_na=False, na_values=[""]
            )
            if set(frame["recipe"]) - {recipe}:
                raise ValueError("rows of another recipe")
        except (OSError, EOFError, ValueError, KeyError) as error:
            raise FileFormatError(
                f"{path} holds no rows ({error!r}); run `python -m reproduction {recipe}` again"
            ) from error
        frames.append(frame)
    return Results(pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(), made_by)
