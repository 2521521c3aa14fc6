"""Headers of a table's columns: from its first lines, its comments, or a JSON sidecar."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_names
from prior_reinforce.arm.recordings.naming import Texts, read_metadata
from prior_reinforce.arm.recordings.stated import (
    JOINT_WORDS,
    OUTCOME,
    failures,
    stated_names,
    stated_units,
)
from prior_reinforce.arm.recordings.tables import Table, are_units, is_value
from prior_reinforce.arm.recordings.time_finder import rises, says_time
from prior_reinforce.arm.recordings.units import known_unit, split_unit
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import NS_PER_S

_ECHOED = ("name", "position", "velocity", "effort")
"""Arrays of a sensor_msgs/JointState, in order."""
_UNIT_OF_ALL = re.compile(
    rf"(?:^[#%/]+|[,;.])\W*(?:({JOINT_WORDS}|winkel|units?|values|all|the|of|are|is|given|in)(?![a-z])[\W_]*)*"
    r"(?P<units>(?:[a-z]+|°)(?:\s*[,;]\s*(?:[a-z]+|°))*)\s*(?:[\])](?!\s*[:=])|$|[,;.](?!\d))",
    re.IGNORECASE,
)
"""The unit of all columns in a comment: `# joint angles in deg`, `# t in s, q in deg`, `# deg`; not
`camera angles in deg`, nor `angle [deg]: 30`."""
_OF_RECORDINGS = re.compile(
    r"((meta|data|info|set|records?|recordings?|columns?|channels?|joints?|angles?|names?|units?|log"
    r"|throws?|demos?|demonstrations?|episodes?|trials?|session|motions?|robot|arm|csv|tables?|header"
    r"|schema|fields?|experiment)[ _-]?)+",
    re.IGNORECASE,
)
"""Names of a sidecar that describes all recordings of a folder; not `camera_info.json`."""
_OF_JOINTS = re.compile(r"(^|[._])joint_?(names?|units?)$", re.IGNORECASE)
"""Keys of a sidecar that describes joints, whatever its file is called: `joint_names`."""
_COMMENT = re.compile(r"[#%/;\s]*(\w[\w .]*?)\s*[:=]\s*(\w+)\W*")
"""A comment with one value: `# success: false`."""
_MOST_SAID = 1_000_000
"""Largest sidecar, in bytes. Ours: it describes columns."""


class Sidecar(NamedTuple):
    """Contents of the JSON file that describes a table."""

    where: Path
    """The JSON file; the table if there is none."""
    texts: Texts
    numbers: Mapping[str, float]


def read_sidecar(table: Table, joints: Sequence[str] | None = None) -> Sidecar:
    """Read a table's sidecar, the JSON file that describes it; an empty one if there is none.

    It has the table's name; or it is the only JSON in the folder, and is called like recordings, or
    names columns of the table, or joints or their units.
    """
    path = Path(table.where)
    own = path.with_suffix(".json")
    alone = [p for p in path.parent.glob("*.json") if not p.with_suffix(path.suffix).exists()]
    found = [own] if own.is_file() else alone
    if len(found) == 1 and found[0].stat().st_size <= _MOST_SAID:
        texts, numbers = read_metadata({"": found[0].read_bytes()})
        said = {*chain(*texts.values()), *(key.rpartition(".")[2] for key in texts)}
        named = [name for name in {*table.names, *(joints or ())} & said if not says_time(name)]
        of_table = own.is_file() or len(named) > 1 or any(map(_OF_JOINTS.search, texts))
        if of_table or _OF_RECORDINGS.fullmatch(found[0].stem):
            return Sidecar(found[0], texts, numbers)
    return Sidecar(path, {}, {})


def with_stated_header(
    table: Table, sidecar: Sidecar, joints: Sequence[str] | None = None
) -> Table:
    """Return a table with the headers and units that its comments or its sidecar state.

    Names for all columns but the first are taken if that one rises, as times do. The table's own
    header counts more, and a single unit for all holds only for angles.
    """
    where, texts = sidecar.where, sidecar.texts
    names = table.names if table.named else stated_names(where, texts, len(table.names), joints)
    if not names and texts and len(table) and rises(table.stamps(0)):
        names = stated_names(where, texts, len(table.names) - 1, joints)
        names = ("t", *names) if names else ()
    if not names:
        return table
    check_names(where, names)
    texts = {f".{key}": own for key, own in texts.items()}
    of_motion = [line for line in table.comments if not OUTCOME.fullmatch(line)]
    said = " ".join(one["units"] for line in of_motion for one in _UNIT_OF_ALL.finditer(line))
    angles = {*map(known_unit, re.split(r"[\s,;]+", said))} & TURN.keys()
    if len(angles) == 1:
        texts |= {"units": tuple(map(str, angles))}
    if table.named:
        texts = {k: own for k, own in texts.items() if len(own) > 1 or known_unit(own[0]) in TURN}
    units = stated_units(texts, names)
    if not any(units):  # of the columns but the time's
        units = (None, *stated_units(texts, names[1:]))
    units = tuple(
        own or (None if says_time(name) or split_unit(name, any_word=True)[1] else unit)
        for name, own, unit in zip(names, table.units, units, strict=True)
    )
    return replace(table, names=names, units=units, named=True)


def failed(table: Table, sidecar: Sidecar, others: Collection[str]) -> Iterator[str]:
    """Remark on flags of failure in a table's comments or its sidecar, but not of `others`."""
    found = filter(None, map(_COMMENT.fullmatch, table.comments))
    comments = {match[1]: match[2] for match in found}
    said = {**sidecar.texts, **sidecar.numbers}
    own = {place: one for place, one in said.items() if {*others}.isdisjoint(place.split("."))}
    return failures({**comments, **own})


def with_one_header(table: Table) -> Table:
    """Return a table with one header line, wherever its names stand."""
    return _name_echoed_columns(_join_header_lines(table))


def _join_header_lines(table: Table) -> Table:
    """Join several header lines, as pandas writes for columns of several levels: `elbow/position`.

    They hold no number, date or `nan`, and the next line does. The last may hold units.
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


def _name_echoed_columns(table: Table) -> Table:
    """Name the columns that `ros2 topic echo --csv` writes of a JointState; leave other tables.

    A row is the stamp in s and ns, the frame's name (column 3, no column if empty), the joints'
    names, and as many positions, then perhaps velocities and efforts.
    """
    if table.named:
        return table
    no_number = np.argwhere(np.isnan(table.values)).tolist()  # 1e-7 has a letter, too
    texts = sorted({i for row, i in no_number if _is_word(table.cells[i][row])})
    if not texts or texts != [*range(2, texts[-1] + 1)]:
        return table
    stamps = table.values[:, :2]
    if np.any(stamps != np.floor(stamps)) or np.any(stamps < 0) or np.any(stamps[:, 1] >= NS_PER_S):
        return table
    frame = ["frame_id"] if table.names[texts[0]] == "column 3" else []
    count = len(texts) - len(frame)
    groups, rest = divmod(len(table.names) - 1 - texts[-1], max(count, 1))
    if count == 0 or rest or not 1 <= groups < len(_ECHOED):
        return table
    heads = [f"{of}{i}" for of in _ECHOED[: 1 + groups] for i in range(count)]
    return replace(table, names=("sec", "nanosec", *frame, *heads), named=True)


def _is_word(cell: str) -> bool:
    return any(map(str.isalpha, cell)) and not is_value(cell)
