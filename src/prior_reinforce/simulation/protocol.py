"""The paper's two stages on a simulated task: seeing the demonstrations, and trying many goals.

Goals are tried in lock step (paper, "Evaluation Protocol"): one round is one trial for every goal
that is not reached yet, one call of the generator, one batched rollout. Whether a goal is reached
is decided by the true outcome; adapters only ever receive what perception saw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import LARGEST, Plans, Point, Points, check_spread
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import EndpointError, InvalidDemonstrationsError, PerceptionFailedError
from prior_reinforce.formats import in_tolerances
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.equivariant import padded
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.eye import Eye
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading
from prior_reinforce.session.session import Session, ask_all
from prior_reinforce.session.trials import Trial, trials_to_hit

FailedReading = Callable[[PerceptionFailedError, Rollout, Point, np.random.Generator], Reading]
"""Fallback where perception fails: why, rollout, goal, source of noise -> what is seen."""
OnRound = Callable[[int, "list[GoalTrials]"], None]
"""Called after every round with its number and the results so far."""

_CANDIDATES_PER_GOAL = 20
"""Ours: how many candidates are weighed for each unseen goal that is taken."""


@dataclass(frozen=True, eq=False)
class GoalTrials:
    """All trials of one goal, as executed in simulation."""

    goal: Point
    """g, where it truly is, [m]."""
    trials: tuple[Trial, ...]
    """As the session kept them; the last one hit, unless the rounds were spent."""
    rollouts: tuple[Rollout, ...]
    """What truly came of each."""
    failed_readings: int = 0
    """Trials in which perception gave up and somebody else looked."""

    @property
    def solved_at(self) -> int | None:
        """How many trials it took to reach the goal; None where none did."""
        return trials_to_hit(self.trials)

    @property
    def errors(self) -> Points:
        """True errors r - g of the trials, [m]."""
        return np.array([rollout.outcome - self.goal for rollout in self.rollouts])


def is_hit(rollout: Rollout, goal: Point, tolerance: ArrayLike) -> bool:
    """Whether the true outcome is within the tolerance of the goal; a lost object never is.

    The tolerance is as sessions compare with it (`formats.in_tolerances`).
    """
    return bool(rollout.valid and in_tolerances(rollout.outcome - goal, tolerance) <= 1.0)


def estimate_by_eye(
    failure: PerceptionFailedError, rollout: Rollout, goal: Point, rng: np.random.Generator
) -> Reading:
    """The simulated operator, who estimates by eye (`Eye`) what could not be read.

    EndpointError if nothing was asked of a picture: what a person sees is no result of a model that
    never answered.
    """
    if isinstance(failure, EndpointError):
        raise failure
    return Eye().perceive(rollout, goal, rng)


def unseen_goals(
    task: Task, demonstrations: Demonstrations, n: int, rng: np.random.Generator
) -> Points:
    """Draw n goals far from all demonstrated outcomes and from each other, in the task's region.

    The paper places its goals "deliberately far from prior rollout outcomes" by hand; ours takes
    the best of random candidates, one goal after another (farthest-point sampling).
    """
    taken = demonstrations.outcomes_seen
    for _ in range(n):
        candidates = task.sample_goals(_CANDIDATES_PER_GOAL, rng)
        distances = np.linalg.norm(candidates[:, None] - taken[None], axis=-1).min(axis=1)
        taken = np.vstack([taken, candidates[np.argmax(distances)]])
    return taken[demonstrations.n :].copy()


def perceive_demonstrations(
    task: Task,
    demonstrations: Demonstrations,
    perception: Perception,
    *,
    seed: int,
    on_failed_reading: FailedReading = estimate_by_eye,
) -> Demonstrations:
    """Execute every demonstration once and perceive its outcome: D_e of the paper's Stage 1.

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
        The same plans with the outcomes seen, how uncertain each is, and what it is expected to
        be.

    Raises:
        InvalidDemonstrationsError: An execution was lost, or all outcomes look alike.
    """
    reference = task.region.mean(axis=0)
    rng = np.random.default_rng([seed, 5])
    seen, noise, correction = [], [], []
    rollouts = task.rollout(demonstrations.plans, np.random.default_rng([seed, 4]))
    for number, rollout in enumerate(rollouts):
        if not rollout.valid:
            raise InvalidDemonstrationsError(
                f"demonstration {number} was lost on {task.name} when it was executed to be seen "
                f"(seed {seed}); choose another seed"
            )
        try:
            reading = perception.perceive(rollout, reference, rng)
        except PerceptionFailedError as failure:
            reading = on_failed_reading(failure, rollout, reference, rng)
        seen.append(reference + reading.error_seen)
        noise.append(reading.spread)
        correction.append(reading.expected - reading.error_seen)
    outcomes = np.array(seen)
    try:
        if len(outcomes) > 1 and not np.ptp(outcomes, axis=0).any():
            check_spread(outcomes)  # whatever a symmetry makes of one outcome, the others are lost
        return replace(
            demonstrations,
            outcomes_seen=outcomes,
            outcome_noise=np.array(noise),
            outcome_correction=np.array(correction),
        )
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
    goals: Points,
    *,
    rounds: int,
    seed: int,
    goals_seen: Points | None = None,
    on_round: OnRound | None = None,
    on_failed_reading: FailedReading = estimate_by_eye,
) -> list[GoalTrials]:
    """Try every goal until it is reached, or for a number of rounds.

    Args:
        task: Where plans are executed, with its disturbances.
        generator: pi, fitted to `demonstrations`.
        make_adapter: Makes one adapter for each goal.
        perception: What the adapters see through.
        demonstrations: D_prior.
        goals: Each with a session of its own, [m].
        rounds: Largest number of trials a goal.
        seed: Of the disturbances (a stream a round) and of perception (a stream a goal).
        goals_seen: Where each goal is perceived, which is all that a session knows of it (the
            paper's g~); exactly where it is when None. Trials are seen, and hit, by where it is.
        on_round: Called after every round.
        on_failed_reading: Called for the error of a trial in which perception gave up.

    Returns:
        One result a goal, in order.
    """
    sessions = [
        Session(generator, make_adapter(), demonstrations, goal, task.tolerance)
        for goal in (goals if goals_seen is None else goals_seen)
    ]
    return reach_goals(
        task,
        sessions,
        perception,
        goals=goals,
        rounds=rounds,
        seed=seed,
        on_round=on_round,
        on_failed_reading=on_failed_reading,
    )


def run_sequences(
    task: Task,
    generator: Generator,
    make_adapter: Callable[[], Adapter],
    perception: Perception,
    demonstrations: Demonstrations,
    sequences: Float[np.ndarray, "sequences goals k"],
    *,
    carry_over: bool,
    rounds: int,
    seed: int,
) -> list[list[GoalTrials]]:
    """Work through sequences of goals, a session a sequence, all sequences in lock step.

    Ours; the paper starts every goal from the demonstrations alone. Somebody who works through
    several goals in one afternoon has the earlier goals' trials at no cost.

    Args:
        task: As for `run_goals`, like the arguments that are not named here.
        generator: pi.
        make_adapter: Makes one adapter for each sequence.
        perception: P.
        demonstrations: D_prior.
        sequences: Goals, [m].
        carry_over: Whether the trials of a sequence's earlier goals serve the later ones.
        rounds: Largest number of trials a goal.
        seed: Other streams for each goal of a sequence.

    Returns:
        For each sequence, a result a goal.
    """
    sessions = [
        Session(generator, make_adapter(), demonstrations, carry_over=carry_over) for _ in sequences
    ]
    by_place = []
    for j in range(sequences.shape[1]):
        for session, goals in zip(sessions, sequences, strict=True):
            session.set_goal(goals[j], task.tolerance)
        own_seed = int(np.random.SeedSequence([seed, j]).generate_state(1)[0])
        by_place.append(reach_goals(task, sessions, perception, rounds=rounds, seed=own_seed))
    return [list(results) for results in zip(*by_place, strict=True)]


def reach_goals(
    task: Task,
    sessions: Sequence[Session],
    perception: Perception,
    *,
    goals: Points | None = None,
    rounds: int,
    seed: int,
    on_round: OnRound | None = None,
    on_failed_reading: FailedReading = estimate_by_eye,
) -> list[GoalTrials]:
    """Try the goal that each session works on, in lock step; else as `run_goals`.

    All sessions have one fitted generator, and a goal each; `goals` says where these truly are,
    where sessions only know where they were seen.
    """
    if goals is None:
        goals = np.array([session.goal for session in sessions])
    seers = [np.random.default_rng([seed, 1, i]) for i in range(len(sessions))]
    rollouts: list[list[Rollout]] = [[] for _ in sessions]
    failed = [0] * len(sessions)

    def results() -> list[GoalTrials]:
        return [
            GoalTrials(goals[i], session.trials, tuple(rollouts[i]), failed[i])
            for i, session in enumerate(sessions)
        ]

    for number in range(1, rounds + 1):
        active = [i for i, session in enumerate(sessions) if not session.solved]
        if not active:
            break
        trials = ask_all([sessions[i] for i in active])
        plans = padded([trial.plan for trial in trials])
        executed = _executed(task, plans, np.random.default_rng([seed, 0, number]))
        for i, trial, rollout in zip(active, trials, executed, strict=True):
            goal = goals[i]
            try:
                reading = perception.perceive(rollout, goal, seers[i])
            except PerceptionFailedError as failure:
                failed[i] += 1
                reading = on_failed_reading(failure, rollout, goal, seers[i])
            rollouts[i].append(rollout)
            sessions[i].tell(trial.number, reading, hit=is_hit(rollout, goal, task.tolerance))
        if on_round is not None:
            on_round(number, results())
    return results()


def _executed(task: Task, plans: Plans, rng: np.random.Generator) -> list[Rollout]:
    """Roll plans out; one with numbers that no arm has (a DMP that ran away) loses its object."""
    wild = np.abs(plans).max(axis=(1, 2)) > LARGEST
    rollouts = task.rollout(np.where(wild[:, None, None], 0.0, plans), rng)
    return [replace(r, valid=False) if w else r for r, w in zip(rollouts, wild, strict=True)]


def success_by_round(results: Sequence[GoalTrials], rounds: int) -> Float[np.ndarray, " rounds"]:
    """Fraction of goals reached in at most 1, 2, ..., `rounds` trials."""
    solved_at = np.array([result.solved_at or 0 for result in results])
    in_rounds = range(1, rounds + 1)
    return np.array([np.mean((solved_at > 0) & (solved_at <= n)) for n in in_rounds])
