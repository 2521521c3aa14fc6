"""Your own generator: the nearest demonstrations, blended in motion and in timing.

    python examples/own_generator.py
    PYTHONPATH=examples python -m reproduction zero-shot --plugins own_generator \
        --include softmax-blend

    A(c, t) = sum_i w_i(c) A_i(t + s(c) - s_i),    s(c) = sum_i w_i(c) s_i

where s_i is how far demonstration i has to be moved for its motion to coincide with the others',
and w the softmax of minus the squared distance between c and the outcomes. So motions are blended
phase by phase, and the blend starts when its neighbours start. Prints the error of first throws,
next to plain interpolation of all of them.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, dataclass

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

    name = "softmax-blend"
    config_type = SoftmaxBlendConfig

    def __init__(self, config: SoftmaxBlendConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or SoftmaxBlendConfig()

    def _fit(self, demonstrations, seed, progress):
        """Keep the demonstrations and how far each is shifted; nothing is random."""
        # Ends are held, whether they rest or not: a plan that ends in mid-swing is welcome.
        shifts = pr.align(demonstrations).shifts
        self.plans = demonstrations.plans.copy()
        self.outcomes = demonstrations.outcomes_seen.copy()
        self.shifts = shifts / demonstrations.format.dt  # [frames]
        progress(pr.FitProgress(step=1, n_steps=1, loss=0.0, seconds_left=0.0))

    def _generate(self, conditions):
        """Blend, frames between recorded ones linearly."""
        blended = np.zeros((len(conditions), *self.plans.shape[1:]))
        for blend, weights in zip(blended, self._weights(conditions), strict=True):
            for i in np.flatnonzero(weights):
                by = self.shifts[i] - weights @ self.shifts
                blend += weights[i] * _later(self.plans[i], by)
        return blended

    def state(self):
        """What is saved: settings, and arrays."""
        arrays = {"plans": self.plans, "outcomes": self.outcomes, "shifts": self.shifts}
        return asdict(self.config), arrays

    @classmethod
    def from_state(cls, settings, tensors):
        """The generator that was saved."""
        generator = cls(SoftmaxBlendConfig(**settings))
        generator.plans, generator.outcomes = tensors["plans"], tensors["outcomes"]
        generator.shifts = tensors["shifts"]
        return generator

    def _weights(self, conditions: np.ndarray) -> np.ndarray:
        """w, shape (n, N): rows sum to one, all but the nearest are 0."""
        away = (conditions[:, None] - self.outcomes) / np.ptp(self.outcomes, axis=0)
        logits = -np.sum((away / self.config.width) ** 2, axis=-1)
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
    for generator in (SoftmaxBlend(), pr.SmoothInterpolation()):
        generator.fit(demonstrations, seed=options.seed)
        rollouts = task.rollout(generator.generate(goals), None)
        errors = np.linalg.norm([r.outcome for r in rollouts] - goals, axis=1)
        print(
            f"{generator.name:<13}  first throws miss by {100 * np.median(errors):.1f} cm (median)"
        )


pr.GENERATORS.add("softmax-blend", SoftmaxBlend)

if __name__ == "__main__":
    main()
