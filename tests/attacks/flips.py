"""One bit of a journal flipped where SQLite keeps its structure, or the file cut.

Headers of the file and of its pages, counts and places of cells, ends of pages and of the file.
Whatever is hit, the journal is refused by name, or says what it said, takes the next event and
keeps all.
"""

from __future__ import annotations

import random
import shutil
import tempfile
from functools import cache
from pathlib import Path

import msgspec

from prior_reinforce.arm.workspace.events import PlanAsked
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import PriorReinforceError
from prior_reinforce.session.events import Entry, Told, Voided
from tests.attacks.harness import HELD, REMEDY, limited

TRIALS = 30
"""Enough for a tree of pages."""
_FILE_HEADER, _INTERIOR = 100, 5


@cache
def several(asked: Path) -> tuple[Path, bytes, list[Entry]]:
    """A workspace of this process alone, its journal of many trials, and the events in it."""
    folder = Path(tempfile.mkdtemp(prefix="flipped-", dir=asked.parent)) / "planar"
    shutil.copytree(asked, folder)
    with Workspace(folder) as workspace:
        workspace.session().tell(1, [0.05, 0.0])
        first, told = (
            next(e.event for e in workspace.events if type(e.event) is kind)
            for kind in (PlanAsked, Told)
        )
        with workspace.log.exclusive():
            for number in range(2, TRIALS + 1):
                workspace.log.append(msgspec.structs.replace(first, trial=number))
                workspace.log.append(msgspec.structs.replace(told, trial=number, hit=True))
            workspace.log.append(Voided(trial=TRIALS, reason="the ball was pushed"))
        events = list(workspace.events)
    return folder, (folder / "journal.sqlite").read_bytes(), events


def places(content: bytes) -> dict[str, list[int]]:
    """Where a bit is worth flipping, by what it belongs to."""
    size = int.from_bytes(content[16:18], "big")
    found: dict[str, list[int]] = {"file header": list(range(_FILE_HEADER))}
    for page in range(0, len(content), size):
        at = page + (_FILE_HEADER if page == 0 else 0)
        header = 12 if content[at] == _INTERIOR else 8
        cells = int.from_bytes(content[at + 3 : at + 5], "big")
        found.setdefault("page headers", []).extend(range(at, at + header))
        found.setdefault("counts", []).extend((at + 3, at + 4))
        pointers = range(at + header, at + header + 2 * cells)
        found.setdefault("pointers", []).extend(pointers)
        found.setdefault("ends of pages", []).extend(range(page + size - 16, page + size))
    found["end of the file"] = list(range(len(content) - 64, len(content)))
    return found


def damaged(rng: random.Random, content: bytes) -> bytes:
    """The journal with one bit flipped, or, now and then, cut."""
    if rng.random() < 0.05:
        size = int.from_bytes(content[16:18], "big")
        pages = len(content) // size
        return content[: rng.choice([rng.randrange(len(content)), size * rng.randrange(pages)])]
    places_by_kind = places(content)
    at = rng.choice(places_by_kind[rng.choice(list(places_by_kind))])
    flipped = bytearray(content)
    flipped[at] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def attack(rng: random.Random, here: Path, asked: Path) -> str:
    """Flip a bit, read the journal, add an event, and read it again."""
    whole, content, before = several(asked)
    folder = here / "planar"
    shutil.copytree(whole, folder)
    return check(folder, damaged(rng, content), before)


def check(folder: Path, content: bytes, before: list[Entry]) -> str:
    """What became of a workspace with this for a journal."""
    (folder / "journal.sqlite").write_bytes(content)
    try:
        with limited(), Workspace(folder) as workspace:
            assert list(workspace.events) == before, "events were lost in silence"
            workspace.session().void(TRIALS - 1, "the next event")
    except PriorReinforceError as error:
        return HELD if REMEDY.search(str(error)) else f"no remedy: {error}"
    with limited(), Workspace(folder) as workspace:
        after = list(workspace.events)
    assert after[:-1] == before, "the next event damaged those before it"
    assert after[-1].kind == "voided", "the next event was lost"
    return HELD
