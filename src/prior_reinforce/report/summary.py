"""What the page says in words: headline, the paper's count N, and one row a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.wording import say_aim, say_error, say_length, say_place
from prior_reinforce.trials import Stage, Trial


@dataclass(frozen=True)
class TrialRow:
    """One trial, said in words."""

    number: int
    state: str
    """`hit`, `miss`, `voided` or `pending`."""
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


def title_of(record: AdaptationRecord, number: int) -> str:
    """Return the goal's title."""
    return record.title or f"Goal {number}"


def headline(records: Sequence[AdaptationRecord]) -> Headline:
    """Say how many goals were reached, and at what cost.

    N counts demonstrations plus the mean of the Stage-2 trials until each goal was first reached
    (paper, Evaluation Protocol), over the goals that were reached.
    """
    counts = [c for c in (record.trials_to_hit for record in records) if c is not None]
    demonstrated = {record.demonstrations.n for record in records}
    tolerances = list(dict.fromkeys(say_length(r, r.tolerance) for r in records))
    if len(records) == 1:
        text = "Goal reached" if counts else "Goal not reached yet"
    else:
        text = f"{len(counts)} of {len(records)} goals reached"
    within = f"A goal counts as reached within {' or '.join(tolerances)}."
    if not counts:
        tried = sum(record.n_told for record in records)
        return Headline(text, "", f"{_trials(tried)} so far. {within}")
    if len(demonstrated) > 1:
        return Headline(text, "", within)
    n = demonstrated.pop()
    mean = float(np.mean(counts))
    count = f"N = {n} + {mean:.1f} trials" if len(records) > 1 else f"N = {n} + {counts[0]} trials"
    if len(records) == 1:
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


def outcome_line(record: AdaptationRecord) -> str:
    """Say in one line how it went for one goal."""
    count = record.trials_to_hit
    if count is not None:
        return f"reached in {_trials(count)}"
    return f"not reached in {_trials(record.n_told)}" if record.n_told else "not tried yet"


def trial_rows(record: AdaptationRecord) -> list[TrialRow]:
    """Say each trial of a goal in words."""
    return [_row(record, i, trial) for i, trial in enumerate(record.trials)]


def knows_truth(record: AdaptationRecord) -> bool:
    """Whether any true outcome is known."""
    return any(outcome is not None for outcome in record.true_outcomes)


def describe(record: AdaptationRecord) -> str:
    """Say the goal and all trials in a sentence, for readers who do not see the pictures."""
    parts = [f"Goal at {say_place(record, record.goal)}."]
    parts += [f"Trial {row.number}: {row.seen}." for row in trial_rows(record)]
    return " ".join(parts)


def _row(record: AdaptationRecord, i: int, trial: Trial) -> TrialRow:
    aim = say_aim(record, trial.condition)
    if trial.error_seen is None:
        voided = trial.stage is Stage.VOIDED
        note = f"voided: {trial.note}" if trial.note else "voided"
        seen, result = (note, "not counted") if voided else ("not executed yet", "pending")
        return TrialRow(trial.number, trial.stage.value, aim, seen, "–", "", result)
    off = float(np.linalg.norm(trial.error_seen))
    truth = record.true_outcomes[i]
    truly_off = None if truth is None else float(np.linalg.norm(truth - record.goal))
    return TrialRow(
        number=trial.number,
        state="hit" if trial.hit else "miss",
        aim=aim,
        seen=say_error(record, trial.error_seen),
        off=say_length(record, off),
        truly_off="" if truly_off is None else say_length(record, truly_off),
        result=_result(record, trial.hit, truly_off),
    )


def _result(record: AdaptationRecord, hit: bool, truly_off: float | None) -> str:
    """Say hit or miss, and admit where the truth, once known, disagrees."""
    if truly_off is None or (truly_off <= record.tolerance) == hit:
        return "hit" if hit else "miss"
    return "taken for a hit" if hit else "taken for a miss"


def _trials(n: int) -> str:
    return "1 trial" if n == 1 else f"{n} trials"
