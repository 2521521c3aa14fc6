"""Latent values that were read through intervals: expectation propagation, many models at once.

A latent d of Gaussian prior N(0, K) is read n times. One reading says that d_i, blurred by N(0,
v_i), lies in [low_i, high_i], or with a small probability e says nothing at all:

    L_i(d) = (1 - e) [Phi((high - d) / s) - Phi((low - d) / s)] + e (high - low) / W,   s^2 = v_i
             (1 - e) N(low; d, v_i) + e / W                              where low = high

Each likelihood is approximated by a Gaussian site, exp(-tau d^2 / 2 + nu d), whose moments agree
with those of the true one under the other sites' distribution. The tilted moments are closed forms:
a truncated normal, mixed with the distribution before the reading. A new reading is taken in once
(assumed-density filtering); then all sites of a model are updated at once, damped, and the models
that an update would still move in one batch. The means that it would move are known from the
posterior covariance, so that sites which have settled cost no inverse.

Readings that contradict each other have several modes, and the updates may then swing for ever; the
evidence of such sites is off by any amount, and so is that of sites which were not updated. There
filtering is all that is done: its evidence is a product of predictive densities and cannot diverge.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, Section 3.6 and eqs.
3.65 to 3.74, for sites, predictions and log evidence; Minka, A family of algorithms for approximate
Bayesian inference, 2001, Section 3.1, for the filtering; the intervals and the mixture are ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

_SWEEPS = 15
"""Updates of all sites at most (ours): means are then settled to a tenth of a millimetre."""
_DAMPING = 0.8
"""Share of each update that is taken (ours): undamped, parallel updates may swing."""
_SETTLED = 1e-3
"""Change of every posterior mean by another update, in posterior standard deviations, below which
there is none (ours)."""
_SWINGING = 0.5
"""Such a change that tells sites which do not settle (ours)."""
_WORSE = 5.0
"""Log evidence that updates may cost; where more is lost they led to another mode (ours)."""
_LIGHT = 1e-4
"""Models less probable than this part of the best one are not updated (ours): proposals move by at
most 0.02 mm."""
_LEAST_PRECISION = 1e-8
"""A site that would have less says nothing (ours); prior variances are about 0.1."""
_FARTHEST = 37.0
"""Standard deviations beyond which the normal distribution is 0 in floating point."""
_TINY = 1e-290

Each = Float[np.ndarray, "*#of n"]
"""A number for each latent, mostly under m models and for k outputs."""
Matrices = Float[np.ndarray, "*#of n n"]
Sites = tuple[Each, Each]
"""Precision, and precision times mean."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What was read, for each output a row: arrays of shape (k, n), or (m, k, n) for m models."""

    low: Each
    """Least value; may be -inf."""
    high: Each
    """Greatest value; may be inf, equal to `low` where a number was read."""
    variance: Each
    """v, positive."""
    outlier: float = 0.01
    """e, probability that a reading says nothing."""
    width: float = 8.0
    """W, what an outlier may be anywhere in."""

    def each(self, shape: tuple[int, int, int]) -> Readings:
        """The same for each of m models."""
        low, high, variance = (
            np.broadcast_to(each, shape) for each in (self.low, self.high, self.variance)
        )
        return replace(self, low=low, high=high, variance=variance)

    def of(self, which: Any) -> Readings:
        """Some of them, by an index of the arrays."""
        low, high, variance = (each[which] for each in (self.low, self.high, self.variance))
        return replace(self, low=low, high=high, variance=variance)


