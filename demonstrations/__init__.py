"""How the shipped prior sets were made: `make demonstrations` makes them again, bit for bit.

One module a task; `python -m demonstrations.NAME` makes its sets.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

import prior_reinforce.lab.tasks as tasks
from prior_reinforce.plans.motions import Demonstrations


def write_sets(
    make: Callable[[str], Demonstrations], names: Iterable[str], recordings: str, about: str | None
) -> None:
    """Make prior sets, and write them as `<recordings>_<set>.npz` where the command line says."""
    parser = argparse.ArgumentParser(description=about)
    shipped = Path(tasks.__file__).parent / "demonstrations"
    parser.add_argument("--folder", type=Path, default=shipped)
    folder = parser.parse_args().folder
    for name in names:
        make(name).save(folder / f"{recordings}_{name}.npz")
