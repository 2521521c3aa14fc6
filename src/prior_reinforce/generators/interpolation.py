"""Smooth interpolation of plans over outcomes: the strongest way to mix demonstrations we know.

    A(c) = sum_i w_i(c) A_i,    w_i the cardinal weights of a polyharmonic spline, affine tail

Not in the paper; ours, because it asks how much of a generator's work is done by the assumption
that plans depend smoothly on outcomes. On aligned demonstrations it is hard to beat
(docs/baselines.md); on misaligned ones it blurs motions, as every frame-by-frame mixture does.

Notation:
    A_i  plans       (N, H, D)  in their units
    r_i  outcomes    (N, k)     in their units
    c    conditions  (n, k)     in the outcomes' units
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import ClassVar, get_args

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import as_conditions
from prior_reinforce.generators.outcome_weights import Kernel, smooth_weights
from prior_reinforce.generators.plan_memory import PlanMemory
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.motions import Demonstrations


@dataclass(frozen=True)
class SmoothInterpolationConfig:
    """How plans are interpolated; docs/baselines.md tells what was tried."""

    kernel: Kernel = "thin-plate"
    """Radial function: of least bending (`thin-plate`), or of distance itself (`linear`)."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: There is no such kernel.
        """
        if self.kernel not in get_args(Kernel):
            raise ConfigurationError(f"no kernel {self.kernel!r}; use one of {get_args(Kernel)}")


class SmoothInterpolation(Generator):
    """Polyharmonic-spline interpolation of plans over outcomes (ours)."""

    name: ClassVar[str] = "interpolation"

    def __init__(self, config: SmoothInterpolationConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or SmoothInterpolationConfig()
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
        """Mix all plans; at a demonstration's outcome its plan, to rounding."""
        memory = self._require()
        conditions = as_conditions(conditions, memory.outcomes.shape[1])
        return memory.mix(smooth_weights(conditions, memory.outcomes, kernel=self.config.kernel))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        write_model(folder, self.name, {"config": asdict(self.config)}, self._require().tensors())

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(SmoothInterpolationConfig(**saved.settings["config"]))
            generator._memory = PlanMemory.restore(saved.tensors)
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        return generator

    def _require(self) -> PlanMemory:
        if self._memory is None:
            raise NotFittedError("this SmoothInterpolation has learned nothing yet; call fit first")
        return self._memory
