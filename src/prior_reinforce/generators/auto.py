"""The generator that demonstrations ask for: closed form, or a network where patterns are mixed.

One motion pattern is learned in closed form, in about a second: plans are mixed by a spline over
outcomes (`plans.outcome_weights`), timing apart (`timing_evidence`). Because the weights reproduce
affine functions, whatever else differs between demonstrations (posture, tempo, a second manner, an
outlier) cancels to first order, as long as outcomes were measured. Where demonstrations show
patterns that do not mix (`patterns`), the largest is learned if it is large enough, and the others
are named; else diffusion learns all of them, which keeps patterns apart. Ours; on which evidence,
docs/decisions-generator.md tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators.base import Generator, OnProgress
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.patterns import patterns
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.generators.timed import Timed
from prior_reinforce.generators.wrapping import Wrapper
from prior_reinforce.plans.motions import Demonstrations

_MORE_THAN_AFFINE = 2
"""A pattern is learned alone if it has k + 1 demonstrations and this many more. Ours: an affine
function of the outcome, and something to tell its bending by."""


class Auto(Wrapper):
    """Closed form or diffusion, with the timing and the pattern that demonstrations ask for."""

    name: ClassVar[str] = "auto"

    def __init__(
        self,
        generator: Generator | None = None,
        *,
        device: str = "cpu",
        threads: int = 1,
        states: Path | None = None,
    ) -> None:
        """Choose where a network would be trained, if one is needed.

        Args:
            generator: What was chosen, of a saved model; `fit` chooses anew.
            device: See `NetworkGenerator`.
            threads: See `NetworkGenerator`.
            states: See `NetworkGenerator`.
        """
        if generator is not None:
            super().__init__(generator)
        self._network: dict[str, Any] = {"device": device, "threads": threads, "states": states}

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        groups = patterns(demonstrations)
        largest, *others = groups
        learned = demonstrations if not others else None
        if others and len(largest) >= demonstrations.outcome_dim + 1 + _MORE_THAN_AFFINE:
            with suppress(InvalidDemonstrationsError):  # its outcomes may lie on a line
                learned = demonstrations.only(largest)
        if learned is None:
            self.generator = Timed(DiffusionGenerator(**self._network))
            learned = demonstrations
            remark = (
                f"generator: diffusion, since the demonstrations show {len(groups)} patterns that "
                f"do not mix: {'; '.join(map(_listed, groups))}"
            )
        else:
            self.generator = Timed(SmoothInterpolation())
            remark = "generator: closed form, since the demonstrations show one pattern"
            if others:
                remark = (
                    f"generator: closed form, of {len(largest)} demonstrations of one pattern; "
                    f"demonstrations {_listed(sum(others, ()))} move in another way, which does "
                    "not mix with it, and are left out: demonstrate those outcomes again, or "
                    "learn all with diffusion"
                )
        self.generator.fit(learned, seed=seed, progress=progress)
        self.remarks = (remark,)

    def _generate(self, conditions: Points) -> Plans:
        return self.generator.generate(conditions)

    def check_savable(self) -> None:
        """Do nothing: whatever is chosen can be saved; see `Generator.check_savable`."""

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """Nothing of its own; see `Generator.state`."""
        return {}, {}

    def restore(self, settings: Mapping[str, Any], tensors: Tensors) -> None:
        """Nothing to take up; see `Wrapper.restore`."""


def _listed(indices: tuple[int, ...]) -> str:
    """Numbers of demonstrations, counted from 1."""
    return ", ".join(str(i + 1) for i in indices)
