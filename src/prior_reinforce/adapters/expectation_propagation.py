"""Expectation propagation on latent values that were read through intervals, for many models.

A latent d of Gaussian prior N(0, K) is read n times. One reading says that d_i, blurred by N(0,
v_i), lies in [low_i, high_i]; with a small probability e it is an outlier and says nothing:

    L_i(d) = (1 - e) [Phi((high - d) / s) - Phi((low - d) / s)] + e (high - low) / W,   s^2 = v_i
             (1 - e) N(low; d, v_i) + e / W                              where low = high

Each likelihood is approximated by a Gaussian site, exp(-tau d^2 / 2 + nu d). The site has the
moments of the tilted distribution: the cavity (the posterior without this site) times the true
likelihood. They are closed forms, those of a truncated normal mixed with the cavity. A new reading
is first included by assumed-density filtering; then parallel damped updates of all sites of a model
follow. The posterior covariance predicts by how much an update would move the means, so that models
whose sites have converged cost no inverse.

If readings contradict each other, the posterior has several modes and the updates may oscillate;
the evidence of sites that have not converged can be off by any amount. Such models keep the result
of filtering, whose evidence is a product of predictive densities and cannot diverge.

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
"""Most updates of all sites (ours): means are then settled to a tenth of a millimetre."""
_DAMPING = 0.8
"""Share of each update that is applied (ours): undamped parallel updates may oscillate."""
_CONVERGED = 1e-3
"""Posterior standard deviations by which an update of converged sites may move a mean (ours)."""
_OSCILLATING = 0.5
"""The same beyond which sites oscillate after the last update (ours)."""
_EVIDENCE_LOSS = 5.0
"""Most log evidence that updates may lose; more means that they led to another mode (ours)."""
_NEGLIGIBLE = 1e-4
"""Models less probable than this share of the best one are not updated (ours): proposals move by at
most 0.02 mm."""
_LEAST_PRECISION = 1e-8
"""Least precision of a site or cavity (ours); prior variances are about 0.1."""
_FARTHEST = 37.0
"""Standard deviations beyond which the normal distribution is 0 in floating point."""
_TINY = 1e-290

Vector = Float[np.ndarray, "*#of n"]
"""A number for each latent, mostly under m models and for k outputs."""
Matrix = Float[np.ndarray, "*#of n n"]


@dataclass(frozen=True, eq=False)
class Readings:
    """Intervals that were read, a row for each output: shape (k, n), or (m, k, n) for m models."""

    low: Vector
    """Least value; may be -inf."""
    high: Vector
    """Greatest value; may be inf, equal to `low` where a number was read."""
    variance: Vector
    """v, positive."""
    outlier: float = 0.01
    """e, probability that a reading says nothing."""
    width: float = 8.0
    """W, length of the interval over which an outlier is uniform."""

    def broadcast(self, shape: tuple[int, int, int]) -> Readings:
        """Repeat the readings for each of m models."""
        low, high, variance = (
            np.broadcast_to(array, shape) for array in (self.low, self.high, self.variance)
        )
        return replace(self, low=low, high=high, variance=variance)

    def select(self, index: Any) -> Readings:
        """Index all arrays."""
        low, high, variance = (array[index] for array in (self.low, self.high, self.variance))
        return replace(self, low=low, high=high, variance=variance)


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of the latents, for m models and k outputs."""

    tau: Vector
    """Precision of each site."""
    nu: Vector
    """Precision times mean of each site."""
    weights: Vector
    """E d(x) = k(x)' weights, k(x) being prior covariances with the latents."""
    precision: Matrix
    """(K + diag(1 / tau))^-1: Var d(x) = k(x, x) - k(x)' precision k(x)."""
    log_evidence: Float[np.ndarray, "*of"]
    """log p(readings, model), for each output."""
    filtered: Bool[np.ndarray, "*of"]
    """Whether this is the result of filtering alone, in order and under these covariances."""

    @classmethod
    def without_readings(cls, log_prior: Float[np.ndarray, "*of"]) -> Posterior:
        """The prior: no reading yet."""
        none = np.empty((*log_prior.shape, 0))
        precision, filtered = np.empty((*log_prior.shape, 0, 0)), np.ones(log_prior.shape, bool)
        return cls(none, none, none, precision, log_prior, filtered)

    @classmethod
    def concatenate(cls, posteriors: Sequence[Posterior]) -> Posterior:
        """Join posteriors along the axis of models."""
        arrays = (vars(posterior).values() for posterior in posteriors)
        return cls(*(np.concatenate(each) for each in zip(*arrays, strict=True)))

    def select(self, models: int | list[int] | slice | np.ndarray) -> Posterior:
        """Index the axis of models; a list may repeat one."""
        return Posterior(*(array[models] for array in vars(self).values()))

    @property
    def model_weights(self) -> Float[np.ndarray, "m k"]:
        """Posterior probability of each model, for each output."""
        share = np.exp(self.log_evidence - self.log_evidence.max(axis=0))
        return np.asarray(share / share.sum(axis=0))

    def as_start(self) -> Posterior:
        """Return it as a start for inference under other covariances."""
        return replace(self, filtered=np.zeros_like(self.filtered))

    def without(
        self, i: int, prior: Matrix, readings: Readings, log_prior: Float[np.ndarray, " m"]
    ) -> Posterior:
        """Return the posterior without reading i.

        Args:
            i: Index of the reading.
            prior: Covariances of the remaining latents.
            readings: The remaining readings.
            log_prior: Of each model.
        """
        rest, row = np.delete(np.arange(self.tau.shape[-1]), i), self.precision[..., i, :]
        share = row[..., rest] / row[..., i, None]
        block = self.precision[..., rest[:, None], rest]
        sites = (
            self.tau[..., rest],
            self.nu[..., rest],
            self.weights[..., rest] - share * self.weights[..., i, None],
            block - share[..., :, None] * row[..., None, rest],
        )
        evidence = log_prior[:, None] + _log_evidence(prior, *sites, readings)
        return Posterior(*sites, evidence, np.zeros_like(self.filtered))

    def update(self, prior: Matrix, readings: Readings) -> Posterior:
        """Include the first reading that is not yet included, by assumed-density filtering.

        Args:
            prior: Covariances of all latents that are read.
            readings: All readings, included or not.
        """
        i = self.tau.shape[-1]
        cross, reading = prior[..., i, :i], readings.select(np.s_[..., i : i + 1])
        explained = (self.precision @ cross[..., None])[..., 0]
        mean = np.sum(cross * self.weights, axis=-1, keepdims=True)
        variance = prior[..., i, i, None] - np.sum(cross * explained, axis=-1, keepdims=True)
        variance = np.maximum(variance, 1e-12)
        log_z, *moments = tilted(mean, variance, reading)
        tau, nu = _site(mean, 1.0 / variance, *moments)
        gain = tau / (1.0 + tau * variance)
        weight = gain * (nu / tau - mean)
        precision = np.empty((*self.tau.shape[:-1], i + 1, i + 1))
        row = gain * explained
        precision[..., :i, :i] = self.precision + row[..., None] * explained[..., None, :]
        precision[..., i, :i] = precision[..., :i, i] = -row
        precision[..., i, i] = gain[..., 0]
        return Posterior(
            np.concatenate([self.tau, tau], axis=-1),
            np.concatenate([self.nu, nu], axis=-1),
            np.concatenate([self.weights - explained * weight, weight], axis=-1),
            precision,
            self.log_evidence + log_z[..., 0],
            self.filtered,
        )


