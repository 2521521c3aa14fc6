"""A perception of your own: a camera above the table, calibrated for the table and nothing higher.

    python examples/own_perception.py
    PYTHONPATH=examples prior-reinforce adapt --perception overhead --plugins own_perception

The ball is seen above the table, so the camera takes it to be farther from the point below the lens
than it is: by height / (height - ball_height). The goal lies on the table and is seen where it is.
Prints how large that bias is, and what it costs: an adapter cannot undo what it cannot see.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

import numpy as np

import prior_reinforce as pr


@dataclass(frozen=True)
class OverheadCamera(pr.Perception):
    """The first two components of the error with parallax and pixel noise, the others exact."""

    below: tuple[float, float] = (0.75, 0.0)
    """The point of the table below the lens, x and y in [m]."""
    height: float = 1.5
    """Of the lens above the table, in [m]."""
    ball_height: float = 0.10
    """At which the ball is seen, in [m]; Basketball Shot's rim is 10 cm above the table."""
    noise_sd: float = 0.002
    """Standard deviation of a reading, in [m]: about a pixel."""
    field: float = 1.5
    """Radius of what the camera sees of the table, in [m]."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: The ball is not between the table and the lens.
        """
        if not 0 <= self.ball_height < self.height < math.inf:
            raise pr.ConfigurationError(
                f"ball_height must be at least 0 m and below the lens, got {self.ball_height} m "
                f"under a lens at {self.height} m; measure both from the table"
            )

    def perceive(
        self, rollout: pr.Rollout, goal: np.ndarray, rng: np.random.Generator
    ) -> pr.Reading:
        """Return where the ball seems to be, minus the goal, in [m]."""
        seen = np.array(rollout.outcome, dtype=float)
        below = np.array(self.below[: len(seen)])
        flat = slice(len(below))
        seen[flat] = below + (seen[flat] - below) * self.height / (self.height - self.ball_height)
        if np.linalg.norm(seen[flat] - below) > self.field:
            raise pr.PerceptionFailedError(
                f"the ball is out of the picture, more than {self.field} m from {self.below}; "
                "look yourself"
            )
        seen[flat] += rng.normal(0.0, self.noise_sd, len(below))
        return pr.Reading.measured(seen - goal, self.noise_sd)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = pr.make_task("basketball-v1")
    for x, y in task.region:
        hit = pr.Rollout(outcome=np.array([x, y]), valid=True)
        bias = OverheadCamera(noise_sd=0.0).perceive(hit, hit.outcome, np.random.default_rng(0))
        bias = bias.error_seen
        print(f"a hit at ({x:.2f}, {y:.2f}) m seems to be {100 * np.linalg.norm(bias):.1f} cm off")

    demonstrations = task.demonstrations("A")
    generator = pr.make_generator("interpolation,timing=align").fit(
        demonstrations, seed=options.seed
    )
    goals = task.sample_goals(options.goals, np.random.default_rng(options.seed))
    table = OverheadCamera(ball_height=0.0)  # the same camera, calibrated at the ball's height
    for label, perception in (
        ("exact", pr.Exact()), ("calibrated", table), ("biased", OverheadCamera()),
    ):  # fmt: skip
        results = pr.run_goals(
            task,
            generator,
            pr.GaussianProcessAdapter,
            perception,
            demonstrations,
            goals,
            rounds=options.rounds,
            seed=options.seed,
        )
        shares = " ".join(f"{share:4.0%}" for share in pr.success_by_round(results, options.rounds))
        print(f"{label:<10}  reached by trial 1, 2, ...: {shares}")


pr.PERCEPTIONS.add("overhead", OverheadCamera)

if __name__ == "__main__":
    main()
