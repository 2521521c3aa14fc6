"""Small synthetic demonstrations, each fixture a function that makes some."""

from __future__ import annotations

import numpy as np
import pytest

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


def _swing(times: np.ndarray, start: float, duration: float) -> np.ndarray:
    """Minimum-jerk time course from 0 to 1 (Flash and Hogan 1985)."""
    s = np.clip((times - start) / duration, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _throws(n: int = 4, horizon: int = 140, seed: int = 0) -> Demonstrations:
    """Swings of two joints begun at different times, and a third joint that sets the direction.

    The outcome is (amplitude, direction) in metres: what an ideal throw would make of them.
    """
    rng = np.random.default_rng(seed)
    outcomes = np.column_stack(
        [rng.permutation(np.linspace(0.8, 1.1, n)), rng.uniform(-0.3, 0.3, n)]
    )
    times = np.arange(horizon) / horizon
    plans = np.empty((n, horizon, 3))
    for plan, (reach, side) in zip(plans, outcomes, strict=True):
        path = _swing(times, start=rng.uniform(0.02, 0.3), duration=0.6)
        plan[:, 0] = -1.0 + reach * path
        plan[:, 1] = 2.0 - 0.8 * reach * path
        plan[:, 2] = side
    return Demonstrations(plans, outcomes, _plan_format(3))


def _plan_format(action_dim: int) -> PlanFormat:
    """A format of as many joints."""
    return PlanFormat(
        tuple(f"joint{d + 1}" for d in range(action_dim)), ("rad",) * action_dim, 0.0125
    )


@pytest.fixture
def swing():
    """A minimum-jerk time course from 0 to 1: times, start, duration."""
    return _swing


@pytest.fixture
def throws():
    """Demonstrations of throws: n, horizon, seed."""
    return _throws


@pytest.fixture
def plan_format():
    """A format of as many joints."""
    return _plan_format
