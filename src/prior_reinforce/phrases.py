"""What people say in other words than `parsing` reads, said in its words; the phrases are ours."""

from __future__ import annotations

import re
from collections.abc import Sequence

_FILLERS = re.compile(r"\b(?:about|approximately|approx\.?|around|roughly|circa|ca\.?|too)\s+|~\s*")
"""What people say beside a length, which is an estimate anyway."""


def plainer(text: str) -> str:
    """Return a text in lower case, without fillers."""
    return _FILLERS.sub("", text.strip().lower())


def values_by_name(text: str, names: Sequence[str]) -> str | None:
    """Return what stands behind each name, in the names' order: `x 5 cm, t 0.2 s` is `5 cm; 0.2 s`.

    None if they are not all named once, or something stands before them.
    """
    each = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    split = re.split(rf"(?:^|(?<=[\s,;]))({each})[\s:=]+", text.strip(), flags=re.IGNORECASE)
    before, found = split[0], [name.lower() for name in split[1::2]]
    if before or sorted(found) != sorted(name.lower() for name in names):
        return None
    values = dict(zip(found, split[2::2], strict=True))
    return "; ".join(values[name.lower()].strip(" ,;") for name in names)
