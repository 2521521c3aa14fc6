"""The generator that demonstrations ask for: closed form, or a network where patterns are mixed.

One motion pattern is learned in closed form, in about a second: plans are mixed by a spline over
outcomes (`plans.outcome_weights`), timing apart (`timing_evidence`). Because the weights reproduce
affine functions, whatever else differs between demonstrations (posture, tempo, a second manner, an
outlier) cancels to first order, as long as outcomes were measured. Where demonstrations show
patterns that do not mix (`patterns`), each that is large enough is learned so, a plan is of the one
with the nearest outcome, and others are left out and named; where none is, a network learns all of
them. Ours; on which evidence, reproduction/docs/decisions-generator.md tells.
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
"""A pattern is learned alone if it has k + 1 demonstrations and this many more. Ours: an affine
function of the outcome, and something to tell its bending by; 4 a way hit 0.81 to 0.86 of first
throws on `zoo.SEVERAL_WAYS` (tuning goals)."""

_TIMING_TOLD_BY = 4
"""So many demonstrations tell their timing by leaving one out (ours); of fewer the rest is too
little to learn from."""


class Auto(Wrapper):
    """Closed form or diffusion, with the timing and the pattern that demonstrations ask for."""

    name: ClassVar[str] = "auto"

    def __init__(
        self,
        generator: Generator | None = None,
        *,
        device: str = "cpu",
        threads: int = 1,
    ) -> None:
        """Choose where a network would be trained, if one is needed (see `NetworkGenerator`).

        `generator` is what was chosen, of a saved model; `fit` chooses anew.
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
            # Fewer cannot tell which timing predicts the others' outcomes best.
            timing: Timing = "auto" if demonstrations.n >= _TIMING_TOLD_BY else "align"
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
        """Whether a pattern has demonstrations enough, and outcomes that are not on a line."""
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
