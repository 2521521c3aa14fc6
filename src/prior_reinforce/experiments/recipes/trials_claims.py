"""What the paper says of its table of trials, held against ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from prior_reinforce.experiments.recipes.claims import Claim, Verdict, above, all_of, at_most
from prior_reinforce.experiments.recipes.success import interval_of
from prior_reinforce.experiments.recipes.trials_rows import sense_of
from prior_reinforce.experiments.sight import STAND_IN

_GOALS = ("unseen", "many")
"""The paper's goals lie far from the demonstrations; a mean has to hold there and everywhere."""
_HALF = 0.5
"""Ours: the paper says "often" without a number."""


def trials_claims(figures: Mapping[str, Any]) -> list[Claim]:
    """Each mean is at most the paper's; first throws miss; a VLM needs fewer trials than an eye.

    Args:
        figures: Of `trials.TrialsTable`.
    """
    means = [
        Claim(
            f"{row['title']}, {sense_of(row, figures)}: {row['trials']:.1f} trials on average "
            "(here: at most).",
            f"{interval_of(row['unseen']['trials'])} on {row['unseen']['goals']} unseen goals, "
            f"{interval_of(row['many']['trials'])} on {row['many']['goals']} uniform ones",
            all_of(
                [
                    at_most(interval_of(row[g]["trials"]), row["trials"], _trainings(row, figures))
                    for g in _GOALS
                ]
            ),
        )
        for row in figures["rows"]
        if row["adapter"] == "gp"
    ]
    first = [
        Claim(
            "The goal itself as the condition often leads to inaccurate outcomes (here: the first "
            f"trial, in more than half of the cases; {row['title']}, {sense_of(row, figures)}).",
            f"share reached at the first trial: {interval_of(row['first_throws'])}",
            at_most(interval_of(row["first_throws"]), _HALF, _trainings(row, figures)),
        )
        for row in figures["rows"]
        if row["adapter"] == "gp"
    ]
    fewer = {task: interval_of(value) for task, value in figures["eye_minus_model"].items()}
    if not fewer:
        return [*means, *first]
    n = min(_trainings(row, figures) for row in figures["rows"] if row["task"] in fewer)
    verdicts = [above(interval, 0.0, n) for interval in fewer.values()]
    # Of "in some tasks" one is enough.
    some = Verdict.CONFIRMED if Verdict.CONFIRMED in verdicts else Verdict.OPEN
    if all(verdict is Verdict.NOT_CONFIRMED for verdict in verdicts):
        some = Verdict.NOT_CONFIRMED
    said = "; ".join(f"{task} {interval:+.2f}" for task, interval in fewer.items())
    claim = "Seeing by a VLM slightly reduces the trials in some tasks."
    measured = f"eye minus {figures['model']}, same goals: {said}"
    return [*means, *first, Claim(claim, measured, some)]


def _trainings(row: Mapping[str, Any], figures: Mapping[str, Any]) -> int:
    """How many trainings speak for a row: none for a VLM's whose pictures the stand-in read."""
    return 0 if row["by_model"] and figures["model"] == STAND_IN else int(row["trainings"])
