"""The shipped prior sets; `python -m prior_reinforce.lab.tasks.demonstrations.NAME` made each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from prior_reinforce.plans.motions import Demonstrations


def write_sets(
    make: Callable[[str], Demonstrations], names: Iterable[str], recordings: str, about: str | None
) -> None:
    """Make prior sets and write them to the folder that the command line names.

    Args:
        make: Makes the set of a name.
        names: Of the sets.
        recordings: Files are called `<recordings>_<set>.npz`.
        about: For the command's help.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent)
    folder = parser.parse_args().folder
    for name in names:
        make(name).save(folder / f"{recordings}_{name}.npz")
