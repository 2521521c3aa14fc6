"""Choose the timing in which the motion best predicts the outcome, by leave-one-out errors.

A weighted mean of plans has the weighted mean of their outcomes only if the outcome is an affine
function of the motion. So each demonstration is left out, and its outcome predicted from the others
by an affine function of the state at one phase: the decisive one, such as a release, which is
unknown and chosen as the best predicting. A release by the clock is predicted best from plans as
recorded; one that the motion itself causes, from plans that start together.

By default starts are learned separately; other timings have to predict clearly better, since six
demonstrations are little evidence.

Notation:
    x_i  state at one phase: positions, and velocities times a time   (2 C,)  [-]
    r_i  outcomes, each component scaled to unit variance             (k,)    [-]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators.timing.registration import WarpKind, even_subset
from prior_reinforce.generators.timing.timeline import Decomposition, decompose
from prior_reinforce.plans.motions import Demonstrations

_MAX_RELATIVE_ERROR: dict[WarpKind, float] = {"none": 0.9, "start": 1.0, "tempo": 0.5}
"""A timing is chosen instead of `start` if its error is below this part of the error of `start`.
Ours, chosen on the zoo's development tasks (reproduction/docs/decisions-generator.md)."""
_CLOCK_SPREAD = 0.08
"""Largest standard deviation of starts, as a part of the motion's length, of people who keep to a
clock; above it, `none` is excluded. Ours: 0.01 to 0.07 on zoo-lob, which a clock releases; 0.17 to
0.29 on our own tasks, whose people start as they like."""
_CLOCK_ERROR = 0.35
"""A clock is considered only if the error of `start` is larger. Ours: of the zoo's development sets
that seemed clocked, it is less in 12 of 19 that are not, in 1 of 15 that are."""
_MAX_USEFUL_ERROR = 0.7
"""Above this error the model is no better than predicting the mean outcome, whose error is 1. Ours:
half and double change plans of 5 and 1 of 113 sets, and first throws by 0.005 at most."""
_FEWEST = 5
"""With fewer demonstrations than this, or than k + 3, none can be left out. Ours: of three sets of
4 with one outcome, one would have its tempos learned, by chance."""
_FLIGHT = 0.1
"""Velocities are multiplied by this time, in [s]. Ours: a thrown object flies for a few times as
long."""
_INSTANT = 0.04
"""A state is a mean over this time before and after, in [s]. Ours: about the time in which an
object leaves a hand."""
_BEST = 3
"""The best so many phases are averaged, to reduce selection bias. Ours: with 2 and 6, plans of 2
and 3 of 113 sets differ, and first throws by 0.01."""
_RIDGE = 1e-3
"""Ridge of the affine function, relative to the states' mean square. Ours: below the differences of
motions, above rounding; half and double change plans of 1 and 3 of 113 sets."""
_EQUALLY_GOOD = 0.1
"""Errors that differ by less than this part of the outcomes' spread are reported as equal; it
decides a remark only. Ours: six demonstrations do not determine them better."""
TOO_FEW_FRAMES = "timing: as recorded, since {} frames are too few to be moved without a loss"
"""A remark."""
_WORDS: dict[WarpKind, str] = {
    "none": "plans start when the demonstrations did",
    "start": "when to start is learned separately from the motion",
    "tempo": "when to start and how fast to go are learned separately from the motion",
}


@dataclass(frozen=True, eq=False)
class TimingChoice:
    """The chosen timing, and the reason."""

    decomposition: Decomposition
    reason: str
    """In one sentence, for people."""
    errors: Mapping[WarpKind, float] = field(default_factory=dict)
    """`outcome_error` of each compared timing; empty if none could be compared."""


