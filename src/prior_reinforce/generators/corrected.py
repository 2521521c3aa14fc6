"""A closed-form spline, plus what a generator does between demonstrations.

A network misses its own demonstrations by a milliradian or two, which moves a landing point by
centimetres. What it misses there is known, so a spline over outcomes (`SmoothInterpolation`) is
fitted to it and added:

    A(c) = pi(c) + sum_i w_i(c) (A_i - pi(r_i))
         = sum_i w_i(c) A_i + [pi(c) - sum_i w_i(c) pi(r_i)]

Read the second line: at the demonstrations the plan is the spline's, whatever pi is, and between
them pi adds its deviation from the spline through its own plans. The weights w reproduce affine
functions, so whatever is affine in c cancels in the deviation. A corrected network that learned
nothing is therefore as good as closed form; how good a network is shows without correction only.

Ours. Where outcomes are coarse, the spline smooths instead of interpolating: two demonstrations of
nearly one outcome must not make plans steep in the condition.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.plans.motions import Demonstrations


class Corrected(Wrapper):
    """A generator whose plans at measured outcomes are the demonstrated ones.

    Switches are left as they were generated: between their values they have none.
    """

    name: ClassVar[str] = "corrected"

    def __init__(self, generator: Generator) -> None:
        """Wrap a generator; see `Wrapper`."""
        super().__init__(generator)
        self._residual = SmoothInterpolation()

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        self.generator.fit(demonstrations, seed=seed, progress=progress)
        missed = demonstrations.plans - self.generator.generate(demonstrations.outcomes_seen)
        # A switch has no values between its own: it is right, or at another frame.
        switches = [kind == "switch" for kind in demonstrations.signals.kinds]
        missed[:, :, switches] = 0.0
        without_numbers = replace(demonstrations.format, per_plan=())  # which may not be constant
        self._residual.fit(demonstrations.with_plans(missed, without_numbers), seed=seed)
        self.remarks = (
            "correction: a closed-form spline adds what is missed at the demonstrations, so plans "
            "are exact there whatever was learned",
        )

    def _generate(self, conditions: Points) -> Plans:
        return self.generator.generate(conditions) + self._residual.generate(conditions)

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The spline; see `Generator.state`."""
        return self._residual.state()

    def restore(self, settings: Mapping[str, Any], tensors: Tensors) -> None:
        """Take up the spline; see `Wrapper.restore`."""
        self._residual = SmoothInterpolation.from_state(settings, tensors)
        self._residual._outcome_dim = tensors["outcomes"].shape[1]
