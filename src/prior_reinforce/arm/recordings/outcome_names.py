"""Match the rows of a table of outcomes to recordings, and its columns to components."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from pathlib import Path

from prior_reinforce.arm.recordings.recording import ROW_COLUMNS
from prior_reinforce.arm.recordings.tables import Table
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from prior_reinforce.files import from_cell
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
_NO_OUTCOMES = {"target", "goal", "aim", "aimed", "desired", "wanted", "planned", "ref", "note"}
_NO_OUTCOMES |= {"reference", "soll", "ziel"}
_NO_OUTCOMES |= {"command", "commanded", "cmd", "release", "released", "start", "initial", "begin"}
"""Words in the names of places that are not where the object landed."""
_OUTCOMES = {"landing", "landed", "land", "actual", "measured", "meas", "hit", "impact", "outcome"}
_OUTCOMES |= {"end", "final", "result", "rest", "stop", "stopped", "seen", "true", "real"}
_OUTCOMES |= {"ist", "gemessen", "landung"}
"""Words in the names of places that may be where it landed."""
_FILES = {"file", "filename", "path", "recording", "video", "bag", "log"}
"""Names of columns that say the file of a recording."""
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
FILE = re.compile(
    r"(?:.*[/\\])?([^/\\]+)\.(?:csv|tsv|txt|npz|npy|hdf5|h5|bag|mcap|db3|zarr|mp4|avi|jpe?g|png)",
    re.IGNORECASE,
)
"""Path of a recording, or of what was filmed beside it, by which a row may call its episode."""
Key = tuple[str, tuple[str, ...]]
"""Name and cells of a column that may say of which recording each row is."""


def digits_at_end(name: str) -> str:
    """Return the number at the end of a name, without leading zeros; empty if none or a date."""
    match = re.search(r"0*([0-9]+)$", _whole(name))
    return match[1] if match and not _DATED.search(name) else ""


def number_of(name: str, word: str) -> str:
    """Return the number behind a word in a name, else the one at its end, without leading zeros."""
    return _numbers(name).get(word) or digits_at_end(name)


def _whole(name: str) -> str:
    """A whole number without the decimals that pandas writes, `1` for `1.0`; another as it is."""
    return re.sub(r"^(\d+)\.0+$", r"\1", name)


def _numbers(name: str) -> dict[str, str]:
    """Numbers that are no dates, by the word before each, or by the signs if there is none."""
    found = _NUMBER.findall(_DATES.sub("#", _whole(name)))
    return {word.lower() or signs or "#": number for word, signs, number in found}


def telling_word(
    word: str, episodes: Sequence[str], there: Sequence[str], rows: Sequence[str]
) -> str:
    """Return the word whose number the rows give; empty if they give the number at the end.

    The given word counts if it tells the `episodes` apart, unless only the number at the end is
    there for all rows. InvalidDemonstrationsError if several numbers are, and no word decides.
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


def names_in(table: Table, column: int) -> tuple[str, ...]:
    """Return what a column calls recordings: files without their folder and ending."""
    cells = [from_cell(cell) for cell in table.cells[column]]
    return tuple(file[1] if (file := FILE.fullmatch(cell)) else cell for cell in cells)


def keys_of(table: Table, first: int, beside: Collection[int]) -> list[Key]:
    """Return columns that may name the recordings: the first, others called so, and texts.

    Labels of sessions are left out where another column tells all rows apart. FileFormatError if a
    row comes again.
    """
    lower = [name.lower() for name in table.names]
    named = [first, *(i for i in beside if i != first and lower[i] in ROW_COLUMNS)]
    texts = [i for i in beside if i not in named and table.is_text(i)]
    cells = {i: names_in(table, i) for i in (*named, *texts)}
    few = [i for i in named if 2 * len({*cells[i]}) <= len(table)]
    alone = [i for i in named if len({*cells[i]}) == len(table)]
    for together in [[i] for i in named if i not in few] if alone else [named]:
        labels = list(zip(*(cells[i] for i in together), strict=True))
        for row, label in enumerate(labels):
            if label in labels[:row]:
                where = f"{table.where}, line {table.lines[row]}"
                raise FileFormatError(
                    f"{where}: episode {', '.join(label)} again; drop one of them"
                )
    return [(lower[i], cells[i]) for i in (*(alone or named), *texts)]


def order_of(cells: Sequence[str]) -> list[int]:
    """Return each row's place in the order of the numbers in its cells, or of the rows."""
    numbers = [digits_at_end(cell) for cell in cells]
    if not all(numbers) or len({*numbers}) < len(numbers):
        return [*range(len(cells))]
    order = {number: place for place, number in enumerate(sorted(map(int, numbers)))}
    return [order[int(number)] for number in numbers]


