"""Algorithm 1 as a state machine, on a closed-form world."""

import numpy as np
import pytest

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
    TrialStateError,
)
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.session import Session, TrialState, ask_all

DEMOS = Demonstrations(
    plans=np.arange(2 * 3 * 2, dtype=float).reshape(2, 3, 2),
    outcomes_seen=[[0.8, -0.2], [1.0, 0.2]],
    format=PlanFormat(("a", "b"), ("m", "m"), 0.1),
)
GOAL = np.array([0.9, 0.1])


class RepeatingGenerator(Generator):
    """Says the condition in every frame, and counts its calls."""

    name = "repeating"

    def __init__(self):
        self.calls = 0

    def fit(self, demonstrations, *, seed, progress=None):
        return self

    def generate(self, conditions):
        self.calls += 1
        return np.repeat(conditions[:, None, :], 3, axis=1)

    def save(self, folder): ...

    @classmethod
    def load(cls, folder):
        return cls()


class FullStepAdapter(Adapter):
    """Subtracts the whole last error: solves a constant offset in two trials."""

    name = "full-step"

    def start(self, demonstrations):
        self.seen = []

    def propose(self, goal_seen):
        if not self.seen:
            return goal_seen.copy()
        condition, outcome_seen = self.seen[-1]
        return condition - (outcome_seen - goal_seen)

    def observe(self, condition, outcome_seen):
        self.seen.append((condition.copy(), outcome_seen.copy()))


@pytest.fixture
def session():
    return Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, 0.015)


def test_a_constant_offset_is_corrected_in_the_second_trial(session):
    """World: outcome = condition + offset. Trial 1 misses by the offset, trial 2 hits."""
    offset = np.array([0.05, -0.02])
    for _ in range(2):
        trial = session.ask()
        session.tell(trial.number, trial.condition + offset - GOAL)
    np.testing.assert_allclose(session.trials[0].condition, GOAL)
    np.testing.assert_allclose(session.trials[1].condition, GOAL - offset)
    assert session.solved
    assert [trial.hit for trial in session.trials] == [False, True]
    assert (session.n_trials, session.total_trials) == (2, 4)


def test_the_first_condition_is_m_of_the_goal_and_the_plan_is_pi_of_it(session):
    trial = session.ask()
    assert trial.number == 1
    np.testing.assert_array_equal(trial.condition, GOAL)
    np.testing.assert_array_equal(trial.plan, np.repeat(GOAL[None], 3, axis=0))


def test_ask_is_idempotent_until_told(session):
    first = session.ask()
    assert session.ask() is first
    assert session._generator.calls == 1
    session.tell(1, [0.05, 0.0])
    assert session.ask().number == 2


def test_ask_is_idempotent_until_voided_and_a_void_trial_is_not_data(session):
    session.ask()
    session.void(1, "ball slipped")
    second = session.ask()
    assert second.number == 2
    np.testing.assert_array_equal(second.condition, GOAL)
    assert session.n_trials == 0
    assert session.trials[0].note == "ball slipped"


def test_hit_as_seen_overrides_the_judgement_by_error(session):
    session.ask()
    session.tell(1, [0.0, 0.0], hit=False)
    assert not session.solved
    session.ask()
    session.tell(2, [0.05, 0.0], hit=True)
    assert session.solved


def test_the_tolerance_itself_is_a_hit(session):
    session.ask()
    session.tell(1, [0.015, 0.0])
    assert session.solved


def test_amend_replaces_the_observation(session):
    session.ask()
    session.tell(1, [0.05, 0.0])
    session.amend(1, [0.0, 0.04])
    np.testing.assert_allclose(session.ask().condition, GOAL - [0.0, 0.04])


def test_amend_leaves_a_pending_plan_as_it_is(session):
    session.ask()
    session.tell(1, [0.05, 0.0])
    pending = session.ask()
    session.amend(1, [0.0, 0.04])
    assert session.ask() is pending


def test_voiding_a_told_trial_forgets_it(session):
    for error in ([0.05, 0.0], [0.0, 0.03]):
        session.tell(session.ask().number, error)
    session.void(2, "misread")
    np.testing.assert_allclose(session.ask().condition, GOAL - [0.05, 0.0])


