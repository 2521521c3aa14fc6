"""A closed-form world for reports: a generator that says its condition, an outcome that is bent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.report import AdaptationRecord
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Stage, Trial

HORIZON = 60
DT = 0.02


def motion(conditions: np.ndarray, action_dim: int) -> np.ndarray:
    """Plans (n, H, D): a smooth swing of each joint, as large as the condition says."""
    phase = np.linspace(0, np.pi, HORIZON)[:, None]
    joints = np.arange(action_dim)
    size = conditions.sum(axis=1)[:, None, None] + conditions[:, :1, None] * joints / 4
    return size * np.sin(phase * (1 + joints / 5) + joints / 3) * np.cos(phase / 2)


class Swing(Generator):
    """A generator whose plans say their condition."""

    name = "swing"

    def __init__(self, action_dim: int) -> None:
        self.action_dim = action_dim

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        return motion(conditions, self.action_dim)

    def _fit(self, demonstrations, seed, progress):
        raise NotImplementedError

    _generate = _fit


class FullStep(Adapter):
    """An adapter that subtracts the whole last error."""

    def _start(self, demonstrations):
        self.last = None

    def _propose(self, goal_seen):
        return goal_seen if self.last is None else self.last - (self.seen - goal_seen)

    def _observe(self, condition, outcome_seen):
        self.last, self.seen = condition, outcome_seen


def demonstrations(k: int = 2, action_dim: int = 7, units: tuple[str, ...] = ("m", "m")):
    rng = np.random.default_rng(8)
    low = np.array([0.82, -0.28, 0.30])[:k]
    high = np.array([1.06, 0.28, 0.70])[:k]
    outcomes = rng.uniform(low, high, size=(6, k))
    if k == 2:
        outcomes = np.array(
            [[0.83, -0.26], [0.86, 0.06], [0.84, 0.27], [1.02, -0.20], [0.97, -0.02], [1.04, 0.22]]
        )
    shifts = rng.normal(0, 0.02, size=(6, 1, 1))
    return Demonstrations(
        plans=motion(outcomes, action_dim) + shifts,
        outcomes_seen=outcomes,
        format=PlanFormat(
            tuple(f"joint{i + 1}" for i in range(action_dim)), ("rad",) * action_dim, DT
        ),
        outcome_format=OutcomeFormat(
            tuple("xyz"[:k]) if set(units) == {"m"} else ("distance", "duration"), units
        ),
    )


def bend(condition: np.ndarray) -> np.ndarray:
    """True outcome of a condition: a few centimetres off, differently everywhere."""
    wave = np.sin(3 * condition.sum() + np.arange(condition.size))
    return condition + 0.07 * wave + 0.02


def adaptation(
    goal=None,
    adapter: FullStep | None = None,
    *,
    seed: int = 0,
    k: int = 2,
    action_dim: int = 7,
    units: tuple[str, ...] = ("m", "m"),
    demos: Demonstrations | None = None,
    void_trial: int = 2,
    most: int = 8,
) -> AdaptationRecord:
    """Adapt until the goal is truly within 1.5 cm; perceived to a centimetre, one trial voided."""
    demos = demos or demonstrations(k, action_dim, units)
    goal = np.array([0.9, 0.1, 0.5])[:k] if goal is None else np.array(goal)
    session = Session(Swing(action_dim), adapter or FullStep(), demos, goal, np.full(k, 0.015))
    rng = np.random.default_rng(seed)
    outcomes: list[np.ndarray | None] = []
    while not session.solved and len(session.trials) < most:
        trial = session.ask()
        if seed % 2 == 0 and trial.number == void_trial:
            session.void(trial.number, "ball slipped")
            outcomes.append(None)
            continue
        outcome = bend(trial.condition) + rng.normal(0, 0.003, size=k)
        error = outcome - goal
        outcomes.append(outcome)
        seen = np.round(error / 0.01) * 0.01
        session.tell(trial.number, seen, hit=bool(np.linalg.norm(error) <= 0.015))
    return AdaptationRecord(
        demos, goal, np.full(k, 0.015), session.trials, outcomes=tuple(outcomes)
    )


def told(
    *errors: list[float] | None,
    goal: tuple[float, float] = (0.92, -0.10),
    tolerance: float = 0.015,
    outcomes: tuple[np.ndarray | None, ...] | None = None,
    first_number: int = 1,
) -> AdaptationRecord:
    """Trials aimed 3 cm beyond the goal, with these errors seen; None voids a trial."""
    condition = np.add(goal, [0.03, 0.0])
    plan = motion(condition[None], 7)[0]
    trials = []
    for number, error in enumerate(errors, start=first_number):
        trial = Trial(number, 1, condition, plan=plan, stage=Stage.VOIDED, note="the arm stopped")
        if error is not None:
            seen = np.array(error)
            hit = bool(np.linalg.norm(seen) <= tolerance)
            trial = Trial(
                number,
                1,
                condition,
                plan=plan,
                stage=Stage.TOLD,
                reading=Reading.measured(seen),
                hit=hit,
            )
        trials.append(trial)
    return AdaptationRecord(
        demonstrations(), np.array(goal), tolerance, tuple(trials), outcomes=outcomes
    )


def pictures(n: int, height: int = 240, width: int = 320) -> Iterator[np.ndarray]:
    """A ball that flies: still for the first third, then a parabola."""
    rows, columns = np.mgrid[:height, :width]
    for i in range(n):
        t = max(0.0, (i - n / 3) / (2 * n / 3))
        x, y = width * (0.15 + 0.7 * t), height * (0.8 - 2.2 * t * (1 - t))
        ball = (rows - y) ** 2 + (columns - x) ** 2 < (height / 20) ** 2
        picture = np.full((height, width, 3), 235, dtype=np.uint8)
        picture[int(height * 0.86) :] = (190, 196, 204)
        picture[ball] = (213, 94, 0)
        yield picture
