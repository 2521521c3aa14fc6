"""The paper's two stages on a simulated task: seeing the demonstrations, and trying many goals.

Goals are tried in lock step (paper, "Evaluation Protocol"): one round is one trial for every goal
that is not reached yet, one call of the generator, one batched rollout. Whether a goal is reached
is decided by the true outcome; adapters only ever receive what perception saw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.errors import (
    EndpointError,
    InvalidDemonstrationsError,
    PerceptionFailedError,
)
from prior_reinforce.experiments.statistics import reached_by
from prior_reinforce.generators.base import Generator
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.eye import Eye
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.rollouts import Rollout
from prior_reinforce.session import Session, ask_all
from prior_reinforce.trials import Trial
from prior_reinforce.tasks.base import Task

FailedReading = Callable[
    [PerceptionFailedError, Rollout, np.ndarray, np.random.Generator], np.ndarray
]
"""Who looks where perception gives up: why, rollout, goal, source of noise -> error seen (k,)."""


@dataclass(frozen=True, eq=False)
class GoalTrials:
    """All trials of one goal, as executed in simulation."""

    goal: np.ndarray
    """g, shape (k,), [m]."""
    trials: tuple[Trial, ...]
    """As the session kept them; the last one hit, unless the rounds were spent."""
    rollouts: tuple[Rollout, ...]
    """What truly came of each."""
    failed_readings: int = 0
    """Trials in which perception gave up and somebody else looked."""

    @property
    def solved_at(self) -> int | None:
        """Number of the trial that reached the goal, from 1; None where none did."""
        return next((trial.number for trial in self.trials if trial.hit), None)

    @property
    def errors(self) -> np.ndarray:
        """True errors r - g, shape (trials, k), [m]."""
        return np.array([rollout.outcome - self.goal for rollout in self.rollouts])


def is_hit(rollout: Rollout, goal: np.ndarray, tolerance: float) -> bool:
    """Whether the true outcome is within the tolerance of the goal; a lost object never is."""
    return bool(rollout.valid and np.linalg.norm(rollout.outcome - goal) <= tolerance)


def look_by_eye(
    failure: PerceptionFailedError, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """The simulated operator, who estimates by eye (`Eye`) what could not be read.

    Raises:
        EndpointError: Nothing was asked of a picture: what a person sees is no result of a model
            that never answered.
    """
    if isinstance(failure, EndpointError):
        raise failure
    return Eye().perceive(rollout, goal, rng)


def see_demonstrations(
    task: Task,
    demonstrations: Demonstrations,
    perception: Perception,
    *,
    seed: int,
    on_failed_reading: FailedReading = look_by_eye,
) -> Demonstrations:
    """Execute every demonstration once and see where it went: D_e of the paper's Stage 1.

    r_seen_i = g_0 + P(rollout(A_i) - g_0), with the reference goal g_0 in the middle of the
    task's region (ours: the paper names one, but not where). From so far off an estimate by eye
    is coarse: to 10 cm, beyond 7.5 cm.

    Args:
        task: Where they are executed, with its disturbances.
        demonstrations: D_prior; their outcomes are not looked at.
        perception: P.
        seed: Of the disturbances and of perception; other streams than those of `run_goals`.
        on_failed_reading: Called where perception gives up.

    Returns:
        The same plans with the outcomes seen.

    Raises:
        InvalidDemonstrationsError: An execution was lost, or outcomes looked the same.
    """
    reference = task.region.mean(axis=0)
    rng = np.random.default_rng([seed, 5])
    seen = []
    rollouts = task.rollout(demonstrations.plans, np.random.default_rng([seed, 4]))
    for number, rollout in enumerate(rollouts):
        if not rollout.valid:
            raise InvalidDemonstrationsError(
                f"demonstration {number} was lost on {task.name} when it was executed to be seen "
                f"(seed {seed}); choose another seed"
            )
        try:
            error_seen = perception.perceive(rollout, reference, rng)
        except PerceptionFailedError as failure:
            error_seen = on_failed_reading(failure, rollout, reference, rng)
        seen.append(reference + error_seen)
    try:
        return replace(demonstrations, outcomes_seen=np.array(seen))
    except InvalidDemonstrationsError as error:
        raise InvalidDemonstrationsError(
            f"as {type(perception).__name__} saw {task.name} (seed {seed}), {error}; choose "
            "another seed or a finer perception"
        ) from error


def run_goals(
    task: Task,
    generator: Generator,
    make_adapter: Callable[[], Adapter],
    perception: Perception,
    demonstrations: Demonstrations,
    goals: np.ndarray,
    *,
    rounds: int,
    seed: int,
    earlier: Sequence[Sequence[tuple[np.ndarray, np.ndarray]]] | None = None,
    on_round: Callable[[int, list[GoalTrials]], None] | None = None,
    on_failed_reading: FailedReading = look_by_eye,
) -> list[GoalTrials]:
    """Try every goal until it is reached, or for a number of rounds.

    Args:
        task: Where plans are executed, with its disturbances.
        generator: pi, fitted to `demonstrations`.
        make_adapter: Makes one adapter for each goal.
        perception: What the adapters see through.
        demonstrations: D_prior.
        goals: Shape (n, k), [m].
        rounds: Largest number of trials a goal.
        seed: Of the disturbances (a stream a round) and of perception (a stream a goal).
        earlier: For each goal what its session remembers of earlier goals; see `Session`.
        on_round: Called after every round with its number and the results so far.
        on_failed_reading: Called for the error of a trial in which perception gave up.

    Returns:
        One result a goal, in order.
    """
    sessions = [
        Session(generator, make_adapter(), demonstrations, goal, task.tolerance) for goal in goals
    ]
    seers = [np.random.default_rng([seed, 1, i]) for i in range(len(goals))]
    rollouts: list[list[Rollout]] = [[] for _ in goals]
    failed = [0] * len(goals)

    def results() -> list[GoalTrials]:
        return [
            GoalTrials(session.goal, session.trials, tuple(rollouts[i]), failed[i])
            for i, session in enumerate(sessions)
        ]

    for number in range(1, rounds + 1):
        active = [i for i, session in enumerate(sessions) if not session.solved]
        if not active:
            break
        trials = ask_all([sessions[i] for i in active])
        plans = np.stack([trial.plan for trial in trials])
        executed = task.rollout(plans, np.random.default_rng([seed, 0, number]))
        for i, trial, rollout in zip(active, trials, executed, strict=True):
            session = sessions[i]
            try:
                error_seen = perception.perceive(rollout, session.goal, seers[i])
            except PerceptionFailedError as failure:
                failed[i] += 1
                error_seen = on_failed_reading(failure, rollout, session.goal, seers[i])
            rollouts[i].append(rollout)
            session.tell(
                trial.number, error_seen, hit=is_hit(rollout, session.goal, task.tolerance)
            )
        if on_round is not None:
            on_round(number, results())
    return results()


def success_by_round(results: list[GoalTrials], rounds: int) -> np.ndarray:
    """Fraction of goals reached in at most 1, 2, ..., `rounds` trials, shape (rounds,)."""
    solved_at = np.array([result.solved_at or 0 for result in results])
    return np.array([reached_by(solved_at, number).mean() for number in range(1, rounds + 1)])