def infer(
    covariance: Float[np.ndarray, "m n n"],
    readings: Readings,
    log_prior: Float[np.ndarray, " m"] | float = 0.0,
    previous: Posterior | None = None,
    groups: int = 1,
) -> Posterior:
    """Return the posterior of the latents under each of m prior covariances.

    Deterministic; k outputs are independent and share each covariance. New readings are filtered in
    order; then the sites of each model that is not negligible are updated until they converge.

    Args:
        covariance: K of each model.
        readings: Of k outputs, n each; n may be 0.
        log_prior: Of each model, or one for all.
        previous: Posterior of the first readings; `as_start` of one under other covariances.
        groups: Number of groups of m / groups consecutive models; each has its own best model.
    """
    (m, n, _), k = covariance.shape, readings.low.shape[-2]
    readings = readings.broadcast((m, k, n))
    log_prior = np.reshape(log_prior, (-1, 1)) + np.zeros((m, k))
    filtered = previous or Posterior.without_readings(log_prior)
    for _ in range(filtered.tau.shape[-1], n):
        filtered = filtered.update(covariance[:, None], readings)
    grouped = filtered.log_evidence.reshape(groups, m // groups, k)
    least = grouped.max(axis=1, keepdims=True) + math.log(_NEGLIGIBLE)
    likely = (grouped > least).reshape(m, k)
    tau, nu, weights, precision = (
        np.array(of) for of in (filtered.tau, filtered.nu, filtered.weights, filtered.precision)
    )
    active, failed = np.nonzero(likely), np.zeros((m, k), dtype=bool)
    for sweep in range(_SWEEPS + 1):
        K = covariance[active[0]]
        mean, variance = _marginals(tau[active], nu[active], weights[active], precision[active])
        cavity_mean, cavity_tau = _cavity(mean, variance, tau[active], nu[active])
        _, *moments = tilted(cavity_mean, 1.0 / cavity_tau, readings.select(active))
        new_tau, new_nu = _site(cavity_mean, cavity_tau, *moments)
        tau_step, nu_step = new_tau - tau[active], new_nu - nu[active]
        force = K @ (nu_step - tau_step * mean)[..., None]
        mean_step = np.abs(force - K @ (precision[active] @ force))[..., 0] / np.sqrt(variance)
        moving = np.any(mean_step > _CONVERGED, axis=-1)
        if sweep == _SWEEPS or not np.any(moving):
            failed[active] = np.any(mean_step > _OSCILLATING, axis=-1)
            break
        K, active = K[moving], (active[0][moving], active[1][moving])
        tau[active] += _DAMPING * tau_step[moving]
        nu[active] += _DAMPING * nu_step[moving]
        precision[active] = _precision(K, tau[active])
        weights[active] = nu[active] - (precision[active] @ (K @ nu[active][..., None]))[..., 0]
    evidence, of = np.array(filtered.log_evidence), np.nonzero(likely)
    evidence[of] = log_prior[of] + _log_evidence(
        covariance[of[0]], tau[of], nu[of], weights[of], precision[of], readings.select(of)
    )
    impossible = evidence - log_prior > _greatest_evidence(readings)
    failed |= likely & (impossible | (evidence < filtered.log_evidence - _EVIDENCE_LOSS))
    result = Posterior(tau, nu, weights, precision, evidence, filtered.filtered & ~likely | failed)
    if np.any(restored := failed & filtered.filtered):
        _assign(result, restored, filtered.select(restored))
    if np.any(repeated := failed & ~filtered.filtered):
        of = np.nonzero(repeated)
        again = Posterior.without_readings(log_prior[of])
        for _ in range(n):
            again = again.update(covariance[of[0]], readings.select(of))
        _assign(result, repeated, again)
    return result


def _assign(target: Posterior, index: Bool[np.ndarray, "m k"], values: Posterior) -> None:
    for name, array in vars(values).items():
        getattr(target, name)[index] = array


def _log_evidence(
    prior: Matrix, tau: Vector, nu: Vector, weights: Vector, precision: Matrix, readings: Readings
) -> Float[np.ndarray, "*of"]:
    """Log evidence of the readings as these sites approximate it."""
    mean, variance = _marginals(tau, nu, weights, precision)
    cavity_mean, cavity_tau = _cavity(mean, variance, tau, nu)
    log_z, _, _ = tilted(cavity_mean, 1.0 / cavity_tau, readings)
    total = cavity_tau + tau
    per_site = log_z + 0.5 * (
        np.log1p(tau / cavity_tau)
        + nu * mean
        - nu**2 / total
        + cavity_mean * cavity_tau / total * (tau * cavity_mean - 2.0 * nu)
    )
    root = np.diagonal(np.linalg.cholesky(_whitened(prior, tau)), axis1=-2, axis2=-1)
    return np.asarray(per_site.sum(axis=-1) - np.log(root).sum(axis=-1))


def _greatest_evidence(readings: Readings) -> Float[np.ndarray, "*of"]:
    """Upper bound of the log evidence: every latent equals what was read."""
    e, number = readings.outlier, readings.high <= readings.low
    density = 1.0 / np.sqrt(2.0 * math.pi * readings.variance)
    likelihood = np.where(number, (1.0 - e) * density + e / readings.width, 1.0)
    return np.asarray(np.log(likelihood).sum(axis=-1))


def _cavity(mean: Vector, variance: Vector, tau: Vector, nu: Vector) -> tuple[Vector, Vector]:
    """Mean and precision of each latent's cavity distribution.

    Oscillating updates may leave no precision; the mean is then that of the posterior.
    """
    precision = 1.0 / variance - tau
    sound = precision > _LEAST_PRECISION
    precision = np.where(sound, precision, _LEAST_PRECISION)
    return np.where(sound, (mean / variance - nu) / precision, mean), precision


def _site(
    mean: Vector, precision: Vector, tilted_mean: Vector, tilted_variance: Vector
) -> tuple[Vector, Vector]:
    """Return tau and nu of the site that gives a cavity the moments of the tilted distribution."""
    tau = np.clip(1.0 / tilted_variance - precision, _LEAST_PRECISION, 1e10)
    tilted_mean = np.where(tau > _LEAST_PRECISION, tilted_mean, mean)
    return tau, (precision + tau) * tilted_mean - precision * mean


def _whitened(prior: Matrix, tau: Vector) -> Matrix:
    """I + tau^1/2 K tau^1/2, which is never ill-conditioned."""
    root = np.sqrt(tau)
    b = root[..., :, None] * prior * root[..., None, :]
    index = np.arange(tau.shape[-1])
    b[..., index, index] += 1.0
    return np.asarray(b)


def _precision(prior: Matrix, tau: Vector) -> Matrix:
    """(K + diag(1 / tau))^-1."""
    root = np.sqrt(tau)
    inverse = np.linalg.inv(_whitened(prior, tau))
    return np.asarray(root[..., :, None] * inverse * root[..., None, :])


def _marginals(
    tau: Vector, nu: Vector, weights: Vector, precision: Matrix
) -> tuple[Vector, Vector]:
    """Posterior mean and variance of every latent, without a product of matrices.

    K - K P K = 1 / tau - (1 / tau) P (1 / tau), P being `precision`.
    """
    diagonal = np.diagonal(precision, axis1=-2, axis2=-1)
    return (nu - weights) / tau, np.maximum((1.0 - diagonal / tau) / tau, 1e-12)


def tilted(mean: Vector, variance: Vector, readings: Readings) -> tuple[Vector, Vector, Vector]:
    """Return log normaliser, mean and variance of N(mean, variance) times each likelihood."""
    from scipy.special import ndtr  # its import is a third of the start of a small command

    low, high, e = readings.low, readings.high, readings.outlier
    total = variance + readings.variance
    root = np.sqrt(total)
    is_interval = high > low
    # Where the interval lies above the mean, the mirror image keeps ndtr's digits.
    a, b = (low - mean) / root, (high - mean) / root
    above = a > 0
    a, b = np.where(above, -b, a), np.where(above, -a, b)
    a, b = np.clip(a, -_FARTHEST, _FARTHEST), np.clip(b, -_FARTHEST, _FARTHEST)
    density_a, density_b = _density(a), _density(b)
    mass = np.maximum(ndtr(b) - ndtr(a), _TINY)
    shift = (density_a - density_b) / mass  # mean of the truncated standard normal
    spread = np.clip(1.0 + (a * density_a - b * density_b) / mass - shift**2, 0.0, 1.0)  # variance
    shift = np.where(above, -shift, shift)
    number = np.where(is_interval, 0.0, low)  # open ends are intervals
    off = np.where(is_interval, 0.0, number - mean)
    density = np.maximum(_density(np.clip(off / root, -_FARTHEST, _FARTHEST)) / root, _TINY)
    gain = variance / total
    likelihood = np.where(is_interval, mass, density)
    uniform = np.where(is_interval, np.minimum(high - low, readings.width), 1.0) / readings.width
    read_mean = mean + np.where(is_interval, gain * root * shift, gain * off)
    read_variance = variance * (1.0 - gain * np.where(is_interval, 1.0 - spread, 1.0))
    z = (1.0 - e) * likelihood + e * uniform
    inlier = (1.0 - e) * likelihood / z  # probability that the reading is no outlier
    new_mean = inlier * read_mean + (1.0 - inlier) * mean
    new_variance = inlier * (read_variance + (read_mean - new_mean) ** 2) + (1.0 - inlier) * (
        variance + (mean - new_mean) ** 2
    )
    return np.log(z), new_mean, np.maximum(new_variance, 1e-12)


def _density(x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """The standard normal density."""
    return np.asarray(np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi))
