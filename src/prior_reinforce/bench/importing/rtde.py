"""The rows that ur_rtde's recorder (1.6.5) mixes from two cycles of UR's controller.

It runs beside the controller, reads the variables of a row one by one, and writes rows again where
no new cycle came. UR's own recorder (rtde/csv_writer.py) writes each cycle once, and mixes none.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from prior_reinforce.bench.importing.clock import Times
from prior_reinforce.bench.importing.recording import Positions
from prior_reinforce.plans.signals import REST_SPEED

_CYCLE = 0.002
"""Period of UR's controller, in [s]."""
_SAME_CYCLE = 0.1
"""A median step that differs from the cycle by a smaller share is the cycle. Ours."""
_COUNTS = 1.5
"""Steps of up to so many counts of the numbers are rounding. Ours."""


def mixed_rows(stamps: Times, positions: Positions) -> Bool[np.ndarray, " T"]:
    """Return which rows have their positions from another cycle than their time.

    Such a row has other positions than the one before at the same time, or a moving arm's that the
    next row repeats at the time they are of. The latter is told only at the controller's own cycle,
    in which no arm comes to rest, and where the arm moves by more than one count of the numbers.
    Where no row is repeated as a whole, another recorder wrote the log, and none is.
    """
    again = (np.diff(stamps) == 0) & np.all(np.diff(positions, axis=0) == 0, axis=1)
    if not np.any(again):
        return np.zeros(len(stamps), dtype=bool)
    first = np.flatnonzero(np.concatenate([[True], ~again]))  # of rows that are wholly equal
    steps, moved = np.diff(stamps[first]), np.diff(positions[first], axis=0)
    mixed = np.zeros(len(first), dtype=bool)
    mixed[1:] = steps == 0
    if np.any(steps > 0) and abs(np.median(steps[steps > 0]) - _CYCLE) < _SAME_CYCLE * _CYCLE:
        count = np.abs(moved)[moved != 0].min(initial=np.inf)
        still = np.maximum(REST_SPEED["rad"] * steps, _COUNTS * count)
        came, repeated = np.abs(moved).max(axis=1) > still, np.all(moved == 0, axis=1)
        mixed[1:-1] |= came[:-1] & repeated[1:]
    return np.repeat(mixed, np.diff(np.append(first, len(stamps))))
