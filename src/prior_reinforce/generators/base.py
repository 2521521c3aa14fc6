"""The interface of pi: conditions in, whole action plans out (paper, Stage 1)."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.plans.motions import Demonstrations


@dataclass(frozen=True)
class FitProgress:
    """Where a fit stands, for a progress line."""

    step: int
    """Steps done."""
    n_steps: int
    """Steps in all."""
    loss: float
    """Running mean of the training loss [-]."""
    seconds_left: float
    """Estimated, in [s]."""


class Generator(ABC):
    """A conditional motion generator: an outcome that is wished for, a plan that may reach it.

    After `fit` it is a function: the same conditions give the same plans, whatever was generated
    before (docs/decisions.md says why the diffusion model samples with noise drawn once).
    """

    name: ClassVar[str]
    """Name on the command line, in results and in a saved model's `config.json`."""

    @abstractmethod
    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Learn outcome -> plan from all demonstrations (none is held out).

        Args:
            demonstrations: N plans (N, H, D) with their perceived outcomes (N, k).
            seed: Of everything random in the fit.
            progress: Called now and then while fitting.

        Returns:
            This generator, fitted.
        """

    @abstractmethod
    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Generate one plan for each condition.

        Args:
            conditions: c, shape (n, k), in the units of the outcomes. Any n, also 0.

        Returns:
            Plans, shape (n, H, D), float64, in the demonstrations' units.

        Raises:
            NotFittedError: Before `fit`.
            InvalidGoalError: Wrong shape, or not finite.
        """

    @abstractmethod
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors` into a folder, made if need be."""

    @classmethod
    @abstractmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; loading runs no code from the files.

        Raises:
            FileFormatError: Files are missing, truncated, or of another generator.
        """
