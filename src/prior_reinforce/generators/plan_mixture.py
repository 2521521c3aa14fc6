"""Generators that keep the demonstrations and mix them: what they share.

    A(c) = sum_i w_i(c) A_i

A member says what the weights are; see `nearest.py` and `interpolation.py`.

Notation:
    A_i  plans       (N, H, D)  in their units
    r_i  outcomes    (N, k)     in their units
    c    conditions  (n, k)     in the outcomes' units
"""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import as_conditions
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.plans.motions import Demonstrations


class PlanMixture(Generator):
    """Weighted sums of the demonstrated plans, frame by frame."""

    config_type: ClassVar[Callable[..., Any]]
    """Frozen dataclass of the member's settings."""

    def __init__(self, config: Any) -> None:
        """Keep the settings, one of `config_type`."""
        self.config = config
        self._learned: tuple[np.ndarray, np.ndarray] | None = None

    @abstractmethod
    def weights(self, conditions: np.ndarray, outcomes: np.ndarray) -> np.ndarray:
        """How much of each plan goes into the plan for each condition.

        Args:
            conditions: c, shape (n, k), finite.
            outcomes: r_i, shape (N, k).

        Returns:
            w, shape (n, N).
        """

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Keep the demonstrations; nothing is random and nothing takes time."""
        self._learned = demonstrations.plans.copy(), demonstrations.outcomes_seen.copy()
        if progress is not None:
            progress(FitProgress(step=1, n_steps=1, loss=0.0, seconds_left=0.0))
        return self

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Mix the plans; see `Generator.generate`."""
        plans, outcomes = self._require()
        conditions = as_conditions(conditions, outcomes.shape[1])
        mixed: np.ndarray = np.tensordot(self.weights(conditions, outcomes), plans, axes=1)
        return mixed

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        plans, outcomes = self._require()
        tensors = {"plans": plans, "outcomes": outcomes}
        write_model(folder, self.name, {"config": asdict(self.config)}, tensors)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(cls.config_type(**saved.settings["config"]))
            plans, outcomes = saved.tensors["plans"], saved.tensors["outcomes"]
            if plans.ndim != 3 or outcomes.ndim != 2 or len(plans) != len(outcomes):
                raise ValueError(f"plans {plans.shape} and outcomes {outcomes.shape} do not fit")
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        generator._learned = plans, outcomes
        return generator

    def _require(self) -> tuple[np.ndarray, np.ndarray]:
        """The plans and outcomes that were learned."""
        if self._learned is None:
            raise NotFittedError(
                f"this {type(self).__name__} has learned nothing yet; call fit first"
            )
        return self._learned