def rows_of(episodes: Sequence[str], word: str, cells: Sequence[str]) -> dict[str, int]:
    """Return row by episode, in their order; a number of two names matches none."""
    numbers = [number_of(episode, word) for episode in episodes]
    there, rows = list(map(digits_at_end, cells)), dict[str, int]()
    for episode, number in zip(episodes, numbers, strict=True):
        if episode in cells:
            rows[episode] = cells.index(episode)
        elif number and numbers.count(number) == 1 and there.count(number) == 1:
            rows[episode] = there.index(number)
    return rows


def telling_column(
    keys: Sequence[Key], chosen: Sequence[str], there: Sequence[str], where: str
) -> Key:
    """Return the cells that name most of the `chosen` episodes, and their `telling_word`.

    InvalidDemonstrationsError if the columns differ in which recording a row is of.
    """
    keys, each = _telling_columns(keys, there, where), list[Key]()
    for head, cells in keys:
        each.append((telling_word(head.split("_")[0], chosen, there, cells), cells))
    matches = [rows_of(chosen, *key) for key in each]
    refuse_unlike(where, keys, matches)
    return each[max(range(len(each)), key=lambda i: len(matches[i]))]


def _telling_columns(keys: Sequence[Key], there: Sequence[str], where: str) -> Sequence[Key]:
    """Return the columns by which rows are matched to recordings.

    File names of all recordings decide. Else every column counts that tells all rows apart. If only
    several columns do so together, as run and throw do, recordings must be numbered by both
    (`run1_throw2`): InvalidDemonstrationsError.
    """
    named = [key for i, key in enumerate(keys) if i == 0 or key[0] in ROW_COLUMNS]
    alone = [key for key in named if len({*key[1]}) == len(key[1])]
    exact = [len({*cells}.intersection(there)) for _, cells in keys]
    every = [
        key
        for key, number in zip(keys, exact, strict=True)
        if number in (len(key[1]), len(there)) and len({*key[1]}) == len(key[1])
    ]
    if files := [key for key in every if key in named or key[0] in _FILES]:
        return files
    if alone or every or len(named) < 2:
        return [*alone, *every] or named
    words = [head.split("_")[0] for head, _ in named]
    of = defaultdict[tuple[str | None, ...], list[str]](list)
    for name in there:
        of[tuple(map(_numbers(name).get, words))].append(name)
    rows = list(zip(*(map(digits_at_end, cells) for _, cells in named), strict=True))
    if any(len(of[row]) != 1 for row in rows):
        both, name = " and ".join(head for head, _ in named), "_".join(f"{w}_1" for w in words)
        raise InvalidDemonstrationsError(
            f"{where} tells its rows apart by {both} together, and the recordings are not called "
            f"by both ({name}): write their names in one column, episode, instead"
        )
    return [(words[-1], tuple(of[row][0] for row in rows))]


def refuse_unlike(where: str, keys: Sequence[Key], matches: Sequence[Mapping[str, int]]) -> None:
    """InvalidDemonstrationsError if by two columns an episode has another row, or a row another."""
    for (one, own), (other, of_other) in combinations(zip(keys, matches, strict=True), 2):
        pairs = {*own.items(), *of_other.items()}
        if not len({e for e, _ in pairs}) == len({row for _, row in pairs}) == len(pairs):
            raise InvalidDemonstrationsError(
                f"{where} says in {one[0]} and in {other[0]} of which recording a row is, and they "
                "differ: take out the one that does not, or call it note"
            )


def how_to_renumber(word: str, episodes: Sequence[str], rows: Sequence[str]) -> str:
    """Say what to do where rows may be numbered otherwise than the episodes; else empty."""
    ours = [number_of(name, word) for name in episodes]
    theirs = [digits_at_end(name) for name in rows]
    called = {*rows} <= {*episodes} and not any(map(str.isdigit, rows))  # by their whole names
    if called or not (all(theirs) and ours and theirs):
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


def other_places(path: Path, names: Collection[str], beside: Sequence[str]) -> list[str]:
    """Return columns of other places, `goal_x` and `goal_y` beside `x` and `y`.

    FileFormatError if they may be outcomes as well: `landing_x` and `landing_y`.
    """
    sets = defaultdict[tuple[str, ...], dict[str, str]](dict)
    for name in beside:
        words = [word.lower() for word in _WORDS.findall(name)]
        for i, word in enumerate(words):
            sets[(*words[:i], *words[i + 1 :])][word] = name
    left_out = list[str]()
    for rest, found in sets.items() if names else ():
        if not rest or not all(columns_of([*names], [*found]).values()):
            continue
        others = list(found.values())
        known = _NO_OUTCOMES.intersection(rest) or all(map(_ERRORS.fullmatch, others))
        if not known and any(word in _OUTCOMES or word.isdigit() for word in rest):
            own = ", ".join(names)
            raise FileFormatError(
                f"{path} has {', '.join(others)} beside {own}: call where the object landed {own}, "
                "and take out the other columns, or put note_ before their names"
            )
        left_out += others
    return left_out


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