def choose_timing(demonstrations: Demonstrations) -> TimingChoice:
    """Choose the timing in which the motion best predicts left-out outcomes.

    With few demonstrations, starts are learned separately.
    """
    n = demonstrations.n
    try:
        usual = decompose(demonstrations, "start")
    except InvalidDemonstrationsError as error:
        return TimingChoice(decompose(demonstrations, "none"), f"timing as recorded: {error}")
    if usual.timeline.kind == "none":
        return TimingChoice(usual, TOO_FEW_FRAMES.format(demonstrations.horizon))
    if n < max(_FEWEST, demonstrations.outcome_dim + 3):
        return TimingChoice(
            usual,
            f"timing: {_WORDS[usual.timeline.kind]}, as a rule; {n} demonstrations cannot tell "
            "what is better",
        )
    numbers = tuple(even_subset(n).tolist())
    # All are passed as no subset, as elsewhere, so that `decompose` caches them once.
    subset = (numbers,) if len(numbers) < n else ()
    compared = demonstrations.only(numbers) if subset else demonstrations
    decompositions: dict[WarpKind, Decomposition] = {
        kind: decompose(demonstrations, kind, *subset) for kind in _MAX_RELATIVE_ERROR
    }
    errors = {kind: outcome_error(compared, each) for kind, each in decompositions.items()}
    candidates = [kind for kind in errors if kind == "start" or errors[kind] < _MAX_USEFUL_ERROR]
    usual = decompositions["start"]
    length = float(np.median(np.ptp(compared.signals.spans, axis=1)))
    no_clock = float(np.std(usual.numbers[:, 0])) > _CLOCK_SPREAD * length
    # A hand that opens within the plan needs no clock.
    if no_clock or errors["start"] <= _CLOCK_ERROR or usual.by_step:
        candidates = [kind for kind in candidates if kind != "none"]
    best = min(candidates, key=lambda kind: errors[kind] / _MAX_RELATIVE_ERROR[kind])
    if errors[best] >= _MAX_USEFUL_ERROR:
        why = ", as a rule; these demonstrations do not tell what is better"
    elif min(e for kind, e in errors.items() if kind != best) - errors[best] < _EQUALLY_GOOD:
        better = min(errors.values()) < errors[best] - _EQUALLY_GOOD
        why = ", as a rule" if better else "; other timings would do equally well here"
    else:
        why = ", as these demonstrations ask for"
    chosen = decompose(demonstrations, best) if subset else decompositions[best]
    return TimingChoice(chosen, f"timing: {_WORDS[chosen.timeline.kind]} ({best}){why}", errors)


def outcome_error(demonstrations: Demonstrations, decomposition: Decomposition) -> float:
    """Return the leave-one-out error of predicted outcomes, relative to their spread.

    The root mean square at the decisive phase; predicting the mean of the others would give 1.
    """
    states = _states(demonstrations, decomposition)
    outcomes = demonstrations.outcomes_seen / demonstrations.outcomes_seen.std(axis=0)
    n = demonstrations.n
    factor = n / (n - 1)  # distance to the mean of the others, relative to the mean of all
    x, r = states - states.mean(axis=1, keepdims=True), outcomes - outcomes.mean(axis=0)
    # Ridge regression has closed-form leave-one-out errors, even with a ridge for each.
    u, singular, _ = np.linalg.svd(x, full_matrices=False)
    squares = np.sum(x**2, axis=2)
    ridge = _RIDGE * (squares.sum(axis=1, keepdims=True) - factor * squares) / (n - 1) + 1e-12
    fitted = u * (singular**2)[:, None] / ((singular**2)[:, None] + ridge[:, :, None])
    leverage = np.sum(fitted * u, axis=2, keepdims=True)
    residuals = factor * (fitted @ (np.swapaxes(u, 1, 2) @ r) - r) / (1.0 - factor * leverage)
    errors = np.sqrt(np.mean(residuals**2, axis=(1, 2)))
    return float(np.mean(np.sort(errors)[:_BEST]))


def _states(
    demonstrations: Demonstrations, decomposition: Decomposition
) -> Float[np.ndarray, "T N F"]:
    """Return the arm's state at each phase: positions and velocities, scaled by unit."""
    from scipy.ndimage import uniform_filter1d

    plan_format = demonstrations.format
    shapes = decomposition.shapes[:, :: decomposition.timeline.per_frame]
    units = np.array(decomposition.units)
    variances = shapes.var(axis=1).mean(axis=0)
    for unit in set(units.tolist()):
        pooled = float(np.sqrt(variances[units == unit].sum()))
        shapes = np.where(units == unit, shapes / (pooled or 1.0), shapes)
    velocities = np.gradient(shapes, plan_format.dt, axis=1) * _FLIGHT
    states = np.concatenate([shapes, velocities], axis=2)
    size = 2 * max(1, round(_INSTANT / plan_format.dt)) + 1
    return uniform_filter1d(states, size, axis=1, mode="nearest").transpose(1, 0, 2)
