"""What is believed, before any trial, of where plans that a symmetry moves come down.

The terms stand in `moved`. Three kinds of models: the symmetry holds as stated (0.85); what is not
exact works the other way (0.05); there is none (0.10), and every entry of G may be anything. Where
demonstrations are mixed, landing may be steep between them.
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
"""How far f and F reach, in the chart (ours)."""
AS_STATED, OTHER_WAY, NONE = "as stated", "the other way", "none"
"""What may hold: the symmetry, what is not exact of it with another sign, or nothing."""
_P_OTHER_WAY, _P_NONE = 0.05, 0.10
"""Probabilities of models beside the stated ones (ours)."""
_CLOSELY = 0.05
_HOW_CLOSELY = (
    (1.0, 1.0, 1.0, 0.45),
    (_CLOSELY, _CLOSELY, _CLOSELY, 0.33),
    (1.0, _CLOSELY, _CLOSELY, 0.22),
)
"""Factors of what the law of distance, offsets and F are off by, and how probable they are where
the symmetry holds. Offsets may be small (a simulated arm, or one that was measured today),
and the law of another task still unknown: so a first hit nearby does not make a far goal look sure.
Where offsets are not small the law is not known either: else a first miss that comes of changed
hardware would be blamed on it. Ours: that all may be small, by P(hit) on the zoo's development
tasks; the shares, by drawn laws and offsets (reproduction/benchmarks/drawn_laws.py)."""
_IF_MIXED = ((1.0, 1.0, 1.0, 0.375), (1.0, 1.0, 4.0, 0.075), *_HOW_CLOSELY[1:])
"""The same where demonstrations are mixed: landing may be steep between them (ours, on the zoo's
development tasks and V1 to V3; reproduction/docs/decisions-adapter.md). The first stays the most
probable one: first throws aim by it."""
_OF_EACH = 0.01
"""Share of the variance of offsets that is each demonstration's own (ours): who plays one again
gets its outcome, but for an execution's noise."""
_ANY_GAIN, _ANY_BEND = 0.8, 3.0
"""Where there is no symmetry: least sd of every entry of G, and how much more the law bends."""
_REMEMBERED = 4
"""Sets of aims whose anchors are remembered (ours): those of trials are asked for all the time."""


@dataclass(frozen=True, eq=False)
class Model:
    """What is believed of G, and of how the law bends."""

    name: str
    """`AS_STATED`, `OTHER_WAY` or `NONE`."""
    mean: Float[np.ndarray, "k k"]
    sd: Float[np.ndarray, "k k"]
    off: float
    """Factor of the sds of b and b_i."""
    bend: float
    """Factor of the sd of f."""
    between: float
    """Factor of the sd of F."""
    probability: float

    @property
    def signs(self) -> Float[np.ndarray, " k"]:
        """Of the diagonal of G."""
        return np.asarray(np.sign(np.diag(self.mean)))


class MovedPrior:
    """Means and covariances, in the chart, of where moved plans come down."""

    def __init__(self, demonstrations: Demonstrations) -> None:
        """Take the demonstrations, which carry a symmetry."""
        assert demonstrations.symmetry is not None
        self.symmetry = symmetry = demonstrations.symmetry
        self.anchors = Anchors(symmetry, demonstrations.outcomes_seen, demonstrations.outcome_noise)
        seen = demonstrations.outcomes_seen + demonstrations.outcome_correction
        self._off = symmetry.chart.to(seen) - self.anchors.z
        jacobian = symmetry.chart.jacobian(self.anchors.z).mean(axis=0)
        self.size: Point = np.linalg.norm(jacobian, axis=1)
        """Outcomes per unit of the chart, (k,)."""
        self.left: Int[np.ndarray, " s"] = self.anchors.left
        self.models = self._models()
        self._bases: dict[bytes, tuple[Points, Float[np.ndarray, "n N"]]] = {}

    def _models(self) -> tuple[Model, ...]:
        of = self.symmetry
        known = of.exact | of.learned
        every = itertools.product(*([1.0] if each else [1.0, -1.0] for each in known))
        signs = [np.array(each) for each in every][1:]
        stated = 1.0 - _P_NONE - (_P_OTHER_WAY if signs else 0.0)
        other = _P_OTHER_WAY / max(len(signs), 1)
        mean, sd = of.gain_mean, of.gain_sd
        anything = np.maximum(sd, _ANY_GAIN)
        return (
            *(
                Model(AS_STATED, mean, law * sd, off, law, between, p * stated)
                for law, off, between, p in (_IF_MIXED if self.anchors.mixed else _HOW_CLOSELY)
            ),
            *(Model(OTHER_WAY, mean * s, sd, 1.0, 1.0, 1.0, other) for s in signs),
            Model(NONE, mean, anything, 1.0, _ANY_BEND, 1.0, _P_NONE),
        )

    def base(self, aims: Points) -> tuple[Points, Float[np.ndarray, "n N"]]:
        """See `Anchors.base`."""
        key = aims.tobytes()
        if key not in self._bases:
            if len(self._bases) >= _REMEMBERED:
                self._bases.pop(next(iter(self._bases)))
            self._bases[key] = self.anchors.base(aims)
        return self._bases[key]

    def moved(self, aims: Points) -> Points:
        """By how much plans for these aims are moved: w, (n, k)."""
        return np.asarray(aims - self.base(aims)[0])

    def mean(self, model: Model, aims: Points) -> Points:
        """Where they come down, (n, k)."""
        base, weights = self.base(aims)
        return np.asarray(base + weights @ self._off + (aims - base) @ model.mean.T)

    def covariance(
        self, model: Model, a: Float[np.ndarray, "p k"], b: Points
    ) -> Float[np.ndarray, "k p n"]:
        """Of each component of z between aims; different components are independent."""
        of = self.symmetry
        (base_a, v_a), (base_b, v_b) = self.base(a), self.base(b)
        w_a, w_b = a - base_a, b - base_b
        counts = ~of.exact if len(self.left) else np.ones(of.k, dtype=bool)
        lengths = np.outer(*(np.linalg.norm(w * counts, axis=1) for w in (w_a, w_b)))
        bent = lengths * rbf(w_a * counts, w_b * counts, _REACH)
        between = np.zeros_like(bent)
        if self.anchors.mixed:
            at_a, at_b, known = (z[:, self.left] for z in (base_a, base_b, self.anchors.z))
            between = matern(at_a, at_b, _REACH) + v_a @ matern(known, known, _REACH) @ v_b.T
            between -= matern(at_a, known, _REACH) @ v_b.T + v_a @ matern(known, at_b, _REACH)
        common = (1.0 - _OF_EACH) + _OF_EACH * v_a @ v_b.T
        return np.stack(
            [
                (w_a * model.sd[j] ** 2) @ w_b.T
                + (model.off * of.offset_sd[j]) ** 2 * common
                + (v_a * self.anchors.sd[:, j] ** 2) @ v_b.T
                + (model.bend * of.bend_sd[j]) ** 2 * bent
                + (model.between * of.between_sd[j]) ** 2 * between
                for j in range(of.k)
            ]
        )