@dataclass(frozen=True, eq=False)
class Posterior:
    """The latent after its readings, for m models and k outputs."""

    tau: Each
    """Precision of each site."""
    nu: Each
    """Precision times mean of each site."""
    weights: Each
    """What multiplies prior covariances to give a mean: E d(x) = k(x)' weights."""
    precision: Matrices
    """(K + diag(1 / tau))^-1: Var d(x) = k(x, x) - k(x)' precision k(x)."""
    log_evidence: Float[np.ndarray, "*of"]
    """log p(readings, model), for each output."""
    filtered: Bool[np.ndarray, "*of"]
    """Whether each reading was taken in once, in order, under these covariances, and no more."""

    @classmethod
    def before(cls, log_prior: Float[np.ndarray, "*of"]) -> Posterior:
        """What is known without any reading."""
        none = np.empty((*log_prior.shape, 0))
        precision, filtered = np.empty((*log_prior.shape, 0, 0)), np.ones(log_prior.shape, bool)
        return cls(none, none, none, precision, log_prior, filtered)

    @classmethod
    def joined(cls, posteriors: Sequence[Posterior]) -> Posterior:
        """Several, of models one after the other."""
        arrays = (vars(posterior).values() for posterior in posteriors)
        return cls(*(np.concatenate(each) for each in zip(*arrays, strict=True)))

    def under(self, which: int | list[int] | slice | np.ndarray) -> Posterior:
        """The same under one model, some, or one repeatedly."""
        return Posterior(*(of[which] for of in vars(self).values()))

    @property
    def model_weights(self) -> Float[np.ndarray, "m k"]:
        """Posterior probability of each model, for each output."""
        share = np.exp(self.log_evidence - self.log_evidence.max(axis=0))
        return np.asarray(share / share.sum(axis=0))

    def under_others(self) -> Posterior:
        """The same, to go on under covariances that are not those of before."""
        return replace(self, filtered=np.zeros_like(self.filtered))

    def without(
        self, i: int, prior: Matrices, readings: Readings, log_prior: Float[np.ndarray, " m"]
    ) -> Posterior:
        """The same without one reading.

        Args:
            i: Its number.
            prior: Covariances of the latents that are left.
            readings: Those that are left.
            log_prior: Of each model, beforehand.
        """
        rest, row = np.delete(np.arange(self.tau.shape[-1]), i), self.precision[..., i, :]
        share = row[..., rest] / row[..., i, None]
        among = self.precision[..., rest[:, None], rest]
        left = (
            self.tau[..., rest],
            self.nu[..., rest],
            self.weights[..., rest] - share * self.weights[..., i, None],
            among - share[..., :, None] * row[..., None, rest],
        )
        evidence = log_prior[:, None] + _log_evidence(prior, *left, readings)
        return Posterior(*left, evidence, np.zeros_like(self.filtered))

    def told(self, prior: Matrices, readings: Readings) -> Posterior:
        """The same after the first reading that it lacks: assumed-density filtering.

        Args:
            prior: Covariances of all latents that are read.
            readings: All of them, as far as they are known and further.
        """
        i = self.tau.shape[-1]
        to, one = prior[..., i, :i], readings.of(np.s_[..., i : i + 1])
        across = (self.precision @ to[..., None])[..., 0]
        mean = np.sum(to * self.weights, axis=-1, keepdims=True)
        variance = prior[..., i, i, None] - np.sum(to * across, axis=-1, keepdims=True)
        variance = np.maximum(variance, 1e-12)
        log_z, *moments = tilted(mean, variance, one)
        tau, nu = _site(mean, 1.0 / variance, *moments)
        gain = tau / (1.0 + tau * variance)
        weight = gain * (nu / tau - mean)
        precision = np.empty((*self.tau.shape[:-1], i + 1, i + 1))
        precision[..., :i, :i] = self.precision + (gain * across)[..., None] * across[..., None, :]
        precision[..., i, :i] = precision[..., :i, i] = -gain * across
        precision[..., i, i] = gain[..., 0]
        return Posterior(
            np.concatenate([self.tau, tau], axis=-1),
            np.concatenate([self.nu, nu], axis=-1),
            np.concatenate([self.weights - across * weight, weight], axis=-1),
            precision,
            self.log_evidence + log_z[..., 0],
            self.filtered,
        )


