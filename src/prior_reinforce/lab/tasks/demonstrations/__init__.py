"""The shipped prior sets; `python -m prior_reinforce.lab.tasks.demonstrations.NAME` made each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from prior_reinforce.plans.motions import Demonstrations


def write_sets(
    make: Callable[[str], Demonstrations], names: Iterable[str], recordings: str, about: str | None
) -> None:
    """Make prior sets, and write them as `<recordings>_<set>.npz` where the command line says."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent)
    folder = parser.parse_args().folder
    for name in names:
        make(name).save(folder / f"{recordings}_{name}.npz")
