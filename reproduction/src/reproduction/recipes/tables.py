"""Tables of results: the same in the terminal, in Markdown and on the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reproduction.results import TRIALS, Measure, Results, reached
from reproduction.statistics import Interval

_ROUNDS_SHOWN = (1, 4, 10)
Columns = Mapping[str, Callable[[Any], object]]
"""What each column of a table shows of a row, by its head."""


@dataclass(frozen=True)
class Table:
    """Text in rows and columns."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, heads: Sequence[str], rows: Mapping[Any, Any], columns: Columns) -> Table:
        """Make it from rows by their name, or a tuple of names; `heads` stand over these."""
        cells = []
        for name, row in rows.items():
            names = name if isinstance(name, tuple) else (name,)
            cells.append((*map(str, names), *(str(show(row)) for show in columns.values())))
        return cls((*heads, *columns), tuple(cells))


def mean_of(measure: Measure, **where: Any) -> Callable[[Results], Interval]:
    """What a column shows of a method: the mean of a measure, of all its rows or of some."""
    return lambda of: of.where(**where).mean(measure)


def table_by_round(methods: Mapping[str, Results], head: str, ours: str) -> Table:
    """One row a method: shares reached by some rounds, trials, and how many fewer ours needs.

    Args:
        methods: Rows by what each method is called.
        head: Of the first column.
        ours: Which of them ours is.
    """
    columns: Columns = {
        **{f"by round {by}": mean_of(reached(by)) for by in _ROUNDS_SHOWN},
        "trials": mean_of(TRIALS),
        f"{ours} minus it, trials": lambda of: methods[ours].beside(of) if ours in methods else "",
        "learned from": lambda of: of.trained,
    }
    return Table.of((head,), methods, columns)
