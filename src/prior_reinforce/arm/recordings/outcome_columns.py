"""Which columns of a table are the components of an outcome, and what to do where none is."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.wording import PLACE_WORDS, axes_of

_RADII = ("r", "radius", "distance", "dist", "range")
_BEARINGS = ("angle", "bearing", "azimuth", "theta", "phi", "heading", "direction")
_ERRORS = re.compile(
    r"(?i)d[xyz]|(.*[^a-z])?(err|errors?|delta|diff|dev|deviation|miss|missed|off|offset|residual|"
    r"fehler|abweichung)([^a-z].*)?"
)
"""Names of what is measured from a target."""


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
