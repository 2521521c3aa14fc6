"""Latent values that were read through intervals: expectation propagation, many models at once.

A latent d of Gaussian prior N(0, K) is read n times. One reading says that d_i, blurred by N(0,
v_i), lies in [low_i, high_i], or with a small probability e says nothing at all:

    L_i(d) = (1 - e) [Phi((high - d) / s) - Phi((low - d) / s)] + e (high - low) / W,   s^2 = v_i
             (1 - e) N(low; d, v_i) + e / W                              where low = high

Each likelihood is approximated by a Gaussian site, exp(-tau d^2 / 2 + nu d), whose moments agree
with those of the true one under the other sites' distribution. The tilted moments are closed forms:
a truncated normal, mixed with the distribution before the reading. All sites are updated at once,
damped, for all models in one batch.

Readings that contradict each other have several modes, and the updates may then swing for ever; the
evidence of such sites is off by any amount. There each reading is taken in once instead, in order:
assumed-density filtering, whose evidence is a product of predictive densities and cannot diverge.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, Section 3.6 and eqs.
3.65 to 3.74, for sites, predictions and log evidence; Minka, A family of algorithms for approximate
Bayesian inference, 2001, Section 3.1, for the filtering; the intervals and the mixture are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

_SWEEPS = 15
"""Updates of all sites at most (ours): means are then settled to a tenth of a millimetre."""
_DAMPING = 0.8
"""Share of each update that is taken (ours): undamped, parallel updates may swing."""
_SETTLED = 1e-2
"""Change of every posterior mean, in posterior standard deviations, that ends the updates."""
_SWINGING = 0.5
"""Change of a posterior mean by the last update, in posterior standard deviations, that tells sites
which do not settle (ours)."""
_LEAST_PRECISION = 1e-8
"""A site that would have less says nothing (ours); prior variances are about 0.1."""
_FARTHEST = 37.0
"""Standard deviations beyond which the normal distribution is 0 in floating point."""
_TINY = 1e-290

Each = Float[np.ndarray, "m k n"]
"""A number for each latent, under m models and for k outputs."""
Matrices = Float[np.ndarray, "m k n n"]
Sites = tuple[Float[np.ndarray, "m k s"], Float[np.ndarray, "m k s"]]
"""Precision, and precision times mean."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What was read, for each output a row: arrays of shape (k, n)."""

    low: Float[np.ndarray, "k n"]
    """Least value; may be -inf."""
    high: Float[np.ndarray, "k n"]
    """Greatest value; may be inf, equal to `low` where a number was read."""
    variance: Float[np.ndarray, "k n"]
    """v, positive."""
    outlier: float = 0.01
    """e, probability that a reading says nothing."""
    width: float = 8.0
    """W, what an outlier may be anywhere in."""


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
    log_evidence: Float[np.ndarray, "m k"]
    """log p(readings, model), for each output."""

    def sites(self, which: Bool[np.ndarray, " n"]) -> Sites:
        """Tau and nu of some of the readings."""
        return self.tau[..., which], self.nu[..., which]

    @property
    def model_weights(self) -> Float[np.ndarray, "m k"]:
        """Posterior probability of each model, for each output."""
        share = np.exp(self.log_evidence - self.log_evidence.max(axis=0))
        return np.asarray(share / share.sum(axis=0))


def infer(
    covariance: Float[np.ndarray, "m n n"],
    readings: Readings,
    log_prior: Float[np.ndarray, " m"] | float = 0.0,
    start: Sites | None = None,
) -> Posterior:
    """Return the latent's posterior under each of m prior covariances.

    Deterministic; k outputs are independent and share each covariance.

    Args:
        covariance: K of each model.
        readings: Of k outputs, n each; n may be 0.
        log_prior: Of each model, beforehand; all equal where it is not said.
        start: Where the sites of the first readings begin.
    """
    m, n, _ = covariance.shape
    k = len(readings.low)
    prior = covariance[:, None]
    tau, nu, before = np.zeros((3, m, k, n))
    if start is not None:
        known = start[0].shape[-1]
        tau[..., :known], nu[..., :known] = start
    for sweep in range(_SWEEPS):
        mean, variance, precision = _latent(prior, tau, nu)
        if sweep and np.all(np.abs(mean - before) < _SETTLED * np.sqrt(variance)):
            break
        before = mean
        # The distribution of each latent without its own site, and with its reading instead.
        rest_tau, rest_mean = _rest(mean, variance, tau, nu)
        _, tilted_mean, tilted_variance = tilted(rest_mean, 1.0 / rest_tau, readings)
        new_tau = np.clip(1.0 / tilted_variance - rest_tau, _LEAST_PRECISION, 1e10)
        new_nu = (rest_tau + new_tau) * tilted_mean - rest_tau * rest_mean
        new_nu = np.where(new_tau > _LEAST_PRECISION, new_nu, 0.0)
        share = 1.0 if sweep == 0 and start is None else _DAMPING
        tau, nu = tau + share * (new_tau - tau), nu + share * (new_nu - nu)
    mean, variance, precision = _latent(prior, tau, nu)
    settled = np.all(np.abs(mean - before) < _SWINGING * np.sqrt(variance), axis=-1)
    rest_tau, rest_mean = _rest(mean, variance, tau, nu)
    log_z, _, _ = tilted(rest_mean, 1.0 / rest_tau, readings)
    both = rest_tau + tau
    of_sites = log_z + 0.5 * (
        np.log1p(tau / rest_tau)
        + nu * mean
        - nu**2 / both
        + rest_mean * rest_tau / both * (tau * rest_mean - 2.0 * nu)
    )
    log_determinant = np.linalg.slogdet(_whitened(prior, tau))[1]
    evidence = of_sites.sum(axis=-1) - 0.5 * log_determinant
    settled &= evidence <= _greatest_evidence(readings)
    if not np.all(settled):
        filtered = _filtered(prior, readings)
        tau = np.where(settled[..., None], tau, filtered[0])
        nu = np.where(settled[..., None], nu, filtered[1])
        evidence = np.where(settled, evidence, filtered[2])
        _, _, precision = _latent(prior, tau, nu)
    evidence += np.reshape(log_prior, (-1, 1))
    weights = nu - (precision @ (prior @ nu[..., None]))[..., 0]
    return Posterior(tau, nu, weights, precision, evidence)


