"""Demonstrations recorded later: in the units of the first, and none of them again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.takes import APART, names_in_use
from prior_reinforce.arrays import Plans
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.speeds import largest_of_unit
from prior_reinforce.wording import listed

_FACTORS = (10.0, 100.0, 1000.0)
"""How many times too large or small a channel is in another unit, where it is no angle: cm, mm."""
_FITS = 0.3
"""Share of the largest number by which starts and ends may differ once brought to one unit. Ours:
demonstrations of one task start alike, and end about as far."""
_LEAST: Mapping[str, float] = {"rad": 1.0, "m": 0.5}
"""Largest number of a channel that must be exceeded in the larger unit: less than a degree or a
millimetre is hardly a motion. Ours."""
_STANDS = 0.02
"""Part of its largest number by which a channel moves at least that tells its unit. Ours."""
_STARTS = 0.2
"""Part of that which suffices where the start is as many times off as the end. Ours."""
_CUT, _AGAIN = 0.2, 0.02
"""Largest shift in time between two recordings of one motion, in [s], and largest change by
smoothing, as a share of the largest range. Ours."""


def check_scale(before: Demonstrations, selection: Selection) -> None:
    """Refuse recordings in other columns or units than those in use: InvalidDemonstrationsError."""
    form = before.format
    _check_alike(
        ("columns", form.names, selection.names), ("plans in", form.units, selection.units)
    )
    _check_numbers(before, [each.positions for each in selection.recordings])


def appended(
    before: Demonstrations, more: Demonstrations, episodes: Sequence[str]
) -> Demonstrations:
    """Return demonstrations with more, which `inspect` aligned; short ones hold their last pose.

    InvalidDemonstrationsError if names or units differ, or a motion comes twice.
    """
    ours, theirs = before.outcome_format, more.outcome_format
    _check_alike(
        ("plans of", before.format, more.format),
        ("outcomes", ours.names, theirs.names),
        ("outcomes in", ours.units, theirs.units),
    )
    horizon = max(before.horizon, more.horizon)
    plans = np.concatenate(
        [
            np.pad(p, ((0, 0), (0, horizon - p.shape[1]), (0, 0)), mode="edge")
            for p in (before.plans, more.plans)
        ]
    )
    if twice := copies(plans, [*names_in_use(before.n), *episodes]):
        raise InvalidDemonstrationsError(twice)
    again = [name for i, name in enumerate(episodes) if _is_there(before, more, i)]
    if again:
        drop = f"--leave-out {shlex.join(again)}"
        if len(again) == len(episodes):
            drop = "there is nothing to append"
        raise InvalidDemonstrationsError(
            f"{listed(again)} landed where demonstrations so far did to the last digit, after the "
            f"same motion: if they are these throws again, smoothed or cut elsewhere, {drop}; else "
            "import all anew without --append"
        )
    both: dict[str, Any] = {
        name: np.concatenate([getattr(before, name), getattr(more, name)])
        for name in ("outcomes_seen", "outcome_noise", "outcome_correction")
    }
    return replace(more, plans=plans, **both)


def copies(plans: Plans, names: Sequence[str]) -> str:
    """Name two identical motions, as a copied file or a plan that ran twice has them; else ""."""
    first: dict[bytes, str] = {}
    for plan, name in zip(plans, names, strict=True):
        other = first.setdefault(plan.tobytes(), name)
        if other != name:
            return (
                f"{other} and {name} are one motion to the last number; if a file was copied, drop "
                "it; if one plan was executed twice, give it once, with the middle of where it "
                "landed (--leave-out); else what was taken is no motion: see the channels"
            )
    return ""


def _is_there(before: Demonstrations, more: Demonstrations, i: int) -> bool:
    """Whether a demonstration in use has a new one's outcome and motion, but for a small delay."""
    most = round(_CUT / before.format.dt)
    new = np.pad(more.plans[i], ((most, most + before.horizon), (0, 0)), mode="edge")
    span = largest_of_unit(np.ptp(more.plans[i], axis=0), more.format.units)
    for j in np.flatnonzero(np.all(before.outcomes_seen == more.outcomes_seen[i], axis=1)):
        own = before.plans[j]
        parts = (new[first : first + before.horizon] for first in range(2 * most + 1))
        if any(
            np.all(np.sqrt(np.mean((own - part) ** 2, axis=0)) <= _AGAIN * span) for part in parts
        ):
            return True
    return False


def _check_alike(*said: tuple[str, object, object]) -> None:
    """Refuse new demonstrations of which something is another than of those in use."""
    for what, ours, theirs in said:
        if ours != theirs:
            raise InvalidDemonstrationsError(
                f"the demonstrations so far have {what} {ours}, the new ones {theirs}; import all "
                "together"
            )


def _check_numbers(before: Demonstrations, motions: Sequence[Float[np.ndarray, "T D"]]) -> None:
    """Refuse a channel whose numbers are so many times those in use that its unit is another."""
    for i, (name, unit) in enumerate(zip(before.format.names, before.format.units, strict=True)):
        # Where it starts and ends in the middle one of the motions.
        ours, theirs = (
            np.median([motion[[0, -1], i] for motion in each], axis=0)
            for each in (before.plans, motions)
        )
        largest, least = np.abs([ours, theirs]).max(), np.abs([ours, theirs]).max(axis=1).min()
        stands = max(np.ptp(ours), np.ptp(theirs)) < _STANDS * largest  # somewhere in each
        if unit == "1" or least == 0 or stands:
            continue
        for factor in APART[unit] if unit == "rad" else _FACTORS:
            for larger, smaller in ((theirs, ours), (ours, theirs)):
                fits = np.abs(larger - factor * smaller).max() < _FITS * largest
                # Many times the way may be a longer way; where it starts as well it is a unit.
                starts = np.abs(larger[0]) > _FITS * largest
                enough = _LEAST.get(unit, 0.0) * (_STARTS if starts else 1)
                if fits and largest > enough and (starts or factor > _FACTORS[0]):
                    raise InvalidDemonstrationsError(
                        f"{name} goes from {theirs[0]:.4g} to {theirs[1]:.4g} {unit} in the new "
                        f"demonstrations, and from {ours[0]:.4g} to {ours[1]:.4g} in those so far, "
                        f"about {factor:.4g} times as much or as little: one of them is in another "
                        "unit; say those of the new ones (--units), or import all together"
                    )
