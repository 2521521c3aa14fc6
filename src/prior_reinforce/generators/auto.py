"""Choose the generator by the demonstrations: closed form, or a network if patterns are mixed.

One motion pattern is learned in closed form, in about a second: plans are mixed by a spline over
outcomes (`plans.outcome_weights`), separately from timing (`timing.evidence`). Because the weights
reproduce affine functions, other differences between demonstrations (posture, tempo, a second
manner, an outlier) cancel to first order, as long as outcomes were measured. If demonstrations show
patterns that do not mix (`patterns`), each large enough pattern is learned so, a plan is of the one
with the nearest outcome, and the others are left out and named; if none is large enough, a network
learns all of them. Ours; reproduction/docs/decisions-generator.md gives the evidence.
"""

from __future__ import annotations

from typing import Any, ClassVar

from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points, say_flat
from prior_reinforce.errors import InvalidDemonstrationsError, warn_caller
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper
from prior_reinforce.generators.interpolation import SmoothInterpolation, SmoothInterpolationConfig
from prior_reinforce.generators.members import GENERATORS
from prior_reinforce.generators.patterns import patterns
from prior_reinforce.generators.timing.timed import Timed, Timing
from prior_reinforce.plans.motions import Demonstrations

_MORE_THAN_AFFINE = 1
"""A pattern is learned alone if it has k + 1 demonstrations and this many more. Ours: they
determine an affine function of the outcome, and some of its curvature; 4 a way hit 0.81 to 0.86 of
first throws on `zoo.SEVERAL_WAYS` (tuning goals)."""

_FEWEST_FOR_TIMING = 4
"""Fewest demonstrations whose timing is chosen by leaving one out (ours); of fewer, too few are
left to learn from."""


class Auto(Wrapper):
    """Closed form or diffusion, with timing and patterns chosen by the demonstrations."""

    name: ClassVar[str] = "auto"

    def __init__(
        self,
        generator: Generator | None = None,
        *,
        device: str = "cpu",
        threads: int = 1,
    ) -> None:
        """Choose the device of a network, if one is needed (see `NetworkGenerator`).

        `generator` is the chosen one of a saved model; `fit` chooses anew.
        """
        super().__init__(generator or Timed(SmoothInterpolation()))
        self._network: dict[str, Any] = {"device": device, "threads": threads}

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        if flat := say_flat(demonstrations.outcomes_seen):
            warn_caller(flat)
        groups = patterns(demonstrations)
        ways = [group for group in groups if self._stands_alone(demonstrations, group)]
        left_out = sorted(set(range(demonstrations.n)) - {i for way in ways for i in way})
        learned = demonstrations
        if len(groups) == 1:
            timing: Timing = "auto" if demonstrations.n >= _FEWEST_FOR_TIMING else "align"
            self.generator = Timed(SmoothInterpolation(), timing)
            remark = "generator: closed form, since the demonstrations show one pattern"
        elif not ways:
            self.generator = GENERATORS.make("diffusion,symmetry=none", **self._network)
            remark = (
                f"generator: diffusion, since the demonstrations show {len(groups)} patterns that "
                f"do not mix: {'; '.join(map(_listed, groups))}"
            )
        else:
            kept = sorted(i for way in ways for i in way)
            learned = demonstrations.only(tuple(kept))
            places = tuple(tuple(map(kept.index, way)) for way in ways) if len(ways) > 1 else ()
            self.generator = Timed(SmoothInterpolation(SmoothInterpolationConfig(ways=places)))
            remark = (
                "generator: closed form, of demonstrations of one pattern"
                if len(ways) == 1
                else f"generator: closed form within each of {len(ways)} patterns that do not mix, "
                f"the one with the nearest outcome: {'; '.join(map(_listed, ways))}"
            )
            if left_out:
                remark += (
                    f"; demonstrations {_listed(tuple(left_out))} move in another way, which does "
                    "not mix with it, and are left out: demonstrate those outcomes again"
                )
        self.generator.fit(learned, seed=seed, progress=progress)
        self.remarks = (remark,)

    def _stands_alone(self, demonstrations: Demonstrations, group: tuple[int, ...]) -> bool:
        """Whether a pattern has enough demonstrations, and outcomes that are not on a line."""
        if len(group) < demonstrations.outcome_dim + 1 + _MORE_THAN_AFFINE:
            return False
        try:
            demonstrations.only(group)
        except InvalidDemonstrationsError:
            return False
        return True

    def _generate(self, conditions: Points) -> Plans:
        return self.generator.generate(conditions)

    def to(self, device: str) -> Self:
        """Compute on another device from now on, and train a network there; see `Generator.to`."""
        self._network["device"] = device
        return self if self._outcome_dim is None else super().to(device)

    def check_savable(self) -> None:
        """Do nothing: whatever is chosen can be saved; see `Generator.check_savable`."""


def _listed(indices: tuple[int, ...]) -> str:
    """Numbers of demonstrations, counted from 1."""
    return ", ".join(str(i + 1) for i in indices)
