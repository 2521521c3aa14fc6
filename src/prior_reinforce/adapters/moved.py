r"""What is believed of where plans that a symmetry moves come down, and of what changed since.

In the chart of the symmetry (`plans.symmetry`) a plan that is moved from z_base by w comes down at

    z = z_base + G w + b + sum_i v_i b_i + f(w) + F(z_base) - sum_i v_i F(z_i),    r = back(z) + s

with independent Gaussian terms:

    G    of mean and sd as the symmetry states: the identity where it is exact
    b    what is off by the same everywhere, as on another day; b_i what is off of demonstration i,
         which counts v_i: its label, and an execution's noise
    f    what no power law says, the farther the more; the same for all that an exact part moves
    F    what lies between demonstrations that are mixed
    s    a shift of everything since some trial, which nobody announced, or somebody did

Each kind of model (`moved_prior`) is combined with changes since some trial: together a hypothesis,
which the evidence of readings weighs.

A reading says in which interval the outcome lies, in the outcomes' units. It is linearised where it
says that the object came down: linearised at what was believed, a wrong sign would feed on itself.
So readings are intervals on latents that are Gaussian beforehand, and expectation propagation takes
them in as it does everywhere (`expectation_propagation`).

Source: ours; sizes in reproduction/docs/decisions-adapter.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass, replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.base import State
from prior_reinforce.adapters.change_points import Change, announced, changes_of
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.memory import Memory, Places
from prior_reinforce.adapters.moved_prior import Model, MovedPrior
from prior_reinforce.adapters.p_hit import Targets, standard_normal, weighed_hits
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations

_LEAST_GAIN = 0.3
"""What G is taken to be at least along what is not exact (ours)."""
_SHIFT = 0.2
"""Sd of a shift, in outcomes per unit of the chart: of the distance to the axis (ours)."""
_ANOTHER_DAY = 3.0
"""Offsets after hardware was changed, in those of another day (ours)."""
UNIT = 0.15
"""What counts as 1 in readings, in outcomes per unit of the chart (ours)."""
EXECUTION = 0.03
"""Sd of an execution in those, where no tolerance is known (ours)."""
OF_TOLERANCE = 1 / 3
"""Sd of an execution in tolerances (ours)."""
_EXACTLY = 1e-6
"""Variance of the reading that G is so great (ours)."""
_OUTLIER = 1e-4
"""Probability that one component of a reading says nothing (ours): where it is greater, the first
throw after a shift is taken for a slip of the tongue, and thrown again."""
_LEAST_ODDS, _LEAST_EVER, _MOST = 1e-3, 1e-7, 12
"""Hypotheses are kept whose odds against the best are so great, or only so great where nothing
changed but lately, and so many at most (ours)."""
_STEPS, _LONGEST, _ARRIVED, _DAMPING = 12, 0.5, 1e-5, 1e-3
"""Newton's method for the aim: steps, the longest in each component and the last one, in units of
the chart, and Levenberg's damping (ours)."""
_NUDGE = 1e-3
"""By how much an aim is changed for a difference quotient, in the chart (ours)."""
_DRAWS = 1024
"""For the probability of a hit, under each hypothesis (ours)."""
_IMPROBABLE = 0.01
"""Hypotheses of less are left out of the probability of a hit (ours)."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A model, what changed since when, and where readings were linearised under it."""

    model: int
    changes: tuple[Change, ...]
    """With a shift of everything where their `shift_sd` is positive, else in the chart."""
    log_prior: float
    at: Points
    """z, (n, k)."""
    jacobian: Float[np.ndarray, "n k k"]
    """dr/dz there, r in what counts as 1 in readings (`UNIT`)."""

    def changed(self, a: Places, b: Places, *, shifted: bool) -> Float[np.ndarray, "p n"]:
        """How many changes, shifts or others, come before both of two places."""
        both = np.zeros((len(a.numbers), len(b.numbers)))
        for change in self.changes:
            if bool(change.shift_sd) is shifted:
                both += np.outer(change.concerns(a), change.concerns(b))
        return both


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Where p plans come down under a hypothesis, Gaussian about their means."""

    places: Places
    z: Float[np.ndarray, "p k"]
    mean: Float[np.ndarray, "p k"]
    """r, in the outcomes' units."""
    jacobian: Float[np.ndarray, "p k k"]
    cross: Float[np.ndarray, "p k q"]
    """Covariance of r with all latents that were read."""

    def only(self, which: slice) -> Outcomes:
        """Some of them."""
        places, *others = vars(self).values()
        return Outcomes(places.only(which), *(of[which] for of in others))


