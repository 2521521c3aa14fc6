"""Prior of the outcomes of plans that a symmetry moves, before any trial.

`moved` states the terms. There are three kinds of models: the symmetry holds as stated (0.85);
components that are not exact have the opposite sign (0.05); there is no symmetry (0.10), and every
entry of G may take any value. If demonstrations are mixed, outcomes may be steep between them.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.adapters.displacement import matern, rbf
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Anchors

_REACH = 0.3
"""Length scale of f and F, in the chart (ours)."""
AS_STATED, OTHER_WAY, NONE = "as stated", "the other way", "none"
"""Kinds of models: the symmetry holds, holds with another sign where it is not exact, or not."""
_P_OTHER_WAY, _P_NONE = 0.05, 0.10
"""Probabilities of models beside the stated ones (ours)."""
_CLOSELY = 0.05
_FACTORS = (
    (1.0, 1.0, 1.0, 0.45),
    (_CLOSELY, _CLOSELY, _CLOSELY, 0.33),
    (1.0, _CLOSELY, _CLOSELY, 0.22),
)
"""Factors of the sds of the law of distance, of offsets and of F, and the probability of each row
if the symmetry holds. Offsets may be small (a simulated arm, or one that was measured today) and
the law of another task still unknown: so a first hit nearby does not make a far goal look sure. No
row has large offsets and a known law: a first miss due to changed hardware would be blamed on the
law. Ours: that all may be small, by P(hit) on the zoo's development tasks; the shares, by drawn
laws and offsets (reproduction/benchmarks/drawn_laws.py)."""
_FACTORS_IF_MIXED = ((1.0, 1.0, 1.0, 0.375), (1.0, 1.0, 4.0, 0.075), *_FACTORS[1:])
"""The same if demonstrations are mixed: outcomes may be steep between them (ours, on the zoo's
development tasks and V1 to V3; reproduction/docs/decisions-adapter.md). The first row stays the
most probable one: first throws aim by it."""
_OWN_SHARE = 0.01
"""Share of the variance of offsets that is each demonstration's own (ours): replaying one gives its
outcome, but for the noise of an execution."""
_ANY_GAIN, _ANY_BEND = 0.8, 3.0
"""Without a symmetry: least sd of every entry of G, and factor of the sd of f."""
_CACHED = 4
"""Sets of aims whose bases are cached (ours): those of trials are queried again and again."""


@dataclass(frozen=True, eq=False)
class Model:
    """Prior of G, and factors of the sds of the other terms."""

    name: str
    """`AS_STATED`, `OTHER_WAY` or `NONE`."""
    gain_mean: Float[np.ndarray, "k k"]
    gain_sd: Float[np.ndarray, "k k"]
    offset: float
    """Factor of the sds of b and b_i."""
    bend: float
    """Factor of the sd of f."""
    between: float
    """Factor of the sd of F."""
    probability: float


class MovedPrior:
    """Prior means and covariances of outcomes of moved plans, in the chart."""

    def __init__(self, demonstrations: Demonstrations) -> None:
        """Take the demonstrations, which carry a symmetry."""
        assert demonstrations.symmetry is not None
        self.symmetry = symmetry = demonstrations.symmetry
        self.anchors = Anchors(symmetry, demonstrations.outcomes_seen, demonstrations.outcome_noise)
        corrected = demonstrations.outcomes_seen + demonstrations.outcome_correction
        self._label_errors = symmetry.chart.to(corrected) - self.anchors.z
        jacobian = symmetry.chart.jacobian(self.anchors.z).mean(axis=0)
        self.scale: Point = np.linalg.norm(jacobian, axis=1)
        """Outcomes per unit of the chart, (k,)."""
        self.inexact: Int[np.ndarray, " s"] = self.anchors.left
        """Components that the symmetry does not carry exactly."""
        self.models = self._models()
        self._cache: dict[bytes, tuple[Points, Float[np.ndarray, "n N"]]] = {}

    def _models(self) -> tuple[Model, ...]:
        symmetry, mean, sd = self.symmetry, self.symmetry.gain_mean, self.symmetry.gain_sd
        known = symmetry.exact | symmetry.learned
        combinations = itertools.product(*([1.0] if each else [1.0, -1.0] for each in known))
        signs = [np.array(each) for each in combinations][1:]
        stated = 1.0 - _P_NONE - (_P_OTHER_WAY if signs else 0.0)
        other = _P_OTHER_WAY / max(len(signs), 1)
        return (
            *(
                Model(AS_STATED, mean, law * sd, offset, law, between, p * stated)
                for law, offset, between, p in (
                    _FACTORS_IF_MIXED if self.anchors.mixed else _FACTORS
                )
            ),
            *(Model(OTHER_WAY, mean * s, sd, 1.0, 1.0, 1.0, other) for s in signs),
            Model(NONE, mean, np.maximum(sd, _ANY_GAIN), 1.0, _ANY_BEND, 1.0, _P_NONE),
        )

    def base(self, aims: Points) -> tuple[Points, Float[np.ndarray, "n N"]]:
        """Return z_base (n, k) and the weights v (n, N) of demonstrations; see `Anchors.base`."""
        key = aims.tobytes()
        if key not in self._cache:
            if len(self._cache) >= _CACHED:
                self._cache.pop(next(iter(self._cache)))
            self._cache[key] = self.anchors.base(aims)
        return self._cache[key]

    def moves(self, aims: Points) -> Points:
        """Return by how much plans for these aims are moved: w, (n, k)."""
        return np.asarray(aims - self.base(aims)[0])

    def mean(self, model: Model, aims: Points) -> Points:
        """Return the prior mean of z, (n, k)."""
        base, v = self.base(aims)
        return np.asarray(base + v @ self._label_errors + (aims - base) @ model.gain_mean.T)

    def covariance(
        self, model: Model, a: Float[np.ndarray, "p k"], b: Points
    ) -> Float[np.ndarray, "k p n"]:
        """Return the prior covariance of each component of z; components are independent."""
        symmetry, sd = self.symmetry, model.gain_sd
        (base_a, v_a), (base_b, v_b) = self.base(a), self.base(b)
        w_a, w_b = a - base_a, b - base_b
        counts = ~symmetry.exact if len(self.inexact) else np.ones(symmetry.k, dtype=bool)
        lengths = np.outer(*(np.linalg.norm(w * counts, axis=1) for w in (w_a, w_b)))
        bend = lengths * rbf(w_a * counts, w_b * counts, _REACH)
        between = np.zeros_like(bend)
        if self.anchors.mixed:
            z_a, z_b, z = (each[:, self.inexact] for each in (base_a, base_b, self.anchors.z))
            between = matern(z_a, z_b, _REACH) + v_a @ matern(z, z, _REACH) @ v_b.T
            between -= matern(z_a, z, _REACH) @ v_b.T + v_a @ matern(z, z_b, _REACH)
        offset = (1.0 - _OWN_SHARE) + _OWN_SHARE * v_a @ v_b.T
        return np.stack(
            [
                (w_a * sd[j] ** 2) @ w_b.T
                + (model.offset * symmetry.offset_sd[j]) ** 2 * offset
                + (v_a * self.anchors.sd[:, j] ** 2) @ v_b.T
                + (model.bend * symmetry.bend_sd[j]) ** 2 * bend
                + (model.between * symmetry.between_sd[j]) ** 2 * between
                for j in range(symmetry.k)
            ]
        )
