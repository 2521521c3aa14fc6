"""Many attacks, and one table by class: tried, held, broke.

    python -m tests.attacks.table [CASES] [SEED] [CLASS ...]

The classes share the cases as they do in the tests.
"""

from __future__ import annotations

import collections
import multiprocessing
import random
import sys
import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tests.attacks import arms, execution, flips, interruptions, reviewed, sessions, watching
from tests.attacks.classes import CLASSES, WRITERS, Attack, recordings
from tests.attacks.harness import HELD, prepare, where

ATTACKS: dict[str, tuple[Attack, int]] = {
    **{name: (attack, 3) for name, attack in CLASSES.items()},
    **{f"recordings: {kind}": (partial(recordings, kind), 2) for kind in WRITERS},
    **{
        # A program that hangs is waited for.
        f"motions: {kind}": (partial(execution.attack, kind), 1 if kind == "hangs" else 2)
        for kind in execution.KINDS
    },
    "flips": (flips.attack, 3),
    "arms": (arms.attack, 3),
    "watching": (watching.attack, 9),
    **{
        f"{how}: {name}": (partial(interruptions.attack, how, name), 1)
        for how in interruptions.HOW
        for name in interruptions.COMMANDS
    },
    **{name: (partial(reviewed.attack, name), 1) for name in reviewed.QUICK},
    "killed sessions": (sessions.attack, 1),
}
"""Each class, and how many of it the tests try."""


def attack(name: str, seed: int, asked: Path) -> str:
    """One attack of a class; `held`, or how it broke."""
    here = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
    with here, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return ATTACKS[name][0](random.Random(f"{name} {seed}"), Path(here.name), asked)
        except AssertionError as error:
            return where(error)


def main(cases: int, seed: int, *names: str) -> int:
    """Print the table; the number of attacks that broke something."""
    chosen = {name: ATTACKS[name][1] for name in names or ATTACKS}
    share = cases / sum(chosen.values())
    broke = 0
    print(f"{'class':<20} {'tried':>6} {'held':>6} {'broke':>6}")
    fork = multiprocessing.get_context("fork")
    with tempfile.TemporaryDirectory() as place, ProcessPoolExecutor(12, fork) as pool:
        asked = prepare(Path(place))
        for name, usual in chosen.items():
            seeds = range(seed, seed + max(1, round(share * usual)))
            counted: collections.Counter[str] = collections.Counter()
            verdicts = pool.map(partial(attack, name, asked=asked), seeds)
            for case, verdict in zip(seeds, verdicts, strict=True):
                counted[verdict] += 1
                if verdict != HELD:
                    print(f"{name} {case}: {verdict}", flush=True)
            held = counted.pop(HELD, 0)
            broke += counted.total()
            print(f"{name:<20} {len(seeds):>6} {held:>6} {counted.total():>6}", flush=True)
    return broke


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:3]]
    sys.exit(main(*(numbers + [3000, 0][len(numbers) :]), *sys.argv[3:]) > 0)
