"""I.N.N., interpolation of nearest neighbours: the paper's simplest baseline for pi.

    A(c) = sum_i w_i(c) A_i,    w_i proportional to |c - r_i|^-p over the m nearest outcomes

It mixes plans frame by frame, so demonstrations that begin their motion at different times give a
blur of two motions rather than one in between (see `alignment`).

Notation:
    A_i  plans       (N, H, D)  in their units
    r_i  outcomes    (N, k)     in their units
    c    conditions  (n, k)     in the outcomes' units
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import as_conditions
from prior_reinforce.generators.outcome_weights import inverse_distance_weights
from prior_reinforce.generators.plan_memory import PlanMemory
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.motions import Demonstrations


@dataclass(frozen=True)
class NearestNeighboursConfig:
    """How neighbours are weighted; docs/baselines.md tells what was tried."""

    neighbours: int = 3
    """m, how many of the nearest demonstrations take part; all where there are fewer."""
    power: float = 2.0
    """p, how fast a demonstration's weight falls with the distance of its outcome."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if self.neighbours < 1:
            raise ConfigurationError(f"neighbours must be at least 1, got {self.neighbours}")
        if not (math.isfinite(self.power) and self.power > 0):
            raise ConfigurationError(f"power must be a positive number, got {self.power}")


class NearestNeighbours(Generator):
    """Inverse-distance interpolation of the nearest plans (paper, "I.N.N.")."""

    name: ClassVar[str] = "nearest"

    def __init__(self, config: NearestNeighboursConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or NearestNeighboursConfig()
        self._memory: PlanMemory | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Keep the demonstrations; nothing is random and nothing takes time."""
        self._memory = PlanMemory.of(demonstrations)
        if progress is not None:
            progress(FitProgress(step=1, n_steps=1, loss=0.0, seconds_left=0.0))
        return self

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Mix the nearest plans; at a demonstration's outcome, exactly its plan."""
        memory = self._require()
        conditions = as_conditions(conditions, memory.outcomes.shape[1])
        weights = inverse_distance_weights(
            conditions,
            memory.outcomes,
            neighbours=self.config.neighbours,
            power=self.config.power,
        )
        return memory.mix(weights)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        write_model(folder, self.name, {"config": asdict(self.config)}, self._require().tensors())

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(NearestNeighboursConfig(**saved.settings["config"]))
            generator._memory = PlanMemory.restore(saved.tensors)
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        return generator

    def _require(self) -> PlanMemory:
        if self._memory is None:
            raise NotFittedError("this NearestNeighbours has learned nothing yet; call fit first")
        return self._memory
