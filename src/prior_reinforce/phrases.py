"""What people say in other words than `parsing` reads, said in its words; the phrases are ours."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.units import SPELT

_FILLERS = re.compile(
    r"\b(?:about|approximately|approx\.?|around|roughly|circa|ca\.?"
    r"|way|far(?= too)|slightly|a (?:little )?bit|a little|too)\s+|~\s*"
)
"""What people say beside a length, which is an estimate anyway, or beside a direction alone."""
_PHRASES = {
    re.compile(r"\b(?:no|not a|did(?:n't| not)|almost(?: a)?|nearly(?: a)?) hit\b"): "miss",
    re.compile(r"\b(?:completely )?missed\b(?: completely)?|^nearly$|^almost$"): "miss",
    re.compile(r"\b(?:dead on|perfect|exact|bull'?s-? ?eye|on target)\b"): "on the goal",
    re.compile(r"\b(?:past the goal|overshoot|overshot)\b"): "long",
    re.compile(r"\b(?:undershoot|undershot)\b"): "short",
    re.compile(r"\bshort of(?: the goal)?\b"): "short",
    re.compile(r"\b(long|far|short|past)(\s*(?:,|;|\band\b)\s*)straight\b"): r"\1\g<2>0cm left",
    re.compile(r"(?<![a-z])([cm]m)s\b"): r"\1",
    re.compile(r"\bbetween\s+([\d.,]+\s*\S*)\s+and\s+(?=[\d.,])"): r"\1-",
}
"""What says the same as words that are read."""
_FRACTION = re.compile(r"(?<![\d.,/])(?:(\d+) +)?(\d)/([1-9])(?![\d/])")
_NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_UNITS = "|".join(filter(str.isalpha, SPELT))
_IN_WORDS = {
    re.compile(rf"\bhalf (?:an? )?(?=(?:foot|{_UNITS})\b)"): "0.5 ",
    re.compile(rf"\ban? (?=(?:foot|{_UNITS})\b)"): "1 ",
    **{re.compile(rf"\b{word}\b"): str(n) for n, word in enumerate(_NUMBERS)},
}
"""Numbers that are said."""
_FEET = re.compile(r"(?<!\d)(\d+(?:\.\d+)?)\s*(?:ft|feet|foot)\b")
"""Read here only: in the names of recorded channels, `left_foot` and `wrist_ft` are no units."""


def plainer(text: str) -> str:
    """Return a text in lower case, without fillers, and its phrases as words and numbers."""
    text = _FILLERS.sub("", text.strip().lower())
    for phrase, words in {**_IN_WORDS, **_PHRASES}.items():
        text = phrase.sub(words, text)
    text = _FRACTION.sub(lambda n: f"{int(n[1] or 0) + int(n[2]) / int(n[3]):.4g}", text)
    return _FEET.sub(lambda feet: f"{12 * float(feet[1]):.4g} in", text)


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
