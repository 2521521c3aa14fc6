"""Any generator, relieved of timing: it learns motions that all begin at the same frame.

Demonstrations of one throw start at different times. A generator that is asked for something
between two of them averages a swing that has begun with one that has not, which slows it: a throw
0.1 s too early and one 0.1 s too late average to one that lands 8 cm short
(docs/tasks/basketball.md). Two remedies, for every generator:

- `start`: every plan is cut out of its own resting ends, and the frame at which it starts becomes
  one more dimension of the plan, constant over it, which the generator learns with the motion.
  Whole frames are moved, so nothing is lost: plans come back as recorded. Ours; start time and
  duration are parameters of their own in movement primitives as well [Ijspeert2013]. Only where all
  demonstrations start and end at rest; else it learns whole plans, and `remarks` says why.
- `align`: the demonstrations are aligned first (`plans.alignment`), so that all generated plans
  start together (paper, "Timeline Aligned Variants").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.base import Generator, Report
from prior_reinforce.generators.saving import SavedModel, Tensors
from prior_reinforce.plans.alignment import align
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import CannotShiftError, Cut, cut_out, shift

Timing = Literal["start", "align"]
_START = "start"
"""Name of the dimension that says when a motion starts, in frames."""


class Timed(Generator):
    """A generator that learns when motions start apart from the motions, or learns aligned ones."""

    name: ClassVar[str] = "timed"

    def __init__(self, generator: Generator, timing: Timing = "start") -> None:
        """Wrap a generator.

        Args:
            generator: Learns the motions; it is fitted with this one.
            timing: `start` or `align`, see the module.

        Raises:
            ConfigurationError: There is no such timing, or the generator is timed already.
        """
        if timing not in get_args(Timing):
            raise ConfigurationError(f"timing must be one of {get_args(Timing)}, got {timing!r}")
        if isinstance(generator, Timed):
            raise ConfigurationError("this generator is timed already; wrap it once")
        self.generator = generator
        self.timing = timing
        self._horizon = 0
        self._starts: tuple[int, int] | None = None

    @property
    def starts(self) -> tuple[int, int] | None:
        """Earliest and latest frame at which a demonstration starts; None if not learned."""
        return self._starts

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: Report) -> None:
        self._horizon, self._starts = demonstrations.horizon, None
        if self.timing == "align":
            learned = align(demonstrations).demonstrations
        else:
            learned = self._started_together(demonstrations)
        self.generator.fit(learned, seed=seed, progress=progress)
        self.remarks = (*self.remarks, *self.generator.remarks)

    def _generate(self, conditions: Points) -> Plans:
        plans = self.generator.generate(conditions)
        if self._starts is None:
            return plans
        begins = np.clip(np.round(plans[:, 0, -1]), *self._starts).astype(int)
        return shift(plans[:, :, :-1], begins, self._horizon)

    def check_savable(self) -> None:
        """Do nothing if the wrapped generator can be saved; see `Generator.check_savable`."""
        self.generator.check_savable()

    def to(self, device: str) -> Self:
        """Compute on another device from now on; see `Generator.to`."""
        self.generator.to(device)
        return self

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """What the wrapped generator learned, and where motions start; see `Generator.state`."""
        inner = self.generator.pack()
        settings = {
            "timing": self.timing,
            "horizon": self._horizon,
            "starts": None if self._starts is None else list(self._starts),
            "generator": inner.generator,
            "settings": dict(inner.settings),
        }
        return settings, inner.tensors

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, kind: type[Generator] | None = None
    ) -> Self:
        """Rebuild it; see `Generator.from_state`.

        Args:
            settings: From `state`.
            tensors: From `state`.
            kind: Class of the wrapped generator, where it is not one of ours.
        """
        from prior_reinforce.generators import class_named

        inner = SavedModel(settings["generator"], settings["settings"], tensors)
        timed = cls((kind or class_named(inner.generator)).unpack(inner), settings["timing"])
        timed._horizon = int(settings["horizon"])
        if settings["starts"] is not None:
            earliest, latest = settings["starts"]
            timed._starts = int(earliest), int(latest)
        return timed

    @staticmethod
    def wrapped(saved: SavedModel) -> str:
        """Return the name of the generator within a saved one.

        Raises:
            FileFormatError: There is none.
        """
        try:
            return str(saved.settings["state"]["generator"])
        except (KeyError, TypeError) as error:
            raise FileFormatError(f"the model names no generator to time ({error!r})") from error

    def _started_together(self, demonstrations: Demonstrations) -> Demonstrations:
        """The motions alone, with their start as one more dimension; whole plans if that fails."""
        try:
            cut = _cut(demonstrations)
        except CannotShiftError as error:
            self.remarks = (
                "start times are not learned apart from the motion, which costs accuracy: "
                f"{error.reason}; record from rest to rest, with rest enough at both ends",
            )
            return demonstrations
        if cut is None:
            return demonstrations
        self._starts = int(cut.begins.min()), int(cut.begins.max())
        motions = cut.motions(demonstrations.plans)
        starts = np.broadcast_to(cut.begins[:, None, None], (*motions.shape[:2], 1))
        start = _unused_name(demonstrations.format.names)
        motion_format = replace(
            demonstrations.format,
            names=(*demonstrations.format.names, start),
            units=(*demonstrations.format.units, "frame"),
            per_plan=(*demonstrations.format.per_plan, start),
        )
        return demonstrations.with_plans(np.concatenate([motions, starts], axis=2), motion_format)


def _cut(demonstrations: Demonstrations) -> Cut | None:
    """Where motions are cut out; None where all start together."""
    delays = -np.round(align(demonstrations).shifts / demonstrations.format.dt).astype(int)
    return None if np.ptp(delays) == 0 else cut_out(demonstrations, delays)


def _unused_name(names: tuple[str, ...]) -> str:
    start = _START
    while start in names:
        start += "_"
    return start
