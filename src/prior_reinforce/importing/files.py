"""What every reader needs of the file system: order, damage with a name, optional libraries."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from prior_reinforce.errors import FileFormatError, MissingExtraError, PriorReinforceError


@contextmanager
def named_damage(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a format's library raises on a damaged file into one named error.

    Wide on purpose: parsers of foreign formats raise anything on damaged bytes (struct.error,
    UnicodeDecodeError, RuntimeError, KeyError, their own trees). Keep only parsing inside.

    Raises:
        FileFormatError: With the library's first words.
    """
    try:
        yield
    except (PriorReinforceError, KeyboardInterrupt):
        raise
    except Exception as error:
        words = str(error).split("\n")[0][:200] or "no reason given"
        raise FileFormatError(
            f"cannot read {path} as {what} ({type(error).__name__}: {words}); it is damaged or "
            "something else: copy it again from where it was recorded, or say its format"
        ) from error


def load_extra(module: str, extra: str) -> Any:
    """Import an optional library.

    Raises:
        MissingExtraError: It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{module.split('.')[0]} is not installed, which this format needs; run: "
            f'pip install "prior-reinforce[{extra}]"'
        ) from error


def natural_order(name: str) -> tuple[tuple[int, str], ...]:
    """Sort key by which `demo_10` follows `demo_9`."""
    return tuple(
        (int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    )


def files_in(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Files of a folder with one of the suffixes, in natural order; `outcomes.csv` is none."""
    found = [
        path
        for path in folder.iterdir()
        if path.is_file() and path.suffix.lower() in suffixes and path.name != "outcomes.csv"
    ]
    return sorted(found, key=lambda path: natural_order(path.name))
