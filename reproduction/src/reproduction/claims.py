"""The paper's claims as data, and the one rule by which rows decide them.

Each claim is made twice: of the paper's form (its network on whole plans, one noise term in the
adapter) and of ours (`diffusion`, a network alone, and our two-term Gaussian process), with a
control beside it. Where there are rows of twenty drawn sets, they decide, and not the example sets
A and B: of generators behind amplified noise, of adapters behind closed form and by eye, goals 2 to
8 of an afternoon, each goal alone. Verdicts: confirmed, where the 95 % interval lies beyond the
bound, and does so with the p-value that Holm's method asks for among all tests of that form;
confirmed alone, where only the interval does; level, where the whole interval of a difference is
within the margin; not confirmed, where the interval lies on the other side; fewer, where a range of
trials is undercut; open otherwise, and where there are too few sets for an interval.

Thresholds that are ours are not the paper's claims: `OBSERVATIONS` shows such quantities, without a
verdict. A mean below the paper's is an observation, too: its arm and goals are others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from reproduction.recipes import displacement, sets
from reproduction.recipes.adaptation import later
from reproduction.recipes.generators import FRESH, KNOWN, OURS
from reproduction.recipes.trials import CAMERA, ROWS, PaperRow
from reproduction.results import FIRST, TRIALS, Measure, Results, reached
from reproduction.statistics import Interval

_TAIL = 0.025
"""One-sided level: that of a 95 % interval."""
_QUARTER, _SHARE = 0.25, 0.05
"""Margins within which a difference counts as none (ours): a quarter of a trial, and one goal in
twenty."""
Where = Mapping[str, Any]
"""Rows by what their columns are equal to."""
Verdict = Literal[
    "confirmed", "confirmed alone", "level", "not confirmed", "fewer", "open", "not run"
]
Form = Literal["the paper's form", "ours", "baselines"]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, or a part of one, as a test."""

    says: str
    """What the paper says, in our words or quoted."""
    form: Form
    """Of which form it is tested."""
    a: Where
    """The rows whose mean is taken."""
    b: Where | None = None
    """The rows that it is compared with, paired; the quantity is a minus b."""
    measure: Measure = TRIALS
    """What is said of a row."""
    bounds: tuple[float, float] = (0.0, np.inf)
    """Where the claim has the quantity."""
    margin: float = 0.0
    """Differences below it are level; 0 where there is no such margin."""
    control: Where | None = None
    """What takes the place of the form's own rows for comparison: an untrained network."""
    prepare: Callable[[Results], Results] = lambda results: results
    """Makes rows that the measure is of."""
    behind: str = ""
    """What the rows are behind where that is not the form's own generator."""

    def sides(self, results: Results, a: Where | None = None) -> list[Results]:
        """The rows that the measure is of: a, or these in its place, and b where there is one."""
        sides = (a or self.a, self.b)
        return [self.prepare(results.where(**of)) for of in sides if of is not None]

    def quantity(self, results: Results, a: Where | None = None) -> Interval:
        """The quantity, of these rows or the claim's own."""
        of, *others = self.sides(results, a)
        return of.minus(others[0], self.measure) if others else of.mean(self.measure)

    def p_value(self, results: Results) -> float:
        """One-sided, of the bound that is nearest to being broken."""
        a, *others = self.sides(results)
        low, high = self.bounds
        p = a.p_above(low, self.measure, *others)
        return p if np.isinf(high) else max(p, 1 - a.p_above(high, self.measure, *others))


@dataclass(frozen=True)
class Judged:
    """A claim, and what came of it."""

    claim: Claim
    measured: Interval
    trained: str
    """How many sets, how often they were learned, and behind what where that is another."""
    p: float
    """One-sided, of this test alone."""
    p_of_all: float
    """The same by Holm's method among all tests of the form."""
    verdict: Verdict
    control: Interval | None
    """The same quantity of the control."""


def judge(results: Results, claims: Sequence[Claim] | None = None) -> list[Judged]:
    """Hold claims against rows."""
    claims = CLAIMS if claims is None else claims
    measured = [claim.quantity(results) for claim in claims]
    run = [not np.isnan(of.value) for of in measured]
    p = np.array(
        [c.p_value(results) if m.known else np.nan for c, m in zip(claims, measured, strict=True)]
    )
    of_all = np.full(len(claims), np.nan)
    for form in {claim.form for claim in claims}:
        tests = [i for i, c in enumerate(claims) if c.form == form and measured[i].known]
        of_all[tests] = holm(p[tests])
    judged = []
    for i, claim in enumerate(claims):
        sides = [results.where(**of) for of in (claim.a, claim.b or claim.a)]
        fewest = min(sides, key=lambda of: of.sets)
        verdict = decide(claim, measured[i], of_all[i]) if run[i] else "not run"
        control = claim.quantity(results, claim.control) if run[i] and claim.control else None
        trained = ", ".join(filter(None, (fewest.trained, claim.behind)))
        judged.append(Judged(claim, measured[i], trained, p[i], of_all[i], verdict, control))
    return judged


