"""Limits on the size of recordings, far above what arms record; checks raise FileFormatError.

They are checked from headers, before anything is allocated: a small file can unpack to more than
any machine holds. Rows that are no table are refused here too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from prior_reinforce.errors import FileFormatError

MOST_NUMBERS = 10_000_000
"""Numbers of one array, and of all episodes together: 14 channels at 1 kHz for 12 minutes."""
MOST_ROWS = 600_000
"""Lines of a table: 10 minutes at 1 kHz."""
MOST_BYTES = 8 * MOST_NUMBERS
"""Bytes of a file, and of what it unpacks to."""
MOST_COLUMNS = 2_000
"""Columns of a table; ours: all variables of UR's RTDE are 300."""
MOST_CELLS = 5_000_000
"""Cells of a table, which are texts at first, some 100 bytes each: 160 columns at 500 Hz, 60 s."""
MOST_CHUNKS = 10_000
"""Chunks of one array; each is read separately."""
LONGEST_NAME = 200
"""Characters of a channel's or an episode's name; patterns are matched against every name."""


def check_numbers(path: Path, name: str, shape: Iterable[int], bytes_each: int = 8) -> None:
    """Refuse an array, or a chunk, whose header claims too much; `bytes_each` are of a number."""
    sizes = tuple(int(size) for size in shape)
    numbers = math.prod(sizes)
    if numbers > MOST_NUMBERS or numbers * bytes_each > MOST_BYTES:
        raise FileFormatError(
            f"{path}: {name} has shape {sizes}, {numbers:.2g} numbers; that is no recording of "
            "throws, copy the file again"
        )


def check_chunks(path: Path, name: str, shape: Sequence[int], chunks: Sequence[int]) -> None:
    """Refuse an array whose chunks are too large, or too many."""
    check_numbers(path, f"a chunk of {name}", chunks)
    count = math.prod(
        -(-int(size) // max(int(of), 1)) for size, of in zip(shape, chunks, strict=True)
    )
    if count > MOST_CHUNKS:
        raise FileFormatError(
            f"{path}: {name} of shape {tuple(shape)} has {count} chunks of {tuple(chunks)}, at "
            f"most {MOST_CHUNKS} are read; write it in larger chunks"
        )


def check_bytes(path: Path, count: int, what: str = "is") -> None:
    """Refuse a file that is, or unpacks to, more than `MOST_BYTES`."""
    if count > MOST_BYTES:
        raise FileFormatError(
            f"{path} {what} {count:.3g} bytes, at most {MOST_BYTES:.3g} are read; that is no "
            "recording of throws: cut it, or copy it again"
        )


def check_table(path: Path, rows: int, columns: int) -> None:
    """Refuse a table of more than `MOST_COLUMNS` columns or `MOST_CELLS` cells."""
    if columns > MOST_COLUMNS or rows > MOST_ROWS or rows * columns > MOST_CELLS:
        raise FileFormatError(
            f"{path} has {rows} rows of up to {columns} columns, at most {MOST_COLUMNS} columns, "
            f"{MOST_ROWS} rows and {MOST_CELLS} cells are read; export only the columns and rows "
            "of the motion, or delete stray cells"
        )


def check_names(where: object, names: Iterable[object]) -> None:
    """Refuse names longer than `LONGEST_NAME`."""
    for name in map(str, names):
        if len(name) > LONGEST_NAME:
            raise FileFormatError(
                f"{where} has a name of {len(name)} characters ({name[:20]!r}...), at most "
                f"{LONGEST_NAME} are read; rename it"
            )


def check_rows(where: str, rows: Sequence[tuple[int, Sequence[str]]]) -> None:
    """Refuse YAML, and a header with more names than rows have cells; rows have line numbers."""
    if any(row == ["---"] for _, row in rows):
        raise FileFormatError(
            f"{where} is YAML, as ros2 topic echo prints it, and no table: record a bag, or print "
            "it with --csv"
        )
    (line, first), *below = rows or [(1, [])]
    names, cells = sum(map(bool, first)), max((len(row) for _, row in below), default=len(first))
    if cells < names:
        raise FileFormatError(
            f"{where}: {names} names in line {line}, and {cells} cells under them at most, so that "
            "a name may be over another's numbers; take the names out that no cell is of"
        )
