"""The paper's claims beside what was measured; verdicts follow from confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from prior_reinforce.lab.experiments.statistics import Curve, Interval

LEAST_TRAININGS = 3
"""Ours: an interval over fewer trainings knows nothing of how trainings differ, and decides no
claim."""


class Verdict(Enum):
    """What the measurement says about a claim."""

    CONFIRMED = "confirmed"
    """The whole interval lies where the claim says."""
    NOT_CONFIRMED = "not confirmed"
    """The whole interval lies elsewhere."""
    OPEN = "open"
    """The interval reaches both, or there are too few trainings."""


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, and what came of it."""

    paper: str
    """What the paper says, in our words or quoted."""
    measured: str
    """What we measured, with its interval."""
    verdict: Verdict


def above(interval: Interval, bound: float, trainings: int) -> Verdict:
    """Judge the claim that a quantity is above a bound.

    Returns:
        Confirmed where the lower end is above the bound, not confirmed where the upper end is not,
        open otherwise and with fewer than `LEAST_TRAININGS` trainings.
    """
    if trainings < LEAST_TRAININGS:
        return Verdict.OPEN
    if interval.low > bound:
        return Verdict.CONFIRMED
    return Verdict.NOT_CONFIRMED if interval.high <= bound else Verdict.OPEN


def at_most(interval: Interval, bound: float, trainings: int) -> Verdict:
    """Judge the claim that a quantity is at most a bound: not that it is above; see `above`."""
    opposite = {
        Verdict.CONFIRMED: Verdict.NOT_CONFIRMED,
        Verdict.NOT_CONFIRMED: Verdict.CONFIRMED,
        Verdict.OPEN: Verdict.OPEN,
    }
    return opposite[above(interval, bound, trainings)]


def all_of(verdicts: Sequence[Verdict]) -> Verdict:
    """Judge a claim that holds only where all its parts do."""
    if Verdict.NOT_CONFIRMED in verdicts:
        return Verdict.NOT_CONFIRMED
    if not verdicts or Verdict.OPEN in verdicts:
        return Verdict.OPEN
    return Verdict.CONFIRMED


def above_by_round(
    curve: Curve, other: Curve, difference: Curve, first: int, trainings: int
) -> Verdict:
    """Judge the claim that one method is above another at every round.

    Rounds at which both reach every goal leave nothing to be above in, and are left out.

    Args:
        curve: Share reached by the method that is claimed to be better.
        other: By the other one.
        difference: The first minus the second, paired.
        first: Round from which on the claim is made.
        trainings: How many trainings the intervals resampled.
    """
    return all_of(
        [
            above(difference[i], 0.0, trainings)
            for i in range(first - 1, len(difference))
            if not curve[i].value == other[i].value == 1.0
        ]
    )
