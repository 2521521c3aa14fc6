r"""Posterior of the outcomes of plans that a symmetry moves, and of changes between trials.

In the chart of the symmetry (`plans.symmetry`) a plan moved from z_base by w has the outcome

    z = z_base + G w + b + sum_i v_i b_i + f(w) + F(z_base) - sum_i v_i F(z_i),    r = back(z) + s

with independent Gaussian terms:

    G    gain, of mean and sd as the symmetry states: the identity where it is exact
    b    offset of all outcomes, as on another day; b_i the offset of demonstration i, of weight
         v_i: the error of its label, and the noise of one execution
    f    deviation from a power law, which grows with |w|; constant along exact components
    F    error between demonstrations that are mixed
    s    shift of all outcomes since some trial, announced or not

A hypothesis combines one kind of model (`moved_prior`) with changes since certain trials. The
evidence of readings weighs the hypotheses.

A reading says in which interval the outcome lies, in the outcomes' units. The chart is linearised
at the outcome that was read: linearised at the predicted one, a wrong sign would confirm itself.
So readings are intervals on latents of Gaussian prior, as in `expectation_propagation`.

Source: ours; sizes in reproduction/docs/decisions-adapter.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.base import State
from prior_reinforce.adapters.change_points import Change, announced_changes, changes_from_data
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.memory import Inputs, Memory
from prior_reinforce.adapters.moved_prior import Model, MovedPrior
from prior_reinforce.adapters.p_hit import Targets, standard_normal, weighted_hits
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations

_LEAST_GAIN = 0.3
"""Least magnitude of the diagonal of G where it is not exact (ours)."""
_SHIFT = 0.2
"""Sd of a shift, in outcomes per unit of the chart: of the distance to the axis (ours)."""
_HARDWARE_FACTOR = 3.0
"""Sd of offsets after a change of hardware, relative to those of another day (ours)."""
UNIT = 0.15
"""Unit of readings, in outcomes per unit of the chart (ours)."""
EXECUTION = 0.03
"""Sd of an execution in that unit, if no tolerance is known (ours)."""
OF_TOLERANCE = 1 / 3
"""Sd of an execution in tolerances (ours)."""
_GAIN_VARIANCE = 1e-6
"""Variance of the reading that says that G has this least magnitude (ours)."""
_SINGULAR = 1e-6
"""Least eigenvalue of a covariance of misses, as a share of an execution's variance (ours)."""
_OUTLIER = 1e-4
"""Probability that one component of a reading says nothing (ours): with a greater one, the first
throw after a shift is taken for a slip of the tongue, and repeated."""
_LEAST_ODDS, _LEAST_RECENT_ODDS, _MOST_HYPOTHESES = 1e-3, 1e-7, 12
"""Least odds of a hypothesis against the best one, the same if its last change is recent, and the
most hypotheses that are kept (ours)."""
_STEPS, _LONGEST, _CONVERGED, _DAMPING = 12, 0.5, 1e-5, 1e-3
"""Newton's method for the aim: most steps, the longest step in each component and the last one, in
units of the chart, and Levenberg's damping (ours)."""
_DIFFERENCE = 1e-3
"""Change of an aim for a difference quotient, in the chart (ours)."""
_SAMPLES = 1024
"""Samples of each hypothesis for the probability of a hit (ours)."""
_IMPROBABLE = 0.01
"""Probability of a hypothesis below which it is left out of the probability of a hit (ours)."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A model, the changes under it, and the points at which readings were linearised."""

    model: int
    changes: tuple[Change, ...]
    """Shifts of all outcomes where their `shift_sd` is positive, else offsets in the chart."""
    log_prior: float
    z: Points
    """Points of linearisation, (n, k)."""
    jacobian: Float[np.ndarray, "n k k"]
    """dr/dz there, r in `UNIT`."""

    def extend(self, log_p: float, *changes: Change) -> Hypothesis:
        """Return it with further changes, of that log probability."""
        return replace(self, changes=(*self.changes, *changes), log_prior=self.log_prior + log_p)

    def common_changes(self, a: Inputs, b: Inputs, *, shifts: bool) -> Float[np.ndarray, "p n"]:
        """Return the number of shifts, or of other changes, that affect both of two inputs."""
        common = np.zeros((len(a.numbers), len(b.numbers)))
        for change in self.changes:
            if bool(change.shift_sd) is shifts:
                common += np.outer(change.affects(a), change.affects(b))
        return common


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Gaussian prediction of the outcomes of p plans under a hypothesis."""

    inputs: Inputs
    z: Float[np.ndarray, "p k"]
    mean: Float[np.ndarray, "p k"]
    """r, in the outcomes' units."""
    jacobian: Float[np.ndarray, "p k k"]
    """dr/dz."""
    cross: Float[np.ndarray, "p k q"]
    """Prior covariance of r with all latents that were read."""

    def select(self, which: slice) -> Outcomes:
        """Index all arrays."""
        inputs, *arrays = vars(self).values()
        return Outcomes(inputs.select(which), *(array[which] for array in arrays))


