"""A generator of your own: the nearest demonstrations, blended in motion and in timing.

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
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.special import softmax

import prior_reinforce as pr


@dataclass(frozen=True)
class SoftmaxBlendConfig:
    """How demonstrations are weighted."""

    neighbours: int = 4
    """How many of the nearest take part; all where there are fewer."""
    width: float = 0.4
    """Distance at which a weight has fallen by e, in demonstrated ranges of the outcomes."""


class SoftmaxBlend(pr.Generator):
    """Softmax-weighted blend of demonstrations and of their onsets."""

    name: ClassVar[str] = "softmax-blend"
    config_type: ClassVar[type[SoftmaxBlendConfig]] = SoftmaxBlendConfig

    def __init__(self, config: SoftmaxBlendConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or SoftmaxBlendConfig()

    def _fit(
        self,
        demonstrations: pr.Demonstrations,
        seed: int,
        progress: Callable[[pr.FitProgress], None],
    ) -> None:
        """Keep the demonstrations and how far each is shifted; nothing is random."""
        # Ends are held, whether they rest or not: a plan that ends in mid-swing is welcome.
        shifts = pr.align(demonstrations, pr.AlignmentConfig(largest_end_speed=1.0)).shifts
        self._plans = demonstrations.plans.copy()
        self._outcomes = demonstrations.outcomes_seen.copy()
        self._shifts = shifts / demonstrations.format.dt  # [frames]

    def _generate(self, conditions: np.ndarray) -> np.ndarray:
        """Blend, frames between recorded ones linearly."""
        blended = np.zeros((len(conditions), *self._plans.shape[1:]))
        for blend, weights in zip(blended, self._weights(conditions), strict=True):
            for i in np.flatnonzero(weights):
                blend += weights[i] * _later(
                    self._plans[i], self._shifts[i] - weights @ self._shifts
                )
        return blended

    def state(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Settings and arrays, for `save`."""
        tensors = {"plans": self._plans, "outcomes": self._outcomes, "shifts": self._shifts}
        return asdict(self.config), tensors

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Mapping[str, np.ndarray]
    ) -> SoftmaxBlend:
        """Rebuild it from what `state` gave, for `load`."""
        config = SoftmaxBlendConfig(settings["neighbours"], settings["width"])
        generator = cls(config)
        generator._plans = tensors["plans"]
        generator._outcomes = tensors["outcomes"]
        generator._shifts = tensors["shifts"]
        return generator

    def _weights(self, conditions: np.ndarray) -> np.ndarray:
        """w, shape (n, N): rows sum to one, all but the nearest are 0."""
        outcomes = self._outcomes
        away = (conditions[:, None] - outcomes) / np.ptp(outcomes, axis=0) / self.config.width
        logits = -np.sum(away**2, axis=-1)
        order = np.argsort(-logits, axis=1, kind="stable")
        np.put_along_axis(logits, order[:, self.config.neighbours :], -np.inf, axis=1)
        return softmax(logits, axis=1)


def _later(plan: np.ndarray, frames: float) -> np.ndarray:
    """The plan (H, D), moved later by a number of frames, its ends held."""
    clock = np.arange(len(plan))
    return np.stack([np.interp(clock - frames, clock, values) for values in plan.T], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = pr.make_task("basketball-v1")
    demonstrations = task.demonstrations("A")
    goals = task.sample_goals(options.goals, np.random.default_rng(options.seed))
    for generator in (SoftmaxBlend(), pr.make_generator("nearest")):
        generator.fit(demonstrations, seed=options.seed)
        rollouts = task.rollout(generator.generate(goals), None)
        errors = np.linalg.norm([r.outcome for r in rollouts] - goals, axis=1)
        print(
            f"{generator.name:<13}  first throws miss by {100 * np.median(errors):.1f} cm (median)"
        )


if __name__ == "__main__":
    main()
