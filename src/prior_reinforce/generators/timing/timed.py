"""Wrapper that separates timing from shape: a generator learns shapes and warps, not frames.

Demonstrations of one throw start at different times, and run at different tempos. Between two of
them, a generator averages a swing that has begun with one that has not, which slows it: a throw
0.1 s too early and one 0.1 s too late average to one that lands 8 cm short
(docs/tasks/basketball.md). Remedies, for every generator:

- `start`, `tempo`: plans are decomposed into shapes on a common phase and a few numbers each
  (`timeline`), which become constant dimensions of the plan that the generator learns with the
  shape. Nothing is lost: demonstrations are reproduced, or, if they have too few frames to be
  shifted, kept as recorded. Ours; movement primitives have parameters for start time and duration
  as well [Ijspeert2013].
- `auto`: the one of them, or none, that best predicts left-out outcomes (`evidence`);
  `remarks` says which, and why.
- `align`: the demonstrations are aligned first (`alignment`), so that all generated plans
  start together (paper, "Timeline Aligned Variants").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, ClassVar, Literal, get_args

import msgspec
import numpy as np
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.generators.timing.evidence import TOO_FEW_FRAMES, choose_timing
from prior_reinforce.generators.timing.timeline import Decomposition, Timeline, decompose
from prior_reinforce.plans.motions import Demonstrations

Timing = Literal["auto", "start", "tempo", "align"]


class Timed(Wrapper):
    """A generator that learns timing and motions separately, or learns aligned ones."""

    name: ClassVar[str] = "timed"
    timeline: Timeline | None = None
    """The common phase of what was learned; None before `fit`, and if plans are aligned."""

    def __init__(self, generator: Generator, timing: Timing = "auto") -> None:
        """Wrap a generator; the module describes each timing.

        ConfigurationError if there is no such timing, or the generator is timed already.
        """
        if timing not in get_args(Timing):
            raise ConfigurationError(f"timing must be one of {get_args(Timing)}, got {timing!r}")
        super().__init__(generator)
        self.timing = timing

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        self.timeline = None
        if self.timing == "align":
            learned = align(demonstrations).demonstrations
        else:
            decomposition = self._decomposed(demonstrations)
            self.timeline = decomposition.timeline
            learned = _as_plans(decomposition, demonstrations)
        self.generator.fit(learned, seed=seed, progress=progress)

    def _generate(self, conditions: Points) -> Plans:
        plans = self.generator.generate(conditions)
        if self.timeline is None:
            return plans
        n_channels = plans.shape[2] - self.timeline.n_numbers
        return self.timeline.reconstruct(plans[:, :, :n_channels], plans[:, 0, n_channels:])

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The common phase; see `Generator.state`."""
        timeline = None if self.timeline is None else asdict(self.timeline)
        return {"timing": self.timing, "timeline": timeline}, {}

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, generator: Generator | None = None
    ) -> Self:
        """Restore the common phase; see `Generator.from_state`."""
        made = super().from_state(settings, tensors, generator)
        made.timing = settings["timing"]
        made.timeline = msgspec.convert(settings["timeline"], Timeline | None)
        return made

    def _decomposed(self, demonstrations: Demonstrations) -> Decomposition:
        if self.timing == "auto":
            choice = choose_timing(demonstrations)
            self.remarks = (choice.reason,)
            return choice.decomposition
        assert self.timing != "align"
        decomposition = decompose(demonstrations, self.timing)
        if decomposition.timeline.kind != self.timing:
            self.remarks = (TOO_FEW_FRAMES.format(demonstrations.horizon),)
        return decomposition


def _as_plans(decomposition: Decomposition, demonstrations: Demonstrations) -> Demonstrations:
    """Return shapes as plans, with the numbers of their warps as further, constant dimensions."""
    names, units = decomposition.timeline.names(demonstrations.format)
    n_channels, length = decomposition.shapes.shape[2], decomposition.shapes.shape[1]
    shapes = decomposition.shapes.copy()
    for name in demonstrations.format.per_plan:  # resampling may change the last digit
        shapes[:, :, names.index(name)] = shapes[:, :1, names.index(name)]
    numbers = np.repeat(decomposition.numbers[:, None], length, axis=1)
    return demonstrations.with_plans(
        np.concatenate([shapes, numbers], axis=2),
        replace(
            demonstrations.format,
            names=names,
            units=units,
            per_plan=(*demonstrations.format.per_plan, *names[n_channels:]),
        ),
    )