class MovedPosterior:
    """Hypotheses of the outcomes of moved plans, the most probable first, and their posteriors."""

    def __init__(self, demonstrations: Demonstrations, p_change: float) -> None:
        """Begin with the demonstrations, without trials."""
        self.prior = MovedPrior(demonstrations)
        self.symmetry, self.k = self.prior.symmetry, self.prior.symmetry.k
        self._unit, self._p_change = UNIT * self.prior.scale, p_change
        self.memory = Memory.empty(self.k)
        none = np.empty((0, self.k)), np.empty((0, self.k, self.k))
        self.hypotheses = [
            Hypothesis(i, (), math.log(model.probability), *none)
            for i, model in enumerate(self.prior.models)
        ]
        self._goal_starts: tuple[int, ...] = ()  # numbers of the first trials of the last two goals
        self._posterior = self._infer(None)
        self._prune(0)

    def state(self) -> State:
        """Return what `resume` needs."""
        hypotheses = self.hypotheses
        return State(
            {
                "hypotheses": [
                    [h.model, list(map(astuple, h.changes)), h.log_prior] for h in hypotheses
                ],
                "begun": list(self._goal_starts),
            },
            {
                **vars(self.memory),
                **vars(self._posterior),
                "at": np.stack([h.z for h in hypotheses]),
                "jacobian": np.stack([h.jacobian for h in hypotheses]),
            },
        )

    def resume(self, state: State) -> None:
        """Take up what `state` returned."""
        self._goal_starts = tuple(state.facts["begun"])
        self.memory, self._posterior = state.build(Memory), state.build(Posterior)
        each = state.facts["hypotheses"], state.arrays["at"], state.arrays["jacobian"]
        self.hypotheses = [
            Hypothesis(model, changes_from_data(changes), log_prior, z, jacobian)
            for (model, changes, log_prior), z, jacobian in zip(*each, strict=True)
        ]

    @property
    def probabilities(self) -> Float[np.ndarray, " h"]:
        """Probability of each hypothesis."""
        return np.asarray(self._posterior.model_weights[:, 0])

    def model(self, h: int) -> Model:
        """Return the model of a hypothesis."""
        return self.prior.models[self.hypotheses[h].model]

    def announce_change(self, number: int) -> None:
        """Branch all hypotheses: a change before that trial or, less probably, none."""
        announced, every = announced_changes(number, 1.0), range(len(self.hypotheses))
        self._branch([(h, changes, log_p) for changes, log_p in announced for h in every])

    def observe(self, new: Memory) -> None:
        """Take in one more trial.

        Args:
            new: That trial alone. Its condition is the aim, in the chart; `low`, `high`,
                `variance` and `missed_by` are of outcome minus goal, in the outcomes' units.
        """
        number, best = int(new.numbers[0]), self.hypotheses[0].model
        if len(self.memory.numbers) and not np.array_equal(self.memory.goals[-1:], new.goals):
            self._goal_starts = (*self._goal_starts, number)[-2:]
        unchanged = [(h, (), 0.0) for h in range(len(self.hypotheses))]
        changed = [
            (h, (Change(number, 1.0),), math.log(self._p_change))
            for h, hypothesis in enumerate(self.hypotheses)
            if number
            and hypothesis.model in (0, best)
            and len(hypothesis.changes) < 3
            and not any(change.since >= number - 2 for change in hypothesis.changes)
        ]
        self._branch([*unchanged, *changed])
        self.hypotheses = [self._linearise(h, new) for h in range(len(self.hypotheses))]
        self.memory = self.memory.append(new)
        kept, previous = self.memory.kept(), self._posterior
        if not np.all(kept):
            self.memory = self.memory.select(kept)
            self.hypotheses = [
                replace(h, z=h.z[kept], jacobian=h.jacobian[kept]) for h in self.hypotheses
            ]
        self._posterior = self._infer(previous if np.all(kept) else None)
        self._prune(number)

    def _branch(self, branches: Sequence[tuple[int, tuple[Change, ...], float]]) -> None:
        """Replace hypotheses by branches: an index, further changes, and their log probability."""
        posterior = self._posterior.select([h for h, _, _ in branches])
        log_p = np.array([log_p for _, _, log_p in branches])[:, None]
        self._posterior = replace(posterior, log_evidence=posterior.log_evidence + log_p)
        self.hypotheses = [self.hypotheses[h].extend(log_p, *more) for h, more, log_p in branches]

    def _linearise(self, h: int, new: Memory) -> Hypothesis:
        """Add the point of linearisation of a trial: the outcome that was read, less its shift."""
        hypothesis, chart = self.hypotheses[h], self.symmetry.chart
        predicted = self.predict(h, new)
        low, high = (
            np.where(np.isinf(end), other, end)
            for end, other in ((new.low, new.high), (new.high, new.low))
        )
        unshifted = chart.back(predicted.z)
        with np.errstate(invalid="ignore"):  # nothing was read
            seen = new.goals + 0.5 * (low + high) - (predicted.mean - unshifted)
        if any(c.shift_sd and c.since == new.numbers[0] for c in hypothesis.changes):
            seen = unshifted
        z = chart.to(np.where(np.isfinite(seen), seen, unshifted))
        jacobian = chart.jacobian(z) / self._unit[:, None]
        return replace(
            hypothesis,
            z=np.vstack([hypothesis.z, z]),
            jacobian=np.concatenate([hypothesis.jacobian, jacobian]),
        )

    def _infer(self, previous: Posterior | None) -> Posterior:
        """Infer the posteriors of all hypotheses in one batch.

        The latents are the inexact diagonal entries of G, then all components of the trials.
        """
        prior, memory, chart = self.prior, self.memory, self.symmetry.chart
        unit, inexact, aims = self._unit, prior.inexact, memory.conditions
        w, s, n = prior.moves(aims), len(inexact), len(memory.numbers)
        models = {h.model: prior.models[h.model] for h in self.hypotheses}
        means = {m: prior.mean(model, aims) for m, model in models.items()}
        covariances = {m: prior.covariance(model, aims, aims) for m, model in models.items()}
        shape = len(self.hypotheses), 1, s + n * self.k
        covariance, (low, high) = np.zeros((shape[0], shape[2], shape[2])), np.empty((2, *shape))
        for i, hypothesis in enumerate(self.hypotheses):
            m, jacobian = hypothesis.model, hypothesis.jacobian
            gain_mean = np.diag(models[m].gain_mean)[inexact]
            gain_sd = np.diag(models[m].gain_sd)[inexact]
            low[i, 0, :s] = np.where(gain_mean > 0, _LEAST_GAIN - gain_mean, -np.inf)
            high[i, 0, :s] = np.where(gain_mean > 0, np.inf, -_LEAST_GAIN - gain_mean)
            offset = np.einsum("ncj,nj->nc", jacobian, hypothesis.z - means[m])
            offset += (memory.goals - chart.back(hypothesis.z)) / unit
            low[i, 0, s:], high[i, 0, s:] = (
                (end / unit + offset).ravel() for end in (memory.low, memory.high)
            )
            covariance[i, :s, :s] = np.diag(gain_sd**2)
            cross = np.einsum("ncj,nj->jnc", jacobian[..., inexact], w[:, inexact] * gain_sd**2)
            covariance[i, :s, s:] = cross.reshape(s, n * self.k)
            covariance[i, s:, :s] = covariance[i, :s, s:].T
            of_z = covariances[m] + self._hardware_covariance(i, memory, memory)
            of_r = np.einsum("ncj,jnm,mdj->ncmd", jacobian, of_z, jacobian)
            of_r += self._shift_covariance(i, memory, memory) / (unit[:, None, None] * unit)
            covariance[i, s:, s:] = of_r.reshape(n * self.k, n * self.k)
        variance = np.concatenate([np.full(s, _GAIN_VARIANCE), (memory.variance / unit**2).ravel()])
        readings = Readings(low, high, np.broadcast_to(variance, low.shape), _OUTLIER)
        log_prior = np.array([h.log_prior for h in self.hypotheses])
        return infer(covariance, readings, log_prior, previous and previous.as_start())

    def _hardware_covariance(self, h: int, a: Inputs, b: Inputs) -> Float[np.ndarray, "k p n"]:
        """Covariance that changed hardware adds to z."""
        common = self.hypotheses[h].common_changes(a, b, shifts=False)
        variance = np.square(_HARDWARE_FACTOR * self.symmetry.offset_sd)
        return np.asarray(variance[:, None, None] * common)

    def _shift_covariance(self, h: int, a: Inputs, b: Inputs) -> Float[np.ndarray, "p k n k"]:
        """Covariance that shifts add to outcomes."""
        common = self.hypotheses[h].common_changes(a, b, shifts=True)
        variance = np.square(_SHIFT * self.prior.scale)
        return np.asarray(common[:, None, :, None] * np.diag(variance)[None, :, None])

    def _prior_covariance(self, h: int, a: Inputs, b: Inputs) -> Float[np.ndarray, "k p n"]:
        """Prior covariance of z under a hypothesis."""
        of_model = self.prior.covariance(self.model(h), a.conditions, b.conditions)
        return of_model + self._hardware_covariance(h, a, b)

    def predict(self, h: int, inputs: Inputs) -> Outcomes:
        """Predict the outcomes of plans under a hypothesis; the conditions of inputs are aims."""
        prior, memory, chart = self.prior, self.memory, self.symmetry.chart
        model, inexact, aims, p = self.model(h), prior.inexact, inputs.conditions, len(inputs.goals)
        shape = (p, self.k, len(memory.numbers) * self.k)
        gain = np.zeros((p, self.k, len(inexact)))
        shifts = (self._shift_covariance(h, inputs, memory) / self._unit).reshape(shape)
        shifts = np.concatenate([gain, shifts], axis=2)
        of_z, jacobian = self._prior_covariance(h, inputs, memory), self.hypotheses[h].jacobian
        cross = np.einsum("jpn,ncj->pjnc", of_z, jacobian).reshape(shape)
        of_gain = prior.moves(aims)[:, inexact] * np.diag(model.gain_sd)[inexact] ** 2
        gain[:, inexact, np.arange(len(inexact))] = of_gain
        cross = np.concatenate([gain, cross], axis=2)
        weights = self._posterior.weights[h, 0]
        z = prior.mean(model, aims) + cross @ weights
        jacobian, mean = chart.jacobian(z), chart.back(z) + shifts @ weights
        return Outcomes(inputs, z, mean, jacobian, jacobian @ cross + shifts)

    def covariance(self, h: int, a: Outcomes, b: Outcomes) -> Float[np.ndarray, "p k n k"]:
        """Return the posterior covariance of outcomes, without the noise of an execution."""
        of_z = self._prior_covariance(h, a.inputs, b.inputs)
        of_r = np.einsum("pcj,jpn,ndj->pcnd", a.jacobian, of_z, b.jacobian)
        of_r += self._shift_covariance(h, a.inputs, b.inputs)
        precision = self._posterior.precision[h, 0]
        return np.asarray(of_r - np.einsum("pcq,qr,ndr->pcnd", a.cross, precision, b.cross))

    def marginal_covariance(self, h: int, outcomes: Outcomes) -> Float[np.ndarray, "p k k"]:
        """Return the same covariance of each outcome alone."""
        single = [outcomes.select(slice(i, i + 1)) for i in range(len(outcomes.mean))]
        each = [self.covariance(h, one, one)[0, :, 0] for one in single]
        return np.array(each).reshape(len(outcomes.mean), self.k, self.k)

    def find_aim(self, goal: Point, number: int, farthest: Point) -> Point:
        """Return the aim whose predicted outcome is a goal, under the most probable hypothesis.

        Newton's method with difference quotients; without convergence, the best of its iterates.

        Args:
            goal: In the outcomes' units.
            number: Of the trial.
            farthest: Longest move of a plan, in each component of the chart.
        """
        chart, k, least = self.symmetry.chart, self.k, np.inf
        z = best = chart.to(goal)
        differences = _DIFFERENCE * np.concatenate([np.zeros((1, k)), np.eye(k), -np.eye(k)])
        numbers, goals = np.full(len(differences), number), np.tile(goal, (len(differences), 1))
        for _ in range(_STEPS):
            outcomes = self.predict(0, Inputs(z + differences, numbers, goals))
            to_chart = np.linalg.inv(outcomes.jacobian[0])
            error = to_chart @ (outcomes.mean[0] - goal)
            if np.abs(error).max() < least:
                least, best = np.abs(error).max(), z
            difference = outcomes.mean[1 : k + 1] - outcomes.mean[k + 1 :]
            slope = to_chart @ difference.T / (2.0 * _DIFFERENCE)
            step = slope.T @ np.linalg.solve(slope @ slope.T + _DAMPING * np.eye(k), error)
            new = z - np.clip(step, -_LONGEST, _LONGEST)
            base = self.prior.base(new[None])[0][0]
            new = base + np.clip(new - base, -farthest, farthest)
            length, z = np.abs(new - z).max(), new
            if length < _CONVERGED:
                return np.asarray(z)
        return np.asarray(best)

    def _prune(self, number: int) -> None:
        """Keep probable hypotheses, and those whose recent change may yet become probable."""
        evidence = self._posterior.log_evidence[:, 0]
        order = np.argsort(-evidence, kind="stable")
        best = evidence[order[0]]
        recent = {number, number - 1, *self._goal_starts}
        kept = [
            int(h)
            for h in order
            if evidence[h] > best + math.log(_LEAST_ODDS)
            or (
                evidence[h] > best + math.log(_LEAST_RECENT_ODDS)
                and recent.issuperset(change.since for change in self.hypotheses[h].changes[-1:])
            )
        ][:_MOST_HYPOTHESES]
        self.hypotheses = [self.hypotheses[h] for h in kept]
        self._posterior = self._posterior.select(kept)

    def p_hit(
        self, inputs: Inputs, radius: Point, misses: Memory, seed: int = 0
    ) -> Float[np.ndarray, " p"]:
        """Return the probability that the outcome of each aim is within the radius of its goal.

        Args:
            inputs: Aims, the numbers of their trials, and goals.
            radius: Half-axes, (k,), in the outcomes' units.
            misses: Trials that missed; they weight samples as in `p_hit.weighted_hits`.
            seed: Of the samples.
        """
        n, size = len(misses.numbers), len(misses.numbers) * self.k
        hits, total = np.zeros(len(inputs.numbers)), 0.0
        noise, probabilities = np.square(OF_TOLERANCE * radius), self.probabilities
        missed = _centred(misses.missed_by)
        wanted = _centred(np.broadcast_to(radius, inputs.goals.shape))
        normal = standard_normal((_SAMPLES, size + self.k), seed)
        for h in map(int, np.flatnonzero(probabilities > _IMPROBABLE)):
            here, there = self.predict(h, inputs), self.predict(h, misses)
            covariance = self.covariance(h, there, there).reshape(size, size)
            values, vectors = np.linalg.eigh(covariance + np.diag(np.tile(noise, n)))
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            gain = self.covariance(h, here, there).reshape(len(inputs.goals), self.k, size)
            gain = gain @ (vectors / np.sqrt(np.maximum(values, _SINGULAR * noise.min())))
            left = self.marginal_covariance(h, here) + np.diag(noise)
            left = left - gain @ np.swapaxes(gain, 1, 2)
            at_misses = (there.mean - misses.goals).ravel() + normal[:, :size] @ root.T
            at_misses = np.moveaxis(at_misses.reshape(_SAMPLES, n, self.k), 2, 0)
            values, vectors = np.linalg.eigh(left)
            own = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
            errors = np.einsum("qi,pci->cqp", normal[:, :size], gain)
            errors = errors + np.einsum("qi,pci->cqp", normal[:, size:], own)
            errors = errors + (here.mean - inputs.goals).T[:, None]
            hit, weight = weighted_hits(at_misses, missed, errors, wanted, _OUTLIER)
            hits += probabilities[h] * hit
            total += probabilities[h] * weight
        return np.asarray(hits / total)


def _centred(radii: Points) -> Targets:
    """Targets of errors: ellipsoids around 0."""
    return Targets(np.zeros_like(radii), radii)
