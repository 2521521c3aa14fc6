"""Demonstrations and more of them, which were recorded later."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.preprocessing import copies
from prior_reinforce.arm.recordings.turns import align
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.whole_turns import TURN

_FACTORS: Mapping[str, tuple[float, ...]] = {"rad": (180 / np.pi,), "m": (10.0, 100.0, 1000.0)}
"""How many times too large or small a channel is in another unit, by its own: degrees, cm, mm."""
_ANY_FACTORS = (10.0, 100.0, 1000.0)
_FITS = 0.3
"""Share of the largest number by which starts and ends may differ once brought to one unit. Ours:
demonstrations of one task start alike, and end about as far."""
_LEAST: Mapping[str, float] = {"rad": 1.0, "m": 0.5}
"""Of numbers in a smaller unit than they are said to be in, the largest: a channel that moves by
less than a degree or a millimetre is hardly used. Ours."""
_STARTS = 0.2
"""Part of that which suffices where the start is as many times off as the end. Ours."""


def appended(
    before: Demonstrations, more: Demonstrations, limits: RobotLimits | None = None
) -> Demonstrations:
    """Return demonstrations with more of them; the shorter motions hold their last pose.

    Those in use stay as they are. The new ones are brought to the same turns and signs, as those of
    one import are (`turns.align`), within the robot's `limits`; a warning says which.

    Raises:
        InvalidDemonstrationsError: They mean other numbers, or have a motion twice.
    """
    for what, one, other in (
        ("plans of", before.format, more.format),
        ("outcomes", before.outcome_format.names, more.outcome_format.names),
        ("outcomes in", before.outcome_format.units, more.outcome_format.units),
    ):
        if one != other:
            raise InvalidDemonstrationsError(
                f"the demonstrations so far have {what} {one}, the new ones {other}; import all "
                "together"
            )
    for what in _out_of_scale(before, more):
        raise InvalidDemonstrationsError(what)
    said = [f"demonstration {i} so far" for i in range(before.n)]
    said += [f"new one {i}" for i in range(more.n)]
    motions = [*np.array(before.plans), *np.array(more.plans)]
    form, done = align(before.format, said, motions, limits, fixed=before.n)
    if any(np.any(m != p) for m, p in zip(motions, before.plans, strict=False)):
        raise InvalidDemonstrationsError(
            f"with the new demonstrations, those so far are other turns or signs of the same poses "
            f"({'; '.join(done)}); import all together"
        )
    for remark in done:
        warnings.warn(remark, stacklevel=2)
    new = np.stack(motions[before.n :])
    for i, (name, unit) in enumerate(zip(form.names, form.units, strict=True)):
        apart = np.median(new[:, 0, i]) - np.median(before.plans[:, 0, i])
        if unit in TURN and abs(apart) > 0.9 * TURN[unit]:
            raise InvalidDemonstrationsError(
                f"{name} of the new demonstrations starts {apart:.3g} {unit} from where it did so "
                "far, about a turn; import all together"
            )
    horizon = max(before.horizon, more.horizon)
    plans = [
        np.pad(p, ((0, 0), (0, horizon - p.shape[1]), (0, 0)), mode="edge")
        for p in (before.plans, new)
    ]
    if twice := copies(np.concatenate(plans), said):
        raise InvalidDemonstrationsError(twice)
    both: dict[str, Any] = {
        name: np.concatenate([getattr(before, name), getattr(more, name)])
        for name in ("outcomes_seen", "outcome_noise", "outcome_correction")
    }
    return replace(more, plans=np.concatenate(plans), format=form, **both)


def _out_of_scale(before: Demonstrations, more: Demonstrations) -> Iterator[str]:
    """Channels whose numbers are so many times those in use that they are in another unit."""
    for i, (name, unit) in enumerate(zip(more.format.names, more.format.units, strict=True)):
        ours, theirs = (_ends(each.plans[:, :, i]) for each in (before, more))
        largest, least = np.abs([ours, theirs]).max(), np.abs([ours, theirs]).max(axis=1).min()
        if unit == "1" or least == 0:
            continue
        for factor in _FACTORS.get(unit, _ANY_FACTORS):
            for larger, smaller in ((theirs, ours), (ours, theirs)):
                fits = np.abs(larger - factor * smaller).max() < _FITS * largest
                # Many times the way may be a longer way; where it starts as well it is a unit.
                starts = np.abs(larger[0]) > _FITS * largest
                enough = _LEAST.get(unit, 0.0) * (_STARTS if starts else 1)
                if fits and largest > enough and (starts or factor > _ANY_FACTORS[0]):
                    yield (
                        f"{name} goes from {theirs[0]:.4g} to {theirs[1]:.4g} {unit} in the new "
                        f"demonstrations, and from {ours[0]:.4g} to {ours[1]:.4g} in those so far, "
                        f"about {factor:.4g} times as much or as little: one of them is in another "
                        "unit; say those of the new ones (--units), or import all together"
                    )


def _ends(channel: Float[np.ndarray, "N H"]) -> Float[np.ndarray, "2"]:
    """Where a channel starts and ends in the middle one of N plans."""
    return np.median(channel[:, [0, -1]], axis=0)
