"""Demonstrations and more of them, which were recorded later."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.preprocessing import copies
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.whole_turns import TURN


def appended(before: Demonstrations, more: Demonstrations) -> Demonstrations:
    """Return demonstrations with more of them; the shorter motions hold their last pose.

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
    for i, (name, unit) in enumerate(zip(more.format.names, more.format.units, strict=True)):
        apart = np.median(more.plans[:, 0, i]) - np.median(before.plans[:, 0, i])
        if unit in TURN and abs(apart) > 0.9 * TURN[unit]:
            raise InvalidDemonstrationsError(
                f"{name} of the new demonstrations starts {apart:.3g} {unit} from where it did so "
                "far, about a turn; import all together"
            )
    horizon = max(before.horizon, more.horizon)
    plans = [
        np.pad(d.plans, ((0, 0), (0, horizon - d.horizon), (0, 0)), mode="edge")
        for d in (before, more)
    ]
    said = [f"demonstration {i} so far" for i in range(before.n)]
    said += [f"new one {i}" for i in range(more.n)]
    if twice := copies(np.concatenate(plans), said):
        raise InvalidDemonstrationsError(twice)
    both: dict[str, Any] = {
        name: np.concatenate([getattr(before, name), getattr(more, name)])
        for name in ("outcomes_seen", "outcome_noise", "outcome_correction")
    }
    return replace(more, plans=np.concatenate(plans), **both)
