"""Any generator, made exact at its demonstrations.

A network comes back to its demonstrations to a milliradian or two, which moves a landing point by
centimetres. What it leaves there is known, so it is corrected in closed form: the residuals,
interpolated over outcomes, are added to what is generated.

    A(c) = pi(c) + sum_i w_i(c) (A_i - pi(r_i))

Ours. Where outcomes are coarse, the residuals are smoothed instead of interpolated: two
demonstrations of nearly one outcome must not make plans steep in the condition.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.generators.base import Generator, Report
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.generators.wrapping import Wrapper
from prior_reinforce.plans.channels import kinds
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights


class Corrected(Wrapper):
    """A generator whose plans at measured outcomes are the demonstrated ones.

    Switches are left as they were generated: between their values they have none.
    """

    name: ClassVar[str] = "corrected"
    _residuals: Plans
    _outcomes: Points
    _noise: Points

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: Report) -> None:
        self.generator.fit(demonstrations, seed=seed, progress=progress)
        self.remarks = self.generator.remarks
        self._outcomes = demonstrations.outcomes_seen.copy()
        self._noise = demonstrations.outcome_noise.copy()
        self._residuals = demonstrations.plans - self.generator.generate(self._outcomes)
        # A switch has no values between its own: it is right, or at another frame.
        found = kinds(demonstrations.plans, demonstrations.format.units)
        self._residuals[:, :, [kind == "switch" for kind in found]] = 0.0

    def _generate(self, conditions: Points) -> Plans:
        weights = smooth_weights(self._outcomes, noise=self._noise)(conditions)
        return self.generator.generate(conditions) + np.tensordot(weights, self._residuals, axes=1)

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The residuals; see `Generator.state`."""
        return {}, {
            "residuals": self._residuals,
            "outcomes": self._outcomes,
            "noise": self._noise,
        }

    @classmethod
    def _around(cls, generator: Generator, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        corrected = cls(generator)
        corrected._residuals, corrected._outcomes = tensors["residuals"], tensors["outcomes"]
        corrected._noise = tensors["noise"]
        if (
            corrected._residuals.ndim != 3
            or len(corrected._residuals) != len(corrected._outcomes)
            or corrected._noise.shape != corrected._outcomes.shape
        ):
            raise ValueError("residuals and outcomes do not fit")
        return corrected