def infer(
    covariance: Float[np.ndarray, "m n n"],
    readings: Readings,
    log_prior: Float[np.ndarray, " m"] | float = 0.0,
    known: Posterior | None = None,
    groups: int = 1,
) -> Posterior:
    """Return the latent's posterior under each of m prior covariances.

    Deterministic; k outputs are independent and share each covariance. What is new is taken in
    once, in order; then the sites of each model that is not improbable are updated until another
    update would hardly move its means.

    Args:
        covariance: K of each model.
        readings: Of k outputs, n each; n may be 0.
        log_prior: Of each model, beforehand; all equal where it is not said.
        known: What the first readings said; `under_others` where covariances differ.
        groups: As many groups of models, one after the other, have nothing to do with each other.
    """
    (m, n, _), k = covariance.shape, readings.low.shape[-2]
    readings = readings.each((m, k, n))
    prior, log_share = covariance[:, None], np.reshape(log_prior, (-1, 1)) + np.zeros((m, k))
    first = known or Posterior.before(log_share)
    for _ in range(first.tau.shape[-1], n):
        first = first.told(prior, readings)
    grouped = first.log_evidence.reshape(groups, m // groups, k)
    likely = grouped > grouped.max(axis=1, keepdims=True) + math.log(_LIGHT)
    likely = likely.reshape(m, k)
    tau, nu, weights, precision = (
        np.array(of) for of in (first.tau, first.nu, first.weights, first.precision)
    )
    of, swings = np.nonzero(likely), np.zeros((m, k), dtype=bool)
    for sweep in range(_SWEEPS + 1):
        told, among = readings.of(of), covariance[of[0]]
        mean, variance = _latent(tau[of], nu[of], weights[of], precision[of])
        rest_tau, rest_mean = _rest(mean, variance, tau[of], nu[of])
        _, *moments = tilted(rest_mean, 1.0 / rest_tau, told)
        new_tau, new_nu = _site(rest_mean, rest_tau, *moments)
        more_tau, more_nu = new_tau - tau[of], new_nu - nu[of]
        pull = among @ (more_nu - more_tau * mean)[..., None]
        step = np.abs(pull - among @ (precision[of] @ pull))[..., 0] / np.sqrt(variance)
        going = np.any(step > _SETTLED, axis=-1)
        if sweep == _SWEEPS or not np.any(going):
            swings[of] = np.any(step > _SWINGING, axis=-1)
            break
        of = of[0][going], of[1][going]
        tau[of] += _DAMPING * more_tau[going]
        nu[of] += _DAMPING * more_nu[going]
        precision[of] = _precision(among[going], tau[of])
        weights[of] = nu[of] - (precision[of] @ (among[going] @ nu[of][..., None]))[..., 0]
    evidence, of = np.array(first.log_evidence), np.nonzero(likely)
    evidence[of] = log_share[of] + _log_evidence(
        covariance[of[0]], tau[of], nu[of], weights[of], precision[of], readings.of(of)
    )
    off = evidence - log_share > _greatest_evidence(readings)
    swings |= likely & (off | (evidence < first.log_evidence - _WORSE))
    results = Posterior(tau, nu, weights, precision, evidence, first.filtered & ~likely | swings)
    if np.any(known_so := swings & first.filtered):
        _put(results, np.nonzero(known_so), first.under(known_so))
    if np.any(anew := swings & ~first.filtered):
        of = np.nonzero(anew)
        alone = Posterior.before(log_share[of])
        for _ in range(n):
            alone = alone.told(covariance[of[0]], readings.of(of))
        _put(results, of, alone)
    return results


def _put(into: Posterior, of: Any, some: Posterior) -> None:
    for name, values in vars(some).items():
        getattr(into, name)[of] = values


def _log_evidence(
    prior: Matrices, tau: Each, nu: Each, weights: Each, precision: Matrices, readings: Readings
) -> Float[np.ndarray, "*of"]:
    """Log evidence of the readings, as the sites say."""
    mean, variance = _latent(tau, nu, weights, precision)
    rest_tau, rest_mean = _rest(mean, variance, tau, nu)
    log_z, _, _ = tilted(rest_mean, 1.0 / rest_tau, readings)
    both = rest_tau + tau
    of_sites = log_z + 0.5 * (
        np.log1p(tau / rest_tau)
        + nu * mean
        - nu**2 / both
        + rest_mean * rest_tau / both * (tau * rest_mean - 2.0 * nu)
    )
    half = np.diagonal(np.linalg.cholesky(_whitened(prior, tau)), axis1=-2, axis2=-1)
    return np.asarray(of_sites.sum(axis=-1) - np.log(half).sum(axis=-1))


def _greatest_evidence(readings: Readings) -> Float[np.ndarray, "*of"]:
    """Log evidence of a latent that is what was read: no prior has more."""
    e, number = readings.outlier, readings.high <= readings.low
    density = 1.0 / np.sqrt(2.0 * math.pi * readings.variance)
    likelihood = np.where(number, (1.0 - e) * density + e / readings.width, 1.0)
    return np.asarray(np.log(likelihood).sum(axis=-1))


def _rest(mean: Each, variance: Each, tau: Each, nu: Each) -> tuple[Each, Each]:
    """Precision and mean of each latent without its own site.

    Where updates swing, nothing may be left of the precision; the mean then stays where it is.
    """
    rest = 1.0 / variance - tau
    sound = rest > _LEAST_PRECISION
    rest = np.where(sound, rest, _LEAST_PRECISION)
    return rest, np.where(sound, (mean / variance - nu) / rest, mean)


def _site(mean: Each, precision: Each, told_mean: Each, told_variance: Each) -> Sites:
    """What turns a distribution without a reading into one with the moments that it gives."""
    tau = np.clip(1.0 / told_variance - precision, _LEAST_PRECISION, 1e10)
    told_mean = np.where(tau > _LEAST_PRECISION, told_mean, mean)
    return tau, (precision + tau) * told_mean - precision * mean


def _whitened(prior: Matrices, tau: Each) -> Matrices:
    """I + tau^1/2 K tau^1/2, which is never ill-conditioned."""
    root = np.sqrt(tau)
    b = root[..., :, None] * prior * root[..., None, :]
    index = np.arange(tau.shape[-1])
    b[..., index, index] += 1.0
    return np.asarray(b)


def _precision(prior: Matrices, tau: Each) -> Matrices:
    """(K + diag(1 / tau))^-1."""
    root = np.sqrt(tau)
    inverse = np.linalg.inv(_whitened(prior, tau))
    return np.asarray(root[..., :, None] * inverse * root[..., None, :])


def _latent(tau: Each, nu: Each, weights: Each, precision: Matrices) -> tuple[Each, Each]:
    """Mean and variance of every latent, by the sites: K - K P K = 1 / tau - (1 / tau) P (1 / tau).

    No product of matrices is needed for them.
    """
    own = np.diagonal(precision, axis1=-2, axis2=-1)
    return (nu - weights) / tau, np.maximum((1.0 - own / tau) / tau, 1e-12)


def tilted(mean: Each, variance: Each, readings: Readings) -> tuple[Each, Each, Each]:
    """Return log normaliser, mean and variance of N(mean, variance) times each likelihood."""
    from scipy.special import ndtr  # a third of the start of a command that infers nothing

    low, high, e = readings.low, readings.high, readings.outlier
    total = variance + readings.variance
    root = np.sqrt(total)
    is_interval = high > low
    # Where the interval lies above the mean, the mirror image keeps ndtr's digits.
    a, b = (low - mean) / root, (high - mean) / root
    above = a > 0
    a, b = np.where(above, -b, a), np.where(above, -a, b)
    a, b = np.clip(a, -_FARTHEST, _FARTHEST), np.clip(b, -_FARTHEST, _FARTHEST)
    at_a, at_b = _density(a), _density(b)
    inside = np.maximum(ndtr(b) - ndtr(a), _TINY)
    shift = (at_a - at_b) / inside  # mean of the truncated standard normal
    spread = np.clip(1.0 + (a * at_a - b * at_b) / inside - shift**2, 0.0, 1.0)  # its variance
    shift = np.where(above, -shift, shift)
    number = np.where(is_interval, 0.0, low)  # open ends are intervals
    off = np.where(is_interval, 0.0, number - mean)
    at_number = np.maximum(_density(np.clip(off / root, -_FARTHEST, _FARTHEST)) / root, _TINY)
    gain = variance / total
    z_read = np.where(is_interval, inside, at_number)
    flat = np.where(is_interval, np.minimum(high - low, readings.width), 1.0) / readings.width
    read_mean = mean + np.where(is_interval, gain * root * shift, gain * off)
    read_variance = variance * (1.0 - gain * np.where(is_interval, 1.0 - spread, 1.0))
    z = (1.0 - e) * z_read + e * flat
    believed = (1.0 - e) * z_read / z
    new_mean = believed * read_mean + (1.0 - believed) * mean
    second = believed * (read_variance + (read_mean - new_mean) ** 2) + (1.0 - believed) * (
        variance + (mean - new_mean) ** 2
    )
    return np.log(z), new_mean, np.maximum(second, 1e-12)


def _density(x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """The standard normal density."""
    return np.asarray(np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi))
