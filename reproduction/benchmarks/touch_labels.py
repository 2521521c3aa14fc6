"""Trials to a new goal with labels touched in a calibrated picture, beside the same by eye.

    python reproduction/benchmarks/touch_labels.py [--goals 20] [--seed 0]

Basketball V1 and curling, set A, `auto` and `bayes`, contact physics. By touch, a camera above the
table (1280 x 720, oblique) was calibrated by touching six known points, and every demonstration and
every trial is touched in its picture; each touch is off by PIXELS in each direction, one standard
deviation. What is told is what the console tells: the place through the calibrated homography, with
the larger of the calibration's residual and a camera's 3 mm as its standard deviation. By eye,
demonstrations and trials are rounded as the paper's observer does (`perception.eye`). Hits are
judged by the true outcome.
"""

from __future__ import annotations

import argparse

import numpy as np

from prior_reinforce.adapters import make_adapter
from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.generators import make_generator
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.calibration import CAMERA_SD, TableCalibration
from prior_reinforce.perception.eye import Eye
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.protocol import (
    GoalTrials,
    perceive_demonstrations,
    run_goals,
    run_sequences,
)
from prior_reinforce.simulation.tasks import make_task

PIXELS = 2.0
"""A finger that drags a mark with a cross, on a picture as wide as a tablet (ours); the console's
own error is below half a pixel."""
ROUNDS = 10


class Touch(Perception):
    """An operator who touches where the object is, in the picture of a calibrated camera."""

    def __init__(self, task: Task, rng: np.random.Generator) -> None:
        """Set up the camera: the table's region fills most of an oblique picture; calibrate it."""
        (a, b), (c, d) = task.region.min(axis=0) - 0.1, task.region.max(axis=0) + 0.1
        corners = [(a, d), (a, b), (c, b), (c, d)]
        seen = [(140, 690), (1150, 700), (960, 60), (330, 55)]
        self._camera = TableCalibration.fit(corners, seen)
        middle = (b + d) / 2
        known = [*corners[:2], (a, middle), *corners[2:], (c, middle)]
        touched = self._camera.to_pixels(known)
        touched = touched + rng.normal(0.0, PIXELS, touched.shape)
        self._calibrated = TableCalibration.fit(known, touched)
        self.sd = max(CAMERA_SD, self._calibrated.left_out_error or 0.0)

    def place(self, outcome: Point, rng: np.random.Generator) -> Point:
        """Where a touch says that an object is."""
        pixel = self._camera.to_pixels(outcome) + rng.normal(0.0, PIXELS, 2)
        return self._calibrated.to_table(pixel)

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        return Reading.measured(self.place(rollout.outcome, rng) - goal, self.sd)


def say(results: list[GoalTrials]) -> str:
    trials = np.array([result.solved_at or ROUNDS for result in results])
    missed = sum(result.solved_at is None for result in results)
    error = trials.std(ddof=1) / np.sqrt(len(trials))
    first = np.mean(trials == 1)
    return f"{trials.mean():.2f} +- {error:.2f} | {first:.2f} | {missed}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print("| task | labels | labels off, rms | goals | trials a goal | first throws | missed |")
    print("|---|---|---|---|---|---|---|")
    for name in ("basketball-v1", "curling"):
        task = make_task(name)
        recorded = task.demonstrations("A")
        rng = np.random.default_rng(arguments.seed)
        goals = task.sample_goals(arguments.goals, rng)
        for label, perception in (("by eye", Eye()), ("by touch", Touch(task, rng))):
            seen = perceive_demonstrations(task, recorded, perception, seed=arguments.seed)
            off = np.linalg.norm(seen.outcomes_seen - recorded.outcomes_seen, axis=1)
            generator = make_generator("auto").fit(seen, seed=arguments.seed)
            given = (task, generator, lambda: make_adapter("bayes"), perception, seen)
            alone = run_goals(*given, goals, rounds=ROUNDS, seed=arguments.seed)
            afternoons = goals.reshape(-1, 4, goals.shape[1])
            carried = run_sequences(
                *given, afternoons, carry_over=True, rounds=ROUNDS, seed=arguments.seed
            )
            rms = f"{100 * np.sqrt(np.mean(off**2)):.1f} cm"
            print(f"| {name} | {label} | {rms} | each alone | {say(alone)} |", flush=True)
            together = [result for results in carried for result in results]
            print(f"| {name} | {label} | {rms} | afternoons of 4 | {say(together)} |", flush=True)


if __name__ == "__main__":
    main()
