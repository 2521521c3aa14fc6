"""A task of your own, without a simulator: a catapult on a turntable, flight in closed form.

    python examples/own_task.py
    PYTHONPATH=examples prior-reinforce adapt --plugins own_task --task toss

A plan turns the turntable and swings the arm; where the arm passes its stop, the ball leaves it and
flies on a parabola. The script prints how many throws new goals take; the command goes through the
trials of one goal and writes their report.

Notation:
    psi    `turn`    angle of the turntable, to the left            [rad]
    theta  `swing`   angle of the arm from the vertical, forwards   [rad]
    r      outcome   where the ball comes down on the table: x, y   [m], table frame
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.interpolate import CubicSpline

import prior_reinforce as pr

GRAVITY = 9.81  # [m/s^2]
ARM = 0.6  # Length, in [m].
PIVOT = 0.3  # Height of the arm's axis above the table, in [m].
STOP = -0.5  # theta at which the ball leaves, in [rad]: it rises at 29 degrees.
BACK, FORTH = -1.2, 0.4  # theta at rest before and after a demonstrated swing, in [rad].
AIM_SD = 0.003  # Disturbance of psi, in [rad].
SPEED_SD = 0.003  # Relative disturbance of the speed at the stop.
HORIZON = 40  # Frames of a demonstration.
# Swing time [s] and psi [rad] of each demonstration: the region's corners, and two inside.
SHOWN = ((0.67, -0.31), (0.67, 0.31), (0.56, -0.22), (0.56, 0.22), (0.63, 0.05), (0.59, -0.06))


@dataclass(frozen=True)
class Flight:
    """The ball from the stop to the table."""

    start: np.ndarray
    """Where it leaves the arm, shape (3,), in [m]."""
    velocity: np.ndarray
    """With what velocity, shape (3,), in [m/s]."""

    @property
    def duration(self) -> float:
        """Until it comes down to z = 0, in [s]."""
        up = self.velocity[2]
        return float((up + np.sqrt(up**2 + 2 * GRAVITY * self.start[2])) / GRAVITY)

    def at(self, time: float) -> np.ndarray:
        """Place after `time` [s], shape (3,), in [m]."""
        return self.start + self.velocity * time - [0.0, 0.0, GRAVITY * time**2 / 2]


class Toss(pr.Task):
    """Throw a ball onto a spot of the table."""

    name: ClassVar[str] = "toss"
    format: ClassVar[pr.PlanFormat] = pr.PlanFormat(("turn", "swing"), ("rad", "rad"), 0.02)
    tolerance: ClassVar[float] = 0.015  # As in Basketball Shot.
    region: ClassVar[np.ndarray] = np.array([[0.95, -0.25], [1.30, 0.25]])
    demonstration_sets: ClassVar[tuple[str, ...]] = ("A",)

    def rollout(self, plans: np.ndarray, rng: np.random.Generator | None) -> list[pr.Rollout]:
        """Throw; a ball that stays on the arm counts as lost at the axis, (0, 0)."""
        rollouts = []
        for plan in plans:
            flight = self._release(plan, rng)
            lost = pr.Rollout(outcome=np.zeros(2), valid=False)
            rollouts.append(pr.Rollout(flight.at(flight.duration)[:2], True) if flight else lost)
        return rollouts

    def demonstrations(self, name: str) -> pr.Demonstrations:
        """Swing as in `SHOWN`, the outcomes seen without error."""
        if name not in self.demonstration_sets:
            raise pr.ConfigurationError(f"{self.name} has no demonstration set {name!r}; use A")
        swing_times, turns = np.array(SHOWN).T[:, :, None]
        times = np.arange(HORIZON) * self.format.dt
        share = np.clip(times / swing_times, 0.0, 1.0)
        swings = BACK + (FORTH - BACK) * share**3 * (10 - 15 * share + 6 * share**2)  # least jerk
        plans = np.stack([np.broadcast_to(turns, swings.shape), swings], axis=-1)
        return pr.Demonstrations(plans, [r.outcome for r in self.rollout(plans, None)], self.format)

    def film(
        self,
        plan: np.ndarray,
        goal: np.ndarray,
        rng: np.random.Generator | None = None,
        *,
        width: int = 640,
        height: int = 480,
        frames_per_second: int = 30,
        camera: str = "film",
    ) -> Iterator[np.ndarray]:
        """Draw the ball (orange) and the goal (blue) from the side, or from above as `birdseye`."""
        flight = self._release(plan, rng)
        across = 1 if camera == "birdseye" else 2
        metres = 2.0 / width  # a pixel
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        along = (columns + 0.5) * metres - 0.5
        middle = 0.0 if across == 1 else height * metres / 2 - 0.1
        beside = middle + (height / 2 - rows - 0.5) * metres
        background = np.full((height, width, 3), 245, dtype=np.uint8)
        mark = np.append(goal, 0.0)
        background[np.hypot(along - mark[0], beside - mark[across]) < 0.03] = (50, 90, 200)
        for i in range(int((flight.duration if flight else 0.0) * frames_per_second) + 1):
            picture = background.copy()
            ball = flight.at(i / frames_per_second) if flight else np.zeros(3)
            picture[np.hypot(along - ball[0], beside - ball[across]) < 0.02] = (230, 120, 20)
            yield picture

    def _release(self, plan: np.ndarray, rng: np.random.Generator | None) -> Flight | None:
        plan = pr.Plan(plan, self.format).actions  # checks its shape, and that it is finite
        path = CubicSpline(np.arange(len(plan)) * self.format.dt, plan)
        passes = CubicSpline(path.x, plan[:, 1]).solve(STOP, extrapolate=False)
        passes = [time for time in passes if path(time, 1)[1] > 0]
        if not passes:
            return None
        (turn, theta), (turning, speed) = path(passes[0]), path(passes[0], 1)
        if rng is not None:
            turn += rng.normal(0.0, AIM_SD)
            speed *= 1.0 + rng.normal(0.0, SPEED_SD)
        ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
        left, up = np.array([-ahead[1], ahead[0], 0.0]), np.array([0.0, 0.0, 1.0])
        reach = ARM * np.sin(theta)
        start = reach * ahead + (PIVOT + ARM * np.cos(theta)) * up
        swinging = ARM * speed * (np.cos(theta) * ahead - np.sin(theta) * up)
        return Flight(start, swinging + reach * turning * left)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    task = Toss()
    demonstrations = task.demonstrations("A")
    results = pr.run_goals(
        task,
        pr.make_generator("interpolation").fit(demonstrations, seed=options.seed),
        pr.GaussianProcessAdapter,
        pr.Eye(),
        demonstrations,
        task.sample_goals(options.goals, np.random.default_rng(options.seed)),
        rounds=options.rounds,
        seed=options.seed,
    )
    for number, share in enumerate(pr.success_by_round(results, options.rounds), start=1):
        print(f"reached in at most {number} throws: {share:4.0%}")


pr.TASKS.add("toss", Toss)

if __name__ == "__main__":
    main()
