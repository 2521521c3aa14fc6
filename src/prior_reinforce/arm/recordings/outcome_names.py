"""Which recording a row of a table of outcomes is of, and which component a column is."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.wording import PLACE_WORDS, axes_of

_DATE = r"(?:(?:19|20)\d\d([-_.]?)[01]\d\1[0-3]\d|[0-3]\d([-_.])[01]\d\2(?:19|20)\d\d)"
_TIME = r"(?:[T_ .-]?[0-2]\d[-_.:h]?[0-5]\d(?:[-_.:m]?[0-5]\d%s)?)?"
_PART = r"(?:[-_.,]?\d{3,9})?(?:Z|[+-]\d\d:?\d\d)?"
"""Part of a second, and the time zone."""
_PAIRS = r"(?<!\d)[0-3]\d(?P<sign>[-.:])[0-5]\d(?P=sign)[0-5]\d%s(?!\d)"
"""A time of day, or a date with a short year. `throw_01_02_03` is neither: it is numbered."""
_DATED = re.compile(f"(?:{_DATE}{_TIME % _PART}|{_PAIRS % _PART})$")
"""A date, one with its time of day, or that alone, at the end of a name."""
_DATES = re.compile(f"{_DATE}{_TIME % ''}|{_PAIRS % ''}")
_NUMBER = re.compile(r"([^\W\d_]*)([\W_]*)0*([0-9]+)")
"""A number, and the word or the signs before it."""
_RADII = ("r", "radius", "distance", "dist", "range")
_BEARINGS = ("angle", "bearing", "azimuth", "theta", "phi", "heading", "direction")
_ERRORS = re.compile(
    r"(?i)d[xyz]|(.*[^a-z])?(err|errors?|delta|diff|dev|deviation|miss|missed|off|offset|residual|"
    r"fehler|abweichung)([^a-z].*)?"
)
"""Names of what is measured from a target."""


def digits_at_end(name: str) -> str:
    """Return the number at the end of a name, without leading zeros; empty if there is none.

    The last digits of a time, `2024-05-03_14-02-03` or `14-02-03`, are no number of an episode.
    """
    match = re.search(r"0*([0-9]+)$", name)
    return match[1] if match and not _DATED.search(name) else ""


def number_of(name: str, word: str) -> str:
    """Return the number behind a word in a name, else the one at its end, without leading zeros."""
    return _numbers(name).get(word) or digits_at_end(name)


def _numbers(name: str) -> dict[str, str]:
    """Numbers that are no dates, by the word before each, or by the signs if there is none."""
    found = _NUMBER.findall(_DATES.sub("#", name))
    return {word.lower() or signs or "#": number for word, signs, number in found}


def telling_word(
    word: str, episodes: Sequence[str], there: Sequence[str], rows: Sequence[str]
) -> str:
    """Return the word if rows give the number behind it; empty if they give the one at the end.

    The first counts if it tells the `episodes` apart, unless only the other is `there` for all rows
    that are no whole names, or for all episodes where rows are of others, too.
    InvalidDemonstrationsError if other numbers are there for all rows, and the word decides not.
    """
    wanted = {digits_at_end(row) for row in rows if row not in there} - {""}
    if not wanted or not episodes:
        return ""
    apart, fitting = dict[str, list[str]](), list[str]()
    of_rows = {*map(tuple, map(_numbers, rows))} - {("#",)}
    word = next(iter(*of_rows), word) if len(of_rows) == 1 else word  # `throw_1` says throw
    for label in ["", *_numbers(episodes[0])]:
        numbers = [number_of(name, label) for name in episodes]
        every = {number_of(name, label) for name in there}
        shared = not label or all(label in _numbers(name) for name in episodes)
        if shared and len({*numbers} - {""}) == len(episodes) and len(every) >= min(2, len(there)):
            apart[label] = numbers
            fitting += [label] * (wanted <= every or {*numbers} <= wanted)
    if word in apart and (word in fitting or "" not in fitting):
        return word
    for label in fitting if "" in fitting else ():
        for name, one, other in zip(episodes, apart[label], apart[""], strict=True):
            if one != other:
                raise InvalidDemonstrationsError(
                    f"{name} may be row {one} or row {other}: either number in the names is there "
                    f"for all rows; call the rows by the recordings' names ({name})"
                )
    return ""


def how_to_renumber(word: str, episodes: Sequence[str], rows: Sequence[str]) -> str:
    """Say what to do where rows may be numbered otherwise than the episodes; else empty."""
    ours = [number_of(name, word) for name in episodes]
    theirs = [digits_at_end(name) for name in rows]
    if not (all(theirs) and ours and theirs):
        return ""
    unlike = not all(ours) or min(map(int, ours)) == min(map(int, theirs))
    counted = sorted(map(int, theirs))
    if unlike and counted in ([*range(len(ours))], [*range(1, len(ours) + 1)]):
        name = episodes[-1]
        return (
            f"the table seems to count the {len(ours)} recordings in their order: if it does, call "
            f"its rows by their names ({counted[-1]} is {name}); else "
        )
    if not all(ours) or len({*ours}) < len(ours):
        return ""
    first, of_table = min(map(int, ours)), min(map(int, theirs))
    if first == of_table or len(theirs) > len(ours):
        return ""
    return f"the table begins with {of_table}, and they with {first}: renumber it if so; else "


def columns_of(names: Sequence[str], there: Sequence[str]) -> dict[str, list[tuple[int, int]]]:
    """Return what columns each component may be, with signs: by name, or by where it counts up."""
    axes = axes_of(OutcomeFormat(tuple(names), ("m",) * len(names)))
    found = {}
    for name, axis in zip(names, axes, strict=True):
        words = PLACE_WORDS[axis] if axis < len(PLACE_WORDS) else ()
        signs = {name.lower(): 1} | dict(zip(words, (1, -1), strict=False))
        found[name] = [(i, signs[n.lower()]) for i, n in enumerate(there) if n.lower() in signs]
    return found


def remedy_for(missing: Sequence[str], there: Sequence[str]) -> str:
    """Say what to do where a table lacks components: a clause."""
    what, axes = ", ".join(missing), "x is ahead of the base, y to its left"
    if errors := [name for name in there if _ERRORS.fullmatch(name)]:
        return (
            f"{', '.join(errors)} may be measured from a target, and outcomes are places; add the "
            f"target's place to them, as {what} ({axes})"
        )
    if (heights := [name for name in there if name in ("z", "Z")]) and {*missing} <= {"x", "y"}:
        return (
            f"{heights[0]} is no {what}; add it, and turn what a camera saw in its own axes into "
            f"the base's first ({axes})"
        )
    polar = ""
    if {*_RADII}.intersection(there) and {*_BEARINGS}.intersection(there):
        polar = "; of a distance r and a bearing b to the left, x = r cos b and y = r sin b"
    return f"rename or add it ({axes}{polar})"
