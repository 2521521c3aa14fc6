"""Which code makes a result."""

from __future__ import annotations

import hashlib
import subprocess
from functools import lru_cache
from pathlib import Path

_HERE = Path(__file__)


@lru_cache(maxsize=1)
def commit() -> str:
    """The checkout's commit when first asked, and a hash of what was changed since.

    Returns:
        As `git describe --dirty` gives it, with the hash of the difference where there is one;
        `not a checkout` where the package is in none, or there is no git.
    """
    if _git("ls-files", "--error-unmatch", _HERE.name) is None:
        return "not a checkout"
    described = _git("describe", "--always", "--dirty")
    if described is None:
        return "not a checkout"
    if not described.endswith("-dirty"):
        return described
    difference = _git("diff", "HEAD") or ""
    return f"{described}-{hashlib.sha256(difference.encode()).hexdigest()[:8]}"


def _git(*arguments: str) -> str | None:
    """What git says, or None where it cannot."""
    try:
        done = subprocess.run(
            ["git", *arguments], capture_output=True, text=True, cwd=_HERE.parent, check=False
        )
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None
