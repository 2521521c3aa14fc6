"""Text that is safe to print, and its colour; loads nothing, for commands that only say a line."""

from __future__ import annotations

import os
import unicodedata
from typing import TextIO

RED, YELLOW, GREEN = "1;31", "33", "32"
"""ANSI codes."""
_UNPRINTED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode's control and format characters, lone surrogates, and line separators."""


def plain(text: str, keep: str = "") -> str:
    """Escape control characters but for `keep` in untrusted text, such as a name, to print it."""
    return "".join(
        char.encode("unicode_escape").decode()
        if char not in keep and unicodedata.category(char) in _UNPRINTED
        else char
        for char in text
    )


def coloured(text: str, code: str, stream: TextIO) -> str:
    """Return a text in an ANSI colour where its stream is a terminal that shows one (NO_COLOR)."""
    plainly = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plainly or not stream.isatty() else f"\x1b[{code}m{text}\x1b[0m"