def _greatest_evidence(readings: Readings) -> Float[np.ndarray, " k"]:
    """Log evidence of a latent that is what was read: no prior has more."""
    e, number = readings.outlier, readings.high <= readings.low
    density = 1.0 / np.sqrt(2.0 * math.pi * readings.variance)
    likelihood = np.where(number, (1.0 - e) * density + e / readings.width, 1.0)
    return np.asarray(np.log(likelihood).sum(axis=-1))


def _filtered(
    prior: Float[np.ndarray, "m 1 n n"], readings: Readings
) -> tuple[Each, Each, Float[np.ndarray, "m k"]]:
    """Sites and log evidence where each reading is taken in once, in order."""
    m, (k, n) = len(prior), readings.low.shape
    covariance = np.broadcast_to(prior, (m, k, n, n)).copy()
    mean, tau, nu = np.zeros((3, m, k, n))
    evidence = np.zeros((m, k))
    for i in range(n):
        one = replace(
            readings,
            low=readings.low[:, i, None],
            high=readings.high[:, i, None],
            variance=readings.variance[:, i, None],
        )
        at, variance = mean[..., i, None], np.maximum(covariance[..., i, i, None], 1e-12)
        log_z, told_mean, told_variance = tilted(at, variance, one)
        evidence += log_z[..., 0]
        site = np.clip(1.0 / told_variance - 1.0 / variance, _LEAST_PRECISION, 1e10)
        told_mean = np.where(site > _LEAST_PRECISION, told_mean, at)
        both, gain = 1.0 / variance + site, covariance[..., i] / variance
        tau[..., i, None], nu[..., i, None] = site, both * told_mean - at / variance
        mean += gain * (told_mean - at)
        less = (variance - 1.0 / both)[..., None]
        covariance -= less * gain[..., :, None] * gain[..., None, :]
    return tau, nu, evidence


def _rest(mean: Each, variance: Each, tau: Each, nu: Each) -> tuple[Each, Each]:
    """Precision and mean of each latent without its own site.

    Where updates swing, nothing may be left of the precision; the mean then stays where it is.
    """
    rest = 1.0 / variance - tau
    sound = rest > _LEAST_PRECISION
    rest = np.where(sound, rest, _LEAST_PRECISION)
    return rest, np.where(sound, (mean / variance - nu) / rest, mean)


def _whitened(prior: Float[np.ndarray, "m 1 n n"], tau: Each) -> Matrices:
    """I + tau^1/2 K tau^1/2, which is never ill-conditioned."""
    root = np.sqrt(tau)
    b = root[..., :, None] * prior * root[..., None, :]
    index = np.arange(tau.shape[-1])
    b[..., index, index] += 1.0
    return np.asarray(b)


def _latent(
    prior: Float[np.ndarray, "m 1 n n"], tau: Each, nu: Each
) -> tuple[Each, Each, Matrices]:
    """Mean and variance of every latent, and (K + diag(1 / tau))^-1."""
    root = np.sqrt(tau)
    precision = root[..., :, None] * np.linalg.inv(_whitened(prior, tau)) * root[..., None, :]
    reach = prior @ precision
    variance = np.diagonal(prior, axis1=-2, axis2=-1) - np.sum(reach * prior, axis=-1)
    by_sites = (prior @ nu[..., None])[..., 0]
    mean = by_sites - (reach @ by_sites[..., None])[..., 0]
    return mean, np.maximum(variance, 1e-12), precision


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
