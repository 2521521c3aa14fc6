"""What the page says in words: headline, the paper's count N, and one row a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from prior_reinforce import wording
from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.session.trials import Stage, Trial
from prior_reinforce.wording import (
    error_words,
    in_words,
    say_count,
    say_place,
    say_reading,
    to_words,
)

CALLED = "called "
"""Before the distance of a hit that was told to lie farther off than the tolerance."""
_MEANS = {
    "long": "long is beyond the goal, short before it",
    "left": "left and right are as seen from behind the robot",
    "high": "high is above the goal, low below it",
    "late": "late is after the goal's time, early before it",
    "too much": "too much is more than the goal, too little less",
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
    """How far off it was seen to be; a dash where nothing was told of that."""
    expected: str
    """How likely a hit was and the trials to go, as the adapter saw it: `possible, 1.9`; empty from
    one that expects nothing."""
    truly_off: str
    """How far off it truly was; empty where that is not known."""
    result: str


@dataclass(frozen=True)
class Headline:
    """The result at a glance."""

    text: str
    """For instance `5 of 5 goals reached`."""
    count: str
    """See `wording.say_cost`; empty while no goal is reached."""
    explanation: str
    complete: bool = True
    """Whether the count is of every goal that was tried."""


def headline(records: Sequence[AdaptationRecord]) -> Headline:
    """Say how many goals were reached, of those with a trial that counts, and at what cost.

    N counts demonstrations plus the mean of the Stage-2 trials until each goal was first reached
    (paper, Evaluation Protocol), over the goals that were reached.
    """
    several = len(records) > 1
    tried = [record for record in records if record.told]
    counts = [c for c in (record.trials_to_hit for record in tried) if c is not None]
    text = "Goal reached" if counts else "Goal not reached yet"
    if several and not tried:
        text = "No goal tried yet"
    elif several:
        text = f"{len(counts)} of {say_count(len(tried), 'goal')} reached"
    tolerances = dict.fromkeys(wording.say_tolerance(record.format) for record in records)
    within = f"A goal counts as reached within {' or '.join(tolerances)}."
    named = zip(titles(records), records, strict=True)
    untried = [title for title, record in named if not record.told]
    if several and untried:
        within += f" Left out, with no trial that counts: {', '.join(untried)}."
    if not counts:
        so_far = say_count(sum(len(record.told) for record in records), "trial")
        return Headline(text, "", f"{so_far} so far. {within}")
    demonstrated = {record.demonstrations.n for record in records}
    if len(demonstrated) > 1:
        return Headline(text, "", within)
    n, mean = demonstrated.pop(), float(np.mean(counts))
    least, most = say_count(min(counts), "trial"), max(counts)
    if not several:
        spent = f"{least} on the arm to reach the goal"
    elif len(counts) == 1:
        spent = f"{least} to reach one goal"
    elif min(counts) == most:
        spent = f"{least} to reach each goal"
    else:
        spent = f"{mean:.1f} trials on average to reach a goal, from {min(counts)} to {most}"
    missing = len(tried) - len(counts)
    left_out = ""
    if missing:
        goals = "goal that was" if missing == 1 else "goals that were"
        left_out = f" This leaves out the {missing} {goals} not reached."
    count = wording.say_cost(n, mean if several else most)
    explanation = f"{say_count(n, 'demonstration')}, then {spent}.{left_out} {within}"
    return Headline(text, count, explanation, complete=not missing)


def numbers(records: Sequence[AdaptationRecord]) -> list[int]:
    """The numbers that the goals go by."""
    return [record.number or place for place, record in enumerate(records, start=1)]


def titles(records: Sequence[AdaptationRecord]) -> list[str]:
    """What the goals are called."""
    named = zip(numbers(records), records, strict=True)
    return [record.title or f"Goal {number}" for number, record in named]


def outcome_line(record: AdaptationRecord) -> str:
    """Say in one line how it went for one goal."""
    count = record.trials_to_hit
    if count is not None:
        return f"reached in {say_count(count, 'trial')}"
    if record.told:
        return f"not reached in {say_count(len(record.told), 'trial')}"
    waiting = [trial for trial in record.trials if trial.open]
    if waiting:
        number = waiting[-1].number
        return f"trial {number} waits to be {'told' if number in record.lines else 'executed'}"
    return "no trial that counts" if record.trials else "not tried yet"


def trial_rows(record: AdaptationRecord) -> list[TrialRow]:
    """Say each trial of a goal in words."""
    return [_row(record, i, trial) for i, trial in enumerate(record.trials)]


def say_distance(record: AdaptationRecord, distance: float) -> str:
    """Say how far off a trial was: `1.2 cm`, `1.8 tolerances`."""
    rounded = round(distance, 1) if record.distance_unit == "cm" else float(f"{distance:.3g}")
    return f"{rounded:g} {record.distance_unit}"


def _row(record: AdaptationRecord, i: int, trial: Trial) -> TrialRow:
    form, expected = record.format, ""
    if trial.expected.p_hit is not None:
        expected = wording.say_chance(trial.expected.p_hit)
    if trial.expected.trials is not None:
        expected += f", {wording.say_trials(trial.expected.trials).removeprefix('about ')}"
    aim = say_place(trial.condition, form)
    if in_words(form):
        aim = to_words(trial.condition - record.goal, form).replace("on the goal", "at the goal")
    warning = record.warnings.get(trial.number)
    reading = trial.reading
    if reading is None:
        if trial.stage is Stage.VOIDED:
            seen = f"voided: {trial.note}" if trial.note else "voided"
            return TrialRow(trial.number, "voided", aim, seen, "–", expected, "", "not counted")
        seen = record.lines.get(trial.number, "not executed yet")
        return TrialRow(trial.number, "open", aim, seen, "–", expected, "", "open")
    seen, off, truly_off = say_reading(reading, form), "–", ""
    if (distance := record.distance_seen(trial)) is not None:
        called = CALLED if trial.hit and distance > record.edge else ""
        off = called + say_distance(record, distance)
    state = result = "hit" if trial.hit else "miss"
    truth = record.true_outcomes[i]
    if truth is not None:
        distance = record.distance(truth - record.goal)
        truly_off = say_distance(record, distance)
        if (distance <= record.edge) != trial.hit:  # the truth, once known, is admitted
            result = f"taken for a {result}"
    seen += f"; {warning}" if warning else ""
    return TrialRow(trial.number, state, aim, seen, off, expected, truly_off, result)


def explain_words(record: AdaptationRecord) -> str:
    """Say what the words of an error mean, of those that these outcomes have."""
    return "; ".join(_MEANS[pair[0]] for pair in error_words(record.format) if pair)