def decide(claim: Claim, measured: Interval, p_of_all: float) -> Verdict:
    """The rule; see the module."""
    low, high = claim.bounds
    if not measured.known:
        return "open"
    if -claim.margin < measured.low and measured.high < claim.margin:
        return "level"
    if measured.low > low and measured.high <= high:
        return "confirmed" if p_of_all < _TAIL else "confirmed alone"
    if measured.high <= low:
        return "not confirmed" if np.isinf(high) else "fewer"
    return "not confirmed" if measured.low > high else "open"


def holm(p: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """p-values of a family, each as large as Holm's step-down method makes it.

    Source: Holm, A simple sequentially rejective multiple test procedure, 1979.
    """
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * (len(p) - np.arange(len(p))))
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


_DRAWN = {m.label for m in (*sets.CLOSED, *sets.NETWORKS)}
"""Generators that were tried on drawn sets."""


def _compared(a: str, b: str) -> tuple[Where, Where]:
    """Rows that can be compared: of the drawn sets where all have them, else of A and B."""
    methods = (a, b)
    drawn = set(methods) <= _DRAWN
    recipe = ("sets", "sets-network") if drawn else "generators"
    return {"recipe": recipe, "method": a}, {"recipe": recipe, "method": b}


def _drawn(adapter: str) -> Where:
    return {"recipe": "sets", "condition": sets.BY_EYE, "method": adapter}


def _adapters(form: Form, method: str) -> Where:
    recipe = "papers-form" if form == "the paper's form" else "adapters"
    return {"recipe": recipe, "method": method, "perception": "amplified"}


_TWO_TERM = "GP of two terms, m = 2"
_FORMS: tuple[tuple[Form, str, str, str, str], ...] = (
    ("the paper's form", "GP, m = 2", "GP, no forgetting", FRESH,
     "papers-form"),
    ("ours", _TWO_TERM, "GP of two terms, no forgetting", "no adapter", "trials"),
)  # fmt: skip
"""Form; its adapter, with and without forgetting, and without; where its table of trials is."""
_BASELINES = [
    name for name, of in KNOWN.items() if of.kind == "baseline" and not name.endswith("aligned")
]
_EYE = [row for row in ROWS if not row.by_model]


def _of_form(form: Form, adapter: str, keeps: str, without: str, table: str) -> list[Claim]:
    """Every claim, of one form."""
    ours = _compared(OURS, OURS)[0] if form == "ours" else _adapters(form, adapter)
    gp, all_, proportional, frozen = (
        _adapters(form, name) for name in (adapter, keeps, "proportional, 0.8", without)
    )
    alone, rule = _drawn(f"{adapter}, each goal alone"), _drawn("proportional, 0.8")
    behind: Any = {"prepare": later, "behind": "behind closed form"}
    field = {"recipe": "displacement" if form == "ours" else "papers-form"}
    six = {**field, "method": "all demonstrations"}
    three = {**field, "method": "three demonstrations"}

    def less(says: str, a: Where, b: Where, **more: Any) -> Claim:
        return Claim(says, form, a, b, margin=_QUARTER, **more)

    def more(says: str, a: Where, b: Where, **more: Any) -> Claim:
        return Claim(says, form, a, b, reached(10), margin=_SHARE, **more)

    def below(says: str, name: str) -> Claim:
        """A baseline beside the form's own generator, paired."""
        if form == "ours":
            return less(says, *_compared(name, OURS))
        return less(says, {"recipe": "generators", "method": name}, _adapters(form, _TWO_TERM))

    def fields(says: str, name: str, a: Where, b: Where | None = None) -> Claim:
        measure = displacement.measure(name)
        return Claim(says, form, a, b, measure, prepare=displacement.summed)

    return [
        Claim("Over 90 % of the goals are reached within 4 rounds, demonstrations misaligned and "
              "noise amplified (Figure 7a).",
              form, ours, measure=reached(4), bounds=(0.9, np.inf),
              control=_compared("diffusion, untrained", OURS)[0] if form == "ours" else None),
        *(below(f"Misaligned: {name} stays below diffusion (trials, it minus diffusion).", name)
          for name in _BASELINES),
        *(below(f"Aligned, {name} still stays below diffusion on misaligned demonstrations "
                "(trials, it minus diffusion).", f"{name}, aligned") for name in _BASELINES),
        Claim("The Gaussian process reaches over 90 % of the goals within 4 rounds (Figure 7b).",
              form, alone, measure=reached(4), bounds=(0.9, np.inf), **behind),
        less("The proportional compensator converges more slowly (trials, it minus the Gaussian "
             "process).", rule, alone, **behind),
        more("The proportional compensator ends lower (share reached in 10 rounds, Gaussian "
             "process minus it).", alone, rule, **behind),
        more("Forgetting all but the latest two trials improves the upper end (share reached in "
             "10 rounds, minus the same without forgetting).", gp, all_),
        less("The proportional compensator outperforms no adapter (trials, none minus it).",
             frozen, proportional),
        fields("With six demonstrations errors grow towards the boundary (Figure 8; mean error "
               "outside the demonstrations' hull minus inside, cm).", "outside_minus_inside", six),
        fields("With three demonstrations high-error regions expand (share of the region off by "
               "over 5 cm, three minus six).", "high_error_area", three, six),
        fields("With three demonstrations the field becomes less structured (steepness, three "
               "minus six).", "steepness", three, six),
        *(Claim(f"{row.title} takes 2 to 4 trials.", form, {**alone, "task": row.task},
                bounds=(2.0, 4.0), **behind)
          if row.task == row.learned_on
          else Claim(f"{row.title} takes 2 to 4 trials.", form, _row(table, row, unseen=False),
                     bounds=(2.0, 4.0)) for row in _EYE),
    ]  # fmt: skip


