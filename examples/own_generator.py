"""A generator of one's own: the nearest demonstrations, blended in motion and in timing.

    python examples/own_generator.py
    PYTHONPATH=examples prior-reinforce reproduce zero-shot --include own_generator:SoftmaxBlend

    A(c, t) = sum_i w_i(c) A_i(t + s(c) - s_i),    s(c) = sum_i w_i(c) s_i

where s_i is how far demonstration i has to be moved for its motion to coincide with the others',
and w the softmax of minus the squared distance between c and the outcomes. So motions are blended
phase by phase, and the blend starts when its neighbours start. Prints the error of first throws,
next to plain interpolation between nearest neighbours.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from scipy.special import softmax
from typing_extensions import Self

from prior_reinforce.errors import FileFormatError, NotFittedError
from prior_reinforce.generators import (
    AlignmentConfig,
    FitProgress,
    Generator,
    NearestNeighbours,
    align,
)
from prior_reinforce.generators.conditions import as_conditions
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.tasks import make_task


@dataclass(frozen=True)
class SoftmaxBlendConfig:
    """How demonstrations are weighted."""

    neighbours: int = 4
    """How many of the nearest take part; all where there are fewer."""
    width: float = 0.4
    """Distance at which a weight has fallen by e, in demonstrated ranges of the outcomes."""


class SoftmaxBlend(Generator):
    """Softmax-weighted blend of demonstrations and of their onsets."""

    name: ClassVar[str] = "softmax-blend"

    def __init__(self, config: SoftmaxBlendConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or SoftmaxBlendConfig()
        self._known: dict[str, np.ndarray] | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Keep the demonstrations and how far each is shifted; nothing is random."""
        # Ends are held, whether they rest or not: a plan that ends in mid-swing is welcome.
        shifts = align(demonstrations, AlignmentConfig(largest_end_speed=1.0)).shifts
        self._known = {
            "plans": demonstrations.plans.copy(),
            "outcomes": demonstrations.outcomes_seen.copy(),
            "shifts": shifts / demonstrations.format.dt,  # [frames]
        }
        if progress is not None:
            progress(FitProgress(step=1, n_steps=1, loss=0.0, seconds_left=0.0))
        return self

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Blend, frames between recorded ones linearly."""
        known = self._fitted()
        plans, shifts = known["plans"], known["shifts"]
        conditions = as_conditions(conditions, known["outcomes"].shape[1])
        blended = np.zeros((len(conditions), *plans.shape[1:]))
        for blend, weights in zip(blended, self._weights(conditions), strict=True):
            for i in np.flatnonzero(weights):
                blend += weights[i] * _later(plans[i], shifts[i] - weights @ shifts)
        return blended

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        write_model(folder, self.name, asdict(self.config), self._fitted())

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(SoftmaxBlendConfig(**saved.settings))
            generator._known = {key: saved.tensors[key] for key in ("plans", "outcomes", "shifts")}
        except (KeyError, TypeError) as error:
            raise FileFormatError(f"{folder} is incomplete ({error}); learn it again") from error
        return generator

    def _weights(self, conditions: np.ndarray) -> np.ndarray:
        """w, shape (n, N): rows sum to one, all but the nearest are 0."""
        outcomes = self._fitted()["outcomes"]
        away = (conditions[:, None] - outcomes) / np.ptp(outcomes, axis=0) / self.config.width
        logits = -np.sum(away**2, axis=-1)
        order = np.argsort(-logits, axis=1, kind="stable")
        np.put_along_axis(logits, order[:, self.config.neighbours :], -np.inf, axis=1)
        return softmax(logits, axis=1)

    def _fitted(self) -> dict[str, np.ndarray]:
        if self._known is None:
            raise NotFittedError("this SoftmaxBlend has learned nothing yet; call fit first")
        return self._known


def _later(plan: np.ndarray, frames: float) -> np.ndarray:
    """The plan (H, D), moved later by a number of frames, its ends held."""
    clock = np.arange(len(plan))
    return np.stack([np.interp(clock - frames, clock, values) for values in plan.T], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = make_task("basketball-v1")
    demonstrations = task.demonstrations("A")
    goals = task.sample_goals(options.goals, np.random.default_rng(options.seed))
    for generator in (SoftmaxBlend(), NearestNeighbours()):
        generator.fit(demonstrations, seed=options.seed)
        rollouts = task.rollout(generator.generate(goals), None)
        errors = np.linalg.norm([r.outcome for r in rollouts] - goals, axis=1)
        print(
            f"{generator.name:<13}  first throws miss by {100 * np.median(errors):.1f} cm (median)"
        )


if __name__ == "__main__":
    main()
