"""The generator that demonstrations ask for: closed form, or diffusion where patterns are mixed.

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
from prior_reinforce.generators.base import Generator, Report
from prior_reinforce.generators.corrected import Corrected
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
        super().__init__(generator or Timed(SmoothInterpolation()))
        self._network: dict[str, Any] = {"device": device, "threads": threads, "states": states}

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: Report) -> None:
        groups = patterns(demonstrations)
        largest, rest = groups[0], [i + 1 for group in groups[1:] for i in group]
        learned, remarks = demonstrations, []
        alone = None
        if len(largest) >= demonstrations.outcome_dim + 1 + _MORE_THAN_AFFINE:
            with suppress(InvalidDemonstrationsError):  # its outcomes may lie on a line
                alone = demonstrations.only(largest)
        if len(groups) == 1:
            self.generator = Timed(SmoothInterpolation())
            remarks.append("generator: closed form, since the demonstrations show one pattern")
        elif alone is not None:
            self.generator = Timed(SmoothInterpolation())
            learned = alone
            remarks.append(
                f"generator: closed form, of {len(largest)} demonstrations of one pattern; "
                f"demonstrations {_listed(rest)} move in another way, which does not mix with it, "
                "and are left out: demonstrate those outcomes again, or learn all with diffusion"
            )
        else:
            self.generator = Timed(Corrected(DiffusionGenerator(**self._network)))
            remarks.append(
                f"generator: diffusion, since the demonstrations show {len(groups)} patterns that "
                "do not mix: " + "; ".join(_listed([i + 1 for i in group]) for group in groups)
            )
        self.generator.fit(learned, seed=seed, progress=progress)
        self.remarks = tuple(remarks)

    def _generate(self, conditions: Points) -> Plans:
        return self.generator.generate(conditions)

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """Nothing of its own; see `Generator.state`."""
        return {}, {}

    def restore(self, settings: Mapping[str, Any], tensors: Tensors) -> None:
        """Nothing to take up; see `Wrapper.restore`."""


def _listed(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers))
