"""Print the lowest declared version of every library that `make lowest` tries, as pip takes them.

Not of torch and MuJoCo, which are gigabytes; what needs them is tested with constraints.txt.
"""

from __future__ import annotations

import sys
from pathlib import Path

from packaging.requirements import Requirement

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
EXTRAS = ("vlm", "lerobot", "hdf5", "ros", "zarr", "console", "camera")


def pins() -> list[str]:
    """Each library with its floor as the only version."""
    extras = PROJECT["optional-dependencies"]
    lines = [*PROJECT["dependencies"], *(line for extra in EXTRAS for line in extras[extra])]
    found = []
    for each in map(Requirement, lines):
        floor = next(s.version for s in each.specifier if s.operator == ">=")
        if each.marker is None or each.marker.evaluate():
            found.append(f"{each.name}=={floor}")
    return found


if __name__ == "__main__":
    print("\n".join(pins()))
