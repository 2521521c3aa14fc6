"""Demonstrations that cost nothing to make."""

from __future__ import annotations

import numpy as np

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

_UNITS = ("m", "s", "N")
_SPREAD = (0.3, 40.0, 1e-3)


def synthetic_demonstrations(
    n: int = 6, *, horizon: int = 40, action_dim: int = 3, k: int = 2, seed: int = 0
) -> Demonstrations:
    """Smooth motions from rest to rest that begin at different times.

    Args:
        n: N, how many.
        horizon: H, frames of each.
        action_dim: D, joints of each.
        k: Components of an outcome, at most 3, each in a unit and of a size of its own.
        seed: Of outcomes and motions; the same seed gives the same numbers.
    """
    rng = np.random.default_rng(seed)
    outcomes = rng.uniform(size=(n, k)) * _SPREAD[:k]
    times = np.linspace(0, 1, horizon)
    share = np.clip((times - rng.uniform(0.05, 0.3, (n, 1))) / 0.6, 0, 1)[:, :, None]
    plans = rng.normal(size=(n, 1, action_dim)) + share**2 * (3 - 2 * share)
    names = tuple(f"joint{d + 1}" for d in range(action_dim))
    plan_format = PlanFormat(names, ("rad",) * action_dim, 0.02)
    return Demonstrations(plans, outcomes, plan_format, OutcomeFormat(tuple("xyz"[:k]), _UNITS[:k]))