def _row(recipe: str, row: PaperRow, **more: Any) -> Where:
    perception = ("vlm", CAMERA) if row.by_model else "eye"
    method = "gp-two-term" if recipe == "trials" else "GP, m = 2"
    return {
        "recipe": recipe, "task": row.task, "perception": perception, "method": method, **more,
    }  # fmt: skip


def in_papers_form(row: PaperRow) -> Where:
    """Rows of the paper's form on a task, by eye, on uniform goals."""
    return {**_row("papers-form", row), "unseen": False}


CLAIMS: tuple[Claim, ...] = (
    *(claim for form in _FORMS for claim in _of_form(*form)),
    *(
        Claim(f"Timeline alignment improves {name} (trials, as recorded minus aligned).",
              "baselines", *_compared(name, f"{name}, aligned"), margin=_QUARTER)
        for name in _BASELINES
    ),
    *(
        Claim(f"Seeing by a VLM reduces the trials ({row.title}; eye minus VLM, a model's rows).",
              "ours", _row("trials", eye), {**_row("trials", row), "perception": "vlm"},
              margin=_QUARTER)
        for row in ROWS
        for eye in _EYE
        if row.by_model and eye.task == row.task
    ),
)  # fmt: skip
"""Of the paper, each of both forms where it is about the method."""


@dataclass(frozen=True)
class Observation:
    """A quantity that stands beside the paper's, without a verdict."""

    says: str
    paper: str
    """The paper's number or word."""
    of: Callable[[Results], str]
    """What was measured; empty where nothing was."""


def _mean(where: Where, measure: Measure) -> Callable[[Results], str]:
    return lambda results: str(results.where(**where).mean(measure))


def _minus(a: Where, b: Where, measure: Measure = TRIALS) -> Callable[[Results], str]:
    """One minus the other, paired by training and number of the goal, whatever the task."""

    def minus(results: Results) -> str:
        of_a, of_b = (results.where(**of) for of in (a, b))
        if of_a.empty or of_b.empty:
            return ""
        both = (replace(of, frame=of.frame.assign(task="both")) for of in (of_a, of_b))
        return f"{next(both).minus(next(both), measure):+.2f}"

    return minus


def _deviation(results: Results) -> str:
    eye, read = (results.where(**_row("trials", row)) for row in ROWS[:2])
    if eye.empty or read.empty:
        return ""
    of_eye, of_read = (np.std(TRIALS.of(of.frame), ddof=1) for of in (eye, read))
    return f"{of_read:.2f} against {of_eye:.2f} by eye"


OBSERVATIONS: tuple[Observation, ...] = (
    *(
        Observation(
            f"{row.title}, {row.looks}: trials on {'unseen' if unseen else 'uniform'} goals; the "
            "paper's arm and goals are others.",
            f"{row.trials:.1f} ± {row.sd:.1f}",
            _mean(_row("trials", row, unseen=unseen), TRIALS),
        )
        for row in ROWS
        for unseen in (True, False)
    ),
    *(
        Observation(
            f"{row.title}, {row.looks}: first trials that hit.",
            '"often" inaccurate',
            _mean(_row("trials", row, unseen=False), FIRST),
        )
        for row in ROWS
    ),
    *(
        Observation(
            f"{row.title} minus V1, trials, eye: the degradation on other hardware.",
            f'"small": {row.trials - ROWS[0].trials:+.1f}',
            _minus(_row("trials", row, unseen=False), _row("trials", ROWS[0], unseen=False)),
        )
        for row in ROWS[-2:]
    ),
    Observation(
        "The proportional compensator minus no adapter, share reached in 10 rounds.",
        '"marginally" better',
        _minus(
            _adapters("ours", "proportional, 0.8"), _adapters("ours", "no adapter"), reached(10)
        ),
    ),
    Observation(
        "Deviation of the trials, Basketball Shot, pictures (a camera, no model) against the eye.",
        "1.1 against 0.9: higher",
        _deviation,
    ),
)