class MovedBelief:
    """Hypotheses of moved plans, the most probable first, and what trials told of them."""

    def __init__(self, demonstrations: Demonstrations, p_change: float) -> None:
        """Begin with what the demonstrations say."""
        self.prior = MovedPrior(demonstrations)
        self.symmetry, self.k = self.prior.symmetry, self.prior.symmetry.k
        self._unit, self._p_change = UNIT * self.prior.size, p_change
        self.memory = Memory.empty(self.k)
        none = np.empty((0, self.k)), np.empty((0, self.k, self.k))
        self.hypotheses = [
            Hypothesis(i, (), math.log(model.probability), *none)
            for i, model in enumerate(self.prior.models)
        ]
        self._begun: tuple[int, ...] = ()  # numbers of the trials that began the last two goals
        self._posterior = self._inferred(None)
        self._prune(0)

    def state(self) -> State:
        """All that trials told, as data."""
        hypotheses = self.hypotheses
        return State(
            {
                "hypotheses": [
                    [h.model, list(map(astuple, h.changes)), h.log_prior] for h in hypotheses
                ],
                "begun": list(self._begun),
            },
            {
                **vars(self.memory),
                **vars(self._posterior),
                "at": np.stack([h.at for h in hypotheses]),
                "jacobian": np.stack([h.jacobian for h in hypotheses]),
            },
        )

    def resume(self, state: State) -> None:
        """Go on from what `state` gave."""
        self._begun = tuple(state.facts["begun"])
        self.memory, self._posterior = state.made(Memory), state.made(Posterior)
        linearised = zip(state.arrays["at"], state.arrays["jacobian"], strict=True)
        self.hypotheses = [
            Hypothesis(model, changes_of(changes), log_prior, at, jacobian)
            for (model, changes, log_prior), (at, jacobian) in zip(
                state.facts["hypotheses"], linearised, strict=True
            )
        ]

    @property
    def probabilities(self) -> Float[np.ndarray, " h"]:
        """Of each hypothesis."""
        return np.asarray(self._posterior.model_weights[:, 0])

    def model(self, h: int) -> Model:
        """Of a hypothesis."""
        return self.prior.models[self.hypotheses[h].model]

    def change(self, number: int) -> None:
        """Something was changed before that trial or, with a small probability, nothing."""
        self._branch(
            (h, changes, log_p)
            for changes, log_p in announced(number, 1.0)
            for h in range(len(self.hypotheses))
        )

    def observe(self, new: Memory) -> None:
        """Take in one more trial.

        Args:
            new: That trial alone. Its condition is the aim, in the chart; `low`, `high`,
                `variance` and `missed_by` are of outcome minus goal, in the outcomes' units.
        """
        number, leads = int(new.numbers[0]), self.hypotheses[0].model
        if len(self.memory.numbers) and not np.array_equal(self.memory.goals[-1:], new.goals):
            self._begun = (*self._begun, number)[-2:]
        changed = [
            (h, (Change(number, 1.0),), math.log(self._p_change))
            for h, hypothesis in enumerate(self.hypotheses)
            if number
            and hypothesis.model in (0, leads)
            and len(hypothesis.changes) < 3
            and not any(change.since >= number - 2 for change in hypothesis.changes)
        ]
        same = [(h, (), 0.0) for h in range(len(self.hypotheses))]
        self._branch([*same, *changed])
        self.hypotheses = [self._linearised(h, new) for h in range(len(self.hypotheses))]
        self.memory = self.memory.followed_by(new)
        keep, known = self.memory.worth_keeping(), self._posterior
        if not np.all(keep):
            self.memory = self.memory.only(keep)
            self.hypotheses = [
                replace(h, at=h.at[keep], jacobian=h.jacobian[keep]) for h in self.hypotheses
            ]
        self._posterior = self._inferred(known if np.all(keep) else None)
        self._prune(number)

    def _branch(self, into: Iterable[tuple[int, tuple[Change, ...], float]]) -> None:
        """Let hypotheses go on in several ways: which, what changes, and its log probability."""
        which, changes, logs = zip(*into, strict=True)
        self.hypotheses = [
            replace(
                self.hypotheses[h],
                changes=(*self.hypotheses[h].changes, *more),
                log_prior=self.hypotheses[h].log_prior + log,
            )
            for h, more, log in zip(which, changes, logs, strict=True)
        ]
        known = self._posterior.under(list(which))
        self._posterior = replace(known, log_evidence=known.log_evidence + np.array(logs)[:, None])

    def _linearised(self, h: int, new: Memory) -> Hypothesis:
        """The hypothesis with the place where the reading says that the object came down."""
        hypothesis, chart = self.hypotheses[h], self.symmetry.chart
        expected = self.outcomes(h, new)
        low, high = (
            np.where(np.isinf(end), other, end)
            for end, other in ((new.low, new.high), (new.high, new.low))
        )
        believed = chart.back(expected.z)
        with np.errstate(invalid="ignore"):  # nothing was read
            seen = new.goals + 0.5 * (low + high) - (expected.mean - believed)
        if any(c.shift_sd and c.since == new.numbers[0] for c in hypothesis.changes):
            seen = believed
        at = chart.to(np.where(np.isfinite(seen), seen, believed))
        return replace(
            hypothesis,
            at=np.vstack([hypothesis.at, at]),
            jacobian=np.concatenate(
                [hypothesis.jacobian, chart.jacobian(at) / self._unit[:, None]]
            ),
        )

    def _inferred(self, known: Posterior | None) -> Posterior:
        """The posterior under all hypotheses, as one batch of models."""
        prior, memory, chart = self.prior, self.memory, self.symmetry.chart
        unit, left, n = self._unit, prior.left, len(memory.numbers)
        w, s, many = prior.moved(memory.conditions), len(left), len(self.hypotheses)
        models = {h.model: prior.models[h.model] for h in self.hypotheses}
        means = {m: prior.mean(model, memory.conditions) for m, model in models.items()}
        among = {
            m: prior.covariance(model, *2 * (memory.conditions,)) for m, model in models.items()
        }
        size = s + n * self.k
        covariance, (low, high) = np.zeros((many, size, size)), np.empty((2, many, 1, size))
        for i, hypothesis in enumerate(self.hypotheses):
            model, m = models[hypothesis.model], hypothesis.model
            jacobian, signs = hypothesis.jacobian, model.signs[left]
            mean, gain = np.diag(model.mean)[left], np.diag(model.sd)[left]
            low[i, 0, :s] = np.where(signs > 0, _LEAST_GAIN - mean, -np.inf)
            high[i, 0, :s] = np.where(signs > 0, np.inf, -_LEAST_GAIN - mean)
            to = np.einsum("ncj,nj->nc", jacobian, hypothesis.at - means[m])
            to += (memory.goals - chart.back(hypothesis.at)) / unit
            low[i, 0, s:], high[i, 0, s:] = (
                (end / unit + to).ravel() for end in (memory.low, memory.high)
            )
            covariance[i, :s, :s] = np.diag(gain**2)
            onto = np.einsum("ncj,nj->jnc", jacobian[..., left], w[:, left] * gain**2)
            covariance[i, :s, s:] = onto.reshape(s, n * self.k)
            covariance[i, s:, :s] = covariance[i, :s, s:].T
            of_z = among[m] + self._on_another_day(hypothesis, memory, memory)
            told = np.einsum("ncj,jnm,mdj->ncmd", jacobian, of_z, jacobian)
            told += self._shifts(hypothesis, memory, memory) / (unit[:, None, None] * unit)
            covariance[i, s:, s:] = told.reshape(n * self.k, n * self.k)
        variance = np.concatenate([np.full(s, _EXACTLY), (memory.variance / unit**2).ravel()])
        variance = np.broadcast_to(variance, low.shape)
        readings = Readings(low, high, variance, _OUTLIER)
        log_prior = np.array([h.log_prior for h in self.hypotheses])
        return infer(covariance, readings, log_prior, known and known.under_others())

    def _on_another_day(
        self, hypothesis: Hypothesis, a: Places, b: Places
    ) -> Float[np.ndarray, "k p n"]:
        """Covariance that changed hardware adds, in the chart."""
        variance = np.square(_ANOTHER_DAY * self.symmetry.offset_sd)
        return np.asarray(variance[:, None, None] * hypothesis.changed(a, b, shifted=False))

    def _shifts(self, hypothesis: Hypothesis, a: Places, b: Places) -> Float[np.ndarray, "p k n k"]:
        """Covariance of what shifts add to outcomes."""
        variance, both = np.square(_SHIFT * self.prior.size), hypothesis.changed(a, b, shifted=True)
        return np.asarray(both[:, None, :, None] * np.diag(variance)[None, :, None])

    def outcomes(self, h: int, places: Places) -> Outcomes:
        """Where plans for aims, the conditions of places, come down under a hypothesis."""
        prior, memory, hypothesis = self.prior, self.memory, self.hypotheses[h]
        model, left, aims, p = self.model(h), prior.left, places.conditions, len(places.numbers)
        of_z = prior.covariance(model, aims, memory.conditions)
        of_z = of_z + self._on_another_day(hypothesis, places, memory)
        read = (p, self.k, len(memory.numbers) * self.k)
        no_gain = np.zeros((p, self.k, len(left)))
        shifts = (self._shifts(hypothesis, places, memory) / self._unit).reshape(read)
        shifts = np.concatenate([no_gain, shifts], axis=2)
        to_z = np.einsum("jpn,ncj->pjnc", of_z, hypothesis.jacobian).reshape(read)
        gain = no_gain.copy()
        of_gain = prior.moved(aims)[:, left] * np.diag(model.sd)[left] ** 2
        gain[:, left, np.arange(len(left))] = of_gain
        to_z = np.concatenate([gain, to_z], axis=2)
        weights = self._posterior.weights[h, 0]
        z = prior.mean(model, aims) + to_z @ weights
        at = self.symmetry.chart.jacobian(z)
        mean = self.symmetry.chart.back(z) + shifts @ weights
        return Outcomes(places, z, mean, at, at @ to_z + shifts)

    def covariance(self, h: int, a: Outcomes, b: Outcomes) -> Float[np.ndarray, "p k n k"]:
        """Between outcomes, given all that was told, without execution."""
        hypothesis, at, other = self.hypotheses[h], a.places, b.places
        of_z = self.prior.covariance(self.model(h), at.conditions, other.conditions)
        of_z = of_z + self._on_another_day(hypothesis, at, other)
        of_r = np.einsum("pcj,jpn,ndj->pcnd", a.jacobian, of_z, b.jacobian)
        of_r += self._shifts(hypothesis, at, other)
        precision = self._posterior.precision[h, 0]
        return np.asarray(of_r - np.einsum("pcq,qr,ndr->pcnd", a.cross, precision, b.cross))

    def spread(self, h: int, at: Outcomes) -> Float[np.ndarray, "p k k"]:
        """Covariance of each outcome, likewise."""
        single = [at.only(slice(i, i + 1)) for i in range(len(at.mean))]
        each = [self.covariance(h, one, one)[0, :, 0] for one in single]
        return np.array(each).reshape(len(at.mean), self.k, self.k)

    def aim(self, goal: Point, number: int, farthest: Point) -> Point:
        """Return the aim that is expected to reach a goal, under the most probable hypothesis.

        Newton's method, by difference quotients; where it does not arrive, the nearest it came.

        Args:
            goal: In the outcomes' units.
            number: Of the trial.
            farthest: How far plans are moved at most, in each component of the chart.
        """
        chart, k, best = self.symmetry.chart, self.k, np.inf
        z = nearest = chart.to(goal)
        nudges = _NUDGE * np.concatenate([np.zeros((1, k)), np.eye(k), -np.eye(k)])
        for _ in range(_STEPS):
            numbers, goals = np.full(len(nudges), number), np.tile(goal, (len(nudges), 1))
            at = self.outcomes(0, Places(z + nudges, numbers, goals))
            into = np.linalg.inv(at.jacobian[0])
            off = into @ (at.mean[0] - goal)
            if np.abs(off).max() < best:
                best, nearest = np.abs(off).max(), z
            slope = into @ (at.mean[1 : k + 1] - at.mean[k + 1 :]).T / (2.0 * _NUDGE)
            step = slope.T @ np.linalg.solve(slope @ slope.T + _DAMPING * np.eye(k), off)
            new = z - np.clip(step, -_LONGEST, _LONGEST)
            base = self.prior.base(new[None])[0][0]
            new = base + np.clip(new - base, -farthest, farthest)
            moved, z = np.abs(new - z).max(), new
            if moved < _ARRIVED:
                return np.asarray(z)
        return np.asarray(nearest)

    def _prune(self, number: int) -> None:
        """Keep what is probable, and what may yet become so."""
        odds = self._posterior.log_evidence[:, 0]
        recent = {number, number - 1, *self._begun}
        order = np.argsort(-odds, kind="stable")
        kept = [
            int(h)
            for h in order
            if odds[h] > odds[order[0]] + math.log(_LEAST_ODDS)
            or (
                odds[h] > odds[order[0]] + math.log(_LEAST_EVER)
                and recent.issuperset(change.since for change in self.hypotheses[h].changes[-1:])
            )
        ][:_MOST]
        self.hypotheses = [self.hypotheses[h] for h in kept]
        self._posterior = self._posterior.under(kept)

    def p_hit(
        self, at: Places, radius: Point, missed: Memory, seed: int = 0
    ) -> Float[np.ndarray, " p"]:
        """Return the probability that the outcome at each aim is within the radius of its goal.

        Args:
            at: Aims, the numbers of their trials, and goals.
            radius: Half-axes, (k,), in the outcomes' units.
            missed: Trials that missed; `p_hit.share_within` of what was drawn of them weighs draws.
            seed: Of the draws.
        """
        hits, total, n = np.zeros(len(at.numbers)), 0.0, len(missed.numbers)
        noise = np.square(OF_TOLERANCE * radius)
        probabilities = self.probabilities
        for h in map(int, np.flatnonzero(probabilities > _IMPROBABLE)):
            here, then = self.outcomes(h, at), self.outcomes(h, missed)
            among = self.covariance(h, then, then).reshape(n * self.k, n * self.k)
            values, vectors = np.linalg.eigh(among + np.diag(np.tile(noise, n)))
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            onto = self.covariance(h, here, then).reshape(len(at.goals), self.k, n * self.k)
            onto = onto @ (vectors / np.sqrt(np.maximum(values, _EXACTLY * noise.min())))
            left = self.spread(h, here) + np.diag(noise) - onto @ np.swapaxes(onto, 1, 2)
            normal = standard_normal((_DRAWS, (n + 1) * self.k), seed)
            drawn = (then.mean - missed.goals).ravel() + normal[:, : n * self.k] @ root.T
            drawn = np.moveaxis(drawn.reshape(_DRAWS, n, self.k), 2, 0)
            values, vectors = np.linalg.eigh(left)
            own = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
            outcome = np.einsum("qi,pci->cqp", normal[:, : n * self.k], onto)
            outcome = outcome + np.einsum("qi,pci->cqp", normal[:, n * self.k :], own)
            outcome = outcome + (here.mean - at.goals).T[:, None]
            size = np.broadcast_to(radius, at.goals.shape)
            lost, wanted = _around(missed.missed_by), _around(size)
            hit, weight = weighed_hits(drawn, lost, outcome, wanted, _OUTLIER)
            hits += probabilities[h] * hit
            total += probabilities[h] * weight
        return np.asarray(hits / total)


def _around(radii: Points) -> Targets:
    """What errors are to be within, seen from their goals."""
    return Targets(np.zeros_like(radii), radii)