def test_a_session_goes_on_from_its_trials(session):
    session.tell(session.ask().number, [0.05, 0.0])
    session.ask()
    again = Session(
        RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, 0.015, trials=session.trials
    )
    assert again.pending is session.pending
    again.tell(2, [0.01, 0.02])
    session.tell(2, [0.01, 0.02])
    np.testing.assert_array_equal(again.ask().condition, session.ask().condition)


def test_earlier_trials_reach_the_adapter_before_its_own():
    earlier = [(np.array([0.8, 0.0]), np.array([0.85, 0.0]))]
    session = Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, 0.015, earlier=earlier)
    np.testing.assert_allclose(session.ask().condition, [0.8, 0.0] - (np.array([0.85, 0.0]) - GOAL))
    assert session.n_trials == 0


@pytest.mark.parametrize("error", [[0.1], [np.nan, 0.0], [0.1, np.inf], "x", [[1], [1, 2]]])
def test_bad_feedback_changes_nothing(session, error):
    trial = session.ask()
    with pytest.raises(InvalidFeedbackError):
        session.tell(1, error)
    assert session.pending is trial
    assert session._adapter.seen == []


def test_wrong_numbers_and_states_are_named_and_change_nothing(session):
    with pytest.raises(TrialStateError, match="ask for one first"):
        session.tell(1, [0.0, 0.0])
    session.ask()
    for call in (session.tell, session.amend):
        with pytest.raises(TrialStateError, match="no trial 7"):
            call(7, [0.0, 0.0])
    with pytest.raises(TrialStateError, match="only a told trial"):
        session.amend(1, [0.0, 0.0])
    session.tell(1, [0.05, 0.0])
    with pytest.raises(TrialStateError, match="already told"):
        session.tell(1, [0.0, 0.0])
    session.void(1, "slipped")
    with pytest.raises(TrialStateError, match="already voided"):
        session.void(1, "again")
    assert [trial.state for trial in session.trials] == [TrialState.VOIDED]


@pytest.mark.parametrize("number", [1.0, "1", None, True, [1]])
def test_a_number_that_is_no_whole_number_is_named(session, number):
    trial = session.ask()
    for call in (session.tell, session.amend, session.void):
        with pytest.raises(TrialStateError, match="whole number"):
            call(number, [0.05, 0.0])
    assert session.trials == (trial,)
    assert session.tell(np.int64(1), [0.05, 0.0]).number == 1


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf, "x", "0.01", None, True, [0.1]])
def test_bad_tolerances_are_named(tolerance):
    with pytest.raises(ConfigurationError, match="tolerance"):
        Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, tolerance)


def test_a_goal_of_the_wrong_dimension_is_named():
    with pytest.raises(InvalidGoalError, match="2 components"):
        Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, [0.9], 0.01)


def test_trials_out_of_order_are_refused(session):
    session.tell(session.ask().number, [0.05, 0.0])
    session.ask()
    for wrong in (session.trials[1:], session.trials[::-1]):
        with pytest.raises(TrialStateError, match="cannot stand"):
            Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, 0.015, trials=wrong)


def test_asking_many_sessions_calls_the_generator_once_and_agrees_with_asking_each():
    generator = RepeatingGenerator()
    goals = [[0.85, 0.0], [0.9, 0.1], [0.95, -0.1]]
    sessions = [Session(generator, FullStepAdapter(), DEMOS, goal, 0.015) for goal in goals]
    pending = sessions[1].ask()
    trials = ask_all(sessions)
    assert generator.calls == 2
    assert trials[1] is pending
    np.testing.assert_allclose([trial.condition for trial in trials], goals)


def test_sessions_with_different_generators_cannot_be_asked_together():
    sessions = [Session(RepeatingGenerator(), FullStepAdapter(), DEMOS, GOAL, 0.1) for _ in "ab"]
    with pytest.raises(ConfigurationError, match="share one generator"):
        ask_all(sessions)


def test_trials_cannot_be_changed_from_outside(session):
    trial = session.ask()
    with pytest.raises(ValueError, match="read-only"):
        trial.plan[0, 0] = 1.0
