"""An adapter of your own: an affine correction, fitted to the trials by ridge regression.

    python examples/own_adapter.py
    PYTHONPATH=examples prior-reinforce adapt --adapter ridge --plugins own_adapter

What was asked for minus what came of it, c - r, is modelled as b + B z, where z is r in units of
the demonstrated spread. The penalty draws b and B towards 0, that is, towards c = r, which is what
the demonstrations say. Prints the share of goals reached, next to our adapters.
"""

from __future__ import annotations

import argparse

import numpy as np

import prior_reinforce as pr


class RidgeAdapter(pr.Adapter):
    """c = g + b + B z(g), with (b, B) the ridge solution over all trials so far."""

    def __init__(self, penalty: float = 0.1) -> None:
        """Choose how strongly the map is drawn to the identity, in normalised units squared."""
        self.penalty = penalty

    def _start(self, demonstrations: pr.Demonstrations) -> None:
        """Take the units of the demonstrations and forget all trials."""
        outcomes = demonstrations.outcomes_seen
        self._offset = outcomes.mean(axis=0)
        self._scale = np.sqrt(outcomes.var(axis=0).mean())  # all components are lengths
        self._trials: list[tuple[np.ndarray, np.ndarray]] = []

    def _propose(self, goal_seen: np.ndarray) -> np.ndarray:
        """Return the goal plus the correction fitted there, shape (k,)."""
        if not self._trials:
            return goal_seen
        conditions, outcomes = (self._units(a) for a in zip(*self._trials, strict=True))
        features = np.hstack([np.ones((len(outcomes), 1)), outcomes])  # (n, 1 + k)
        kernel = features @ features.T + self.penalty * np.eye(len(features))
        weights = features.T @ np.linalg.solve(kernel, conditions - outcomes)  # (1 + k, k)
        return goal_seen + self._scale * (np.append(1.0, self._units(goal_seen)) @ weights)

    def _observe(self, condition: np.ndarray, outcome_seen: np.ndarray) -> None:
        """Remember the trial."""
        self._trials.append((condition, outcome_seen))

    def _units(self, points: object) -> np.ndarray:
        return (np.array(points) - self._offset) / self._scale


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = pr.make_task("basketball-v3")  # learned on other hardware
    demonstrations = task.demonstrations("A")
    generator = pr.make_generator("interpolation,timing=align").fit(
        demonstrations, seed=options.seed
    )
    goals = task.sample_goals(options.goals, np.random.default_rng(options.seed))
    makers = {
        name: lambda name=name: pr.make_adapter(name) for name in ("frozen", "proportional", "gp")
    }
    for name, make in {"ridge": RidgeAdapter, **makers}.items():
        results = pr.run_goals(
            task,
            generator,
            make,
            pr.make_perception("amplified"),
            demonstrations,
            goals,
            rounds=options.rounds,
            seed=options.seed,
        )
        shares = " ".join(f"{share:4.0%}" for share in pr.success_by_round(results, options.rounds))
        print(f"{name:<12}  reached by trial 1, 2, ...: {shares}")


pr.ADAPTERS.add("ridge", RidgeAdapter)

if __name__ == "__main__":
    main()
