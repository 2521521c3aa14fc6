"""Which code makes a result."""

from __future__ import annotations

import subprocess
from functools import lru_cache
from pathlib import Path


@lru_cache(maxsize=1)
def commit() -> str:
    """The checkout's commit, ending in `-dirty` where files were changed since.

    Returns:
        As `git describe` gives it; `not a checkout` where there is none.
    """
    described = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parent,
        check=False,
    )
    return described.stdout.strip() or "not a checkout"
