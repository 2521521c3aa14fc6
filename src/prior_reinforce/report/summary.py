"""What the page says in words: headline, the paper's count N, and one row a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.trials import Stage, Trial
from prior_reinforce.wording import in_words, say_error, say_length, say_place, to_words

_OPEN = {
    Stage.ASKED: "not executed yet",
    Stage.EXECUTING: "executing",
    Stage.EXECUTED: "executed, not told yet",
}


@dataclass(frozen=True)
class TrialRow:
    """One trial, said in words."""

    number: int
    state: str
    """`hit`, `miss`, `voided` or `open`."""
    aim: str
    seen: str
    off: str
    """How far off it was seen to be; a dash where nothing was told."""
    truly_off: str
    """How far off it truly was; empty where that is not known."""
    result: str


@dataclass(frozen=True)
class Headline:
    """The result at a glance."""

    text: str
    """For instance `5 of 5 goals reached`."""
    count: str
    """For instance `N = 6 + 2.2 trials`; empty while no goal is reached."""
    explanation: str


def headline(records: Sequence[AdaptationRecord]) -> Headline:
    """Say how many goals were reached, and at what cost.

    N counts demonstrations plus the mean of the Stage-2 trials until each goal was first reached
    (paper, Evaluation Protocol), over the goals that were reached.
    """
    several = len(records) > 1
    counts = [c for c in (record.trials_to_hit for record in records) if c is not None]
    text = "Goal reached" if counts else "Goal not reached yet"
    if several:
        text = f"{len(counts)} of {len(records)} goals reached"
    tolerances = dict.fromkeys(say_tolerance(record) for record in records)
    within = f"A goal counts as reached within {' or '.join(tolerances)}."
    if not counts:
        tried = sum(len(record.told) for record in records)
        return Headline(text, "", f"{_trials(tried)} so far. {within}")
    demonstrated = {record.demonstrations.n for record in records}
    if len(demonstrated) > 1:
        return Headline(text, "", within)
    n, mean = demonstrated.pop(), float(np.mean(counts))
    count = f"N = {n} + {mean:.1f} trials" if several else f"N = {n} + {counts[0]} trials"
    if not several:
        spent = f"{_trials(counts[0])} on the arm to reach the goal"
    elif min(counts) == max(counts):
        spent = f"{_trials(counts[0])} to reach each goal"
    else:
        spent = f"{mean:.1f} trials on average to reach a goal, from {min(counts)} to {max(counts)}"
    missing = len(records) - len(counts)
    left_out = ""
    if missing:
        goals = "goal that was" if missing == 1 else "goals that were"
        left_out = f" This mean leaves out the {missing} {goals} not reached."
    return Headline(text, count, f"{n} demonstrations, then {spent}.{left_out} {within}")


def titles(records: Sequence[AdaptationRecord]) -> list[str]:
    """What the goals are called."""
    return [record.title or f"Goal {number}" for number, record in enumerate(records, start=1)]


def outcome_line(record: AdaptationRecord) -> str:
    """Say in one line how it went for one goal."""
    count = record.trials_to_hit
    if count is not None:
        return f"reached in {_trials(count)}"
    return f"not reached in {_trials(len(record.told))}" if record.told else "not tried yet"


def trial_rows(record: AdaptationRecord) -> list[TrialRow]:
    """Say each trial of a goal in words."""
    return [_row(record, i, trial) for i, trial in enumerate(record.trials)]


def say_goal(record: AdaptationRecord) -> str:
    """Say where the goal is."""
    demonstrations = record.demonstrations
    return say_place(record.goal, demonstrations.outcome_names, demonstrations.outcome_units)


def say_tolerance(record: AdaptationRecord) -> str:
    """Say how near counts as reached."""
    return say_length(record.tolerance, record.demonstrations.outcome_units)


def _row(record: AdaptationRecord, i: int, trial: Trial) -> TrialRow:
    names, units = record.demonstrations.outcome_names, record.demonstrations.outcome_units
    aim = say_place(trial.condition, names, units)
    if in_words(units):
        aim = to_words(trial.condition - record.goal).replace("on the goal", "at the goal")
    if trial.error_seen is None:
        if trial.stage is Stage.VOIDED:
            seen, state, result = "voided", "voided", "not counted"
            seen += f": {trial.note}" if trial.note else ""
        else:
            seen, state, result = _OPEN[trial.stage], "open", "open"
        return TrialRow(trial.number, state, aim, seen, "–", "", result)
    truth = record.true_outcomes[i]
    truly_off = None if truth is None else record.distance(truth - record.goal)
    result = "hit" if trial.hit else "miss"
    # The truth, once known, is admitted where it disagrees.
    disagrees = truly_off is not None and (truly_off <= record.tolerance) != trial.hit
    return TrialRow(
        trial.number,
        state=result,
        aim=aim,
        seen=say_error(trial.error_seen, names, units),
        off=say_length(record.distance(trial.error_seen), units),
        truly_off="" if truly_off is None else say_length(truly_off, units),
        result=f"taken for a {result}" if disagrees else result,
    )


def _trials(n: int) -> str:
    return "1 trial" if n == 1 else f"{n} trials"
