"""Many attacks, and one table by class: tried, held, broke.

A third as many on the way to the arm, a tenth as many kills.

python -m tests.attacks.table [CASES] [SEED]
"""

from __future__ import annotations

import collections
import random
import shutil
import sys
import tempfile
import warnings
from pathlib import Path

from prior_reinforce.bench.workspace.workspace import Workspace
from tests.attacks.classes import CLASSES
from tests.attacks.harness import HELD
from tests.bench.workspace.planar import demonstrations, manifest


def prepare(folder: Path) -> Path:
    """A workspace with one open trial; beside it `learned`, the same without a goal."""
    with Workspace.create(folder / "learned", manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        workspace.learn("interpolation")
    shutil.copytree(folder / "learned", folder / "asked")
    with Workspace(folder / "asked") as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
    return folder / "asked"


def attack(name: str, seed: int, asked: Path) -> str:
    """One attack of a class; `held`, or how it broke."""
    with tempfile.TemporaryDirectory() as here, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CLASSES[name](random.Random(f"{name} {seed}"), Path(here), asked)


def main(cases: int, seed: int) -> int:
    """Print the table; the number of attacks that broke something."""
    broke: dict[str, collections.Counter[str]] = {name: collections.Counter() for name in CLASSES}
    with tempfile.TemporaryDirectory() as place:
        asked = prepare(Path(place))
        for name, counted in broke.items():
            for case in range(cases // len(CLASSES)):
                verdict = attack(name, seed + case, asked)
                counted[verdict] += 1
                if verdict != HELD:
                    print(f"{name} {seed + case}: {verdict}", flush=True)
    print(f"{'class':<12} {'tried':>6} {'held':>6} {'broke':>6}")
    for name, counted in broke.items():
        held = counted.pop(HELD, 0)
        print(f"{name:<12} {held + counted.total():>6} {held:>6} {counted.total():>6}")
    from tests.attacks import execution, kills  # they prepare what they attack as we do

    moved, lost = execution.main(cases // 3, seed), kills.main(cases // 10, seed)
    return sum(counted.total() for counted in broke.values()) + moved + lost


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    sys.exit(main(*(numbers + [3000, 0][len(numbers) :])) > 0)
