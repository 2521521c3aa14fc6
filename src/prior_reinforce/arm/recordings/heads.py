"""Names of a table's columns that are not its first line alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from prior_reinforce.arm.recordings.tables import Table, are_units, is_value
from prior_reinforce.arm.recordings.units import known_unit

_ECHOED = ("name", "position", "velocity", "effort")
"""Arrays of a sensor_msgs/JointState, in order."""
_SECOND = 10**9
"""In [ns]."""


def with_heads(table: Table) -> Table:
    """Return a table under one line of names, wherever its own stand."""
    return _of_echo(_of_levels(table))


def _of_levels(table: Table) -> Table:
    """Join further lines of names, as pandas writes of columns of several levels: `elbow/position`.

    Such lines hold no number, date or `nan`, and the line after them does hold a number. The last
    may say units.
    """
    are_numbers = ~np.isnan(table.values)
    rows = int(np.argmax(are_numbers.any(axis=1))) if table.named and are_numbers.size else 0
    lines = [[cells[row] for cells in table.cells] for row in range(rows)]
    if not lines or any(is_value(cell) for line in lines for cell in line):
        return table
    units = table.units
    if are_units(lines[-1], table.decimal):
        units = tuple(map(known_unit, lines.pop()))
    levels = zip(table.names, *lines, strict=True)
    names = tuple("/".join(filter(None, level)) for level in levels)
    return replace(table.rows(range(rows, len(table))), names=names, units=units)


def _of_echo(table: Table) -> Table:
    """Name what `ros2 topic echo --csv` writes of a JointState; return others as they are.

    A row is the stamp in s and ns, the frame's name (column 3, which is no column where it is
    empty), the joints' names, and as many positions; then velocities and efforts, if there are any.
    """
    words = [i for i, cells in enumerate(table.cells) if any(map(_is_word, cells))]
    if table.named or not words or words != [*range(2, words[-1] + 1)]:
        return table
    stamps = table.values[:, :2]
    if np.any(stamps != np.floor(stamps)) or np.any(stamps < 0) or np.any(stamps[:, 1] >= _SECOND):
        return table
    frame = ["frame_id"] if table.names[words[0]] == "column 3" else []
    count = len(words) - len(frame)
    groups, rest = divmod(len(table.names) - 1 - words[-1], max(count, 1))
    if count == 0 or rest or not 1 <= groups < len(_ECHOED):
        return table
    heads = [f"{of}{i}" for of in _ECHOED[: 1 + groups] for i in range(count)]
    return replace(table, names=("sec", "nanosec", *frame, *heads), named=True)


def _is_word(cell: str) -> bool:
    return any(letter.isalpha() for letter in cell) and not is_value(cell)
