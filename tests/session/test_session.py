"""Algorithm 1 as a state machine, on a closed-form world."""

import copy
import pickle
import threading
import warnings
from functools import partial

import numpy as np
import pytest

from prior_reinforce.adapters.base import Adapter, Expectation
from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
    InvalidPlanError,
    OutOfReachError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import TurnJoint, turn_and_scale
from prior_reinforce.readings import Reading
from prior_reinforce.session.session import Session, ask_all
from prior_reinforce.session.trials import Log, SessionState, Stage

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

    def _fit(self, demonstrations, seed, progress): ...

    def _generate(self, conditions):
        self.calls += 1
        return np.repeat(conditions[:, None, :], 3, axis=1)


class FullStepAdapter(Adapter):
    """Subtracts the whole last error: solves a constant offset in two trials."""

    def _start(self, demonstrations):
        self.seen = []

    def _propose(self, goal_seen):
        if not self.seen:
            return goal_seen.copy()
        condition, outcome_seen = self.seen[-1]
        return condition - (outcome_seen - goal_seen)

    def _observe(self, condition, outcome_seen):
        self.seen.append((condition.copy(), outcome_seen.copy()))


@pytest.fixture
def session():
    return Session(RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, GOAL, 0.015)


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
    assert session.n_trials == 2


def test_the_first_condition_is_m_of_the_goal_and_the_plan_is_pi_of_it(session):
    trial = session.ask()
    assert trial.number == 1
    np.testing.assert_array_equal(trial.condition, GOAL)
    np.testing.assert_array_equal(trial.plan, np.repeat(GOAL[None], 3, axis=0))


def test_ask_is_idempotent_until_told(session):
    first = session.ask()
    assert session.ask() is first
    assert session.generator.calls == 1
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


def test_a_told_trial_that_was_voided_by_mistake_is_told_again_by_amending_it(session):
    session.ask()
    session.tell(1, [0.05, 0.0])
    session.ask()
    session.void(1, "slip")
    session.amend(1, [0.05, 0.0])
    first, waiting = session.trials
    assert (first.stage, first.note) == (Stage.TOLD, "")
    np.testing.assert_array_equal(first.error_seen, [0.05, 0.0])
    session.void(2)
    again = session.ask()
    np.testing.assert_array_equal(again.condition, waiting.condition)  # planned from the same
    session.void(3)
    with pytest.raises(TrialStateError, match="only a told trial"):
        session.amend(3, [0.0, 0.0])


def test_hit_as_seen_overrides_the_judgement_by_error(session):
    session.ask()
    session.tell(1, [0.0, 0.0], hit=False)
    assert not session.solved
    session.ask()
    session.tell(2, [0.05, 0.0], hit=True)
    assert session.solved


class Listening(FullStepAdapter):
    """Keeps all that it hears."""

    def _start(self, demonstrations):
        super()._start(demonstrations)
        self.heard = []

    def _observe_reading(self, condition, goal, reading):
        self.heard.append((goal, reading))
        super()._observe_reading(condition, goal, reading)


@pytest.fixture
def listening():
    return Session(RepeatingGenerator().fit(DEMOS, seed=0), Listening(), DEMOS, GOAL, 0.015)


def test_words_and_readings_reach_the_adapter_as_they_were_said(listening):
    for seen in ("5 cm long, 2 cm left", Reading.measured([0.05, 0.02], 0.001)):
        listening.tell(listening.ask().number, seen)
    listening.ask()
    (_, by_eye), (_, measured) = listening.adapter.heard
    np.testing.assert_allclose([by_eye.low, by_eye.high], [[0.035, 0.01], [0.075, 0.035]])
    np.testing.assert_allclose(measured.sd, 0.001)
    assert [trial.reading.said for trial in listening.trials[:2]] == ["5 cm long, 2 cm left", ""]


def test_words_that_name_no_hit_say_that_it_missed(listening):
    for seen in ("2cm right", Reading.measured([0.0, -0.016], 0.001), "1cm left"):
        listening.tell(listening.ask().number, seen)
    listening.ask()
    by_eye, measured, near = (reading for _, reading in listening.adapter.heard)
    # At least 1.5 cm in all, of which ahead may be 1 cm.
    np.testing.assert_allclose(by_eye.high[1], -np.sqrt(0.015**2 - 0.01**2))
    np.testing.assert_allclose(by_eye.missed_by_at_least, 0.015)
    assert measured.missed_by_at_least is None
    assert near.missed_by_at_least is None
    assert listening.solved


def test_numbers_are_of_unknown_origin_to_a_third_of_the_tolerance(listening):
    listening.tell(listening.ask().number, [0.0, -0.08])
    np.testing.assert_allclose(listening.trials[0].reading.sd, [0.005, np.hypot(0.005, 0.016)])


def test_a_hit_alone_is_a_reading_within_the_tolerance(listening):
    listening.tell(listening.ask().number, hit=True)
    listening.ask()
    assert listening.solved
    ((goal, reading),) = listening.adapter.heard
    np.testing.assert_array_equal(goal, GOAL)
    np.testing.assert_array_equal([reading.low, reading.high], [[-0.015] * 2, [0.015] * 2])


def test_a_miss_alone_teaches_nobody_who_wants_numbers(session):
    session.tell(session.ask().number, hit=False)
    assert not session.solved
    np.testing.assert_array_equal(session.ask().condition, GOAL)


@pytest.mark.slow
def test_misses_alone_make_the_default_adapter_try_beside_them():
    seen = Demonstrations(
        DEMOS.plans, DEMOS.outcomes_seen, DEMOS.format, outcome_noise=[[0.02] * 2] * 2
    )
    session = Session(RepeatingGenerator().fit(seen, seed=0), BayesianAdapter(), seen, GOAL, 0.015)
    for _ in range(4):
        session.tell(session.ask().number, hit=False)
    tried = np.array([trial.condition for trial in session.trials])
    np.testing.assert_allclose(tried[0], GOAL, atol=1e-9)
    apart = np.linalg.norm(tried[:, None] - tried, axis=2)[np.triu_indices(4, 1)]
    assert np.all((apart > 0.003) & (apart < 0.1))
    p_hit = [trial.expected.p_hit for trial in session.trials]
    assert 0.0 < p_hit[3] < p_hit[0]


def test_a_hit_that_is_seen_overrules_what_the_reading_knows(session):
    session.tell(session.ask().number, Reading.by_eye([0.05, 0.0], hit=False), hit=True)
    assert session.trials[0].reading.hit is True
    assert session.solved


def test_nothing_at_all_cannot_be_told(session):
    session.ask()
    with pytest.raises(InvalidFeedbackError, match="whether it hit"):
        session.tell(1)
    with pytest.raises(InvalidFeedbackError, match="3"):
        session.tell(1, Reading.by_eye([0.05, 0.0, 0.0]))
    with pytest.raises(InvalidFeedbackError, match="cannot read"):
        session.tell(1, "far away")
    assert session.open_trial is not None


MIXED = Demonstrations(
    np.random.default_rng(0).normal(size=(4, 3, 2)),
    [[0.8, 1.0], [1.0, 3.0], [0.8, 3.0], [1.0, 1.0]],  # spreads 0.1 m and 1 s
    PlanFormat(("x", "y"), ("rad", "rad"), 0.02),
    OutcomeFormat(("x", "t"), ("m", "s")),
)


def test_metres_and_seconds_have_a_tolerance_each():
    generator = RepeatingGenerator().fit(MIXED, seed=0)
    session = Session(generator, FullStepAdapter(), MIXED, [0.9, 2.0], [0.015, 0.02])
    session.tell(session.ask().number, [0.0, 0.021])
    session.tell(session.ask().number, [0.009, 0.0159])  # 0.6 and 0.795 tolerances: 0.996 in all
    assert [trial.hit for trial in session.trials] == [False, True]
    np.testing.assert_allclose(session.tolerance, [0.015, 0.02])
    session.tell(session.ask().number, "5 cm long, 20ms late")
    assert session.trials[-1].reading.error_seen.tolist() == [0.05, 0.02]
    assert session.trials[-1].reading.sd[1] == pytest.approx(np.hypot(0.02 / 3, 0.004))


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
    again = session.ask()
    assert (again.number, again.outdated, pending.outdated) == (2, True, False)
    np.testing.assert_array_equal(again.plan, pending.plan)


def test_voiding_a_told_trial_forgets_it(session):
    for error in ([0.05, 0.0], [0.0, 0.03]):
        session.tell(session.ask().number, error)
    session.void(2, "misread")
    np.testing.assert_allclose(session.ask().condition, GOAL - [0.05, 0.0])


def test_a_session_goes_on_from_its_log(session):
    session.tell(session.ask().number, [0.05, 0.0])
    session.ask()
    again = Session(
        RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, log=session.log
    )
    np.testing.assert_array_equal(again.goal, GOAL)
    assert again.open_trial.number == session.open_trial.number == 2
    again.tell(2, [0.01, 0.02])
    assert session.ask().number == 3
    np.testing.assert_array_equal(again.ask().condition, GOAL - [0.05, 0.0] - [0.01, 0.02])


def test_two_sessions_on_one_log_tell_a_trial_once(session):
    other = Session(
        RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, log=session.log
    )
    assert other.ask().number == session.ask().number == 1
    other.tell(1, [0.05, 0.0])
    with pytest.raises(TrialStateError, match="already told"):
        session.tell(1, [0.0, 0.0])


@pytest.mark.parametrize("carry_over", [False, True])
def test_trials_of_earlier_goals_reach_the_adapter_where_they_are_carried_over(carry_over):
    session = Session(
        RepeatingGenerator().fit(DEMOS, seed=0),
        FullStepAdapter(),
        DEMOS,
        [0.8, 0.0],
        0.015,
        carry_over=carry_over,
    )
    session.tell(session.ask().number, [0.05, 0.0])
    session.set_goal(GOAL)
    expected = [0.8, 0.0] - (np.array([0.85, 0.0]) - GOAL) if carry_over else GOAL
    trial = session.ask()
    np.testing.assert_allclose(trial.condition, expected)
    assert (trial.number, trial.goal_number, session.n_trials) == (2, 2, 0)


def test_trials_of_another_model_teach_nothing(session, monkeypatch):
    session.tell(session.ask().number, [0.05, 0.0])
    monkeypatch.setattr(SessionState, "in_use", ("another",))
    np.testing.assert_array_equal(session.ask().condition, GOAL)


class Carrying(FullStepAdapter):
    """Wants earlier goals' trials, counts changes of hardware, and expects something."""

    carries_over = True

    def _start(self, demonstrations):
        super()._start(demonstrations)
        self.events = []

    def _change_hardware(self):
        self.events.append("changed")

    def _observe(self, condition, outcome_seen):
        super()._observe(condition, outcome_seen)
        self.events.append(round(outcome_seen[0], 2))

    def _expect(self, condition, goal, tolerance):
        return Expectation(0.25, 2.5)


def carrying(log=None):
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    return Session(generator, Carrying(), DEMOS, None if log else [0.8, 0.0], 0.015, log=log)


def test_trials_are_carried_over_where_they_serve_the_adapter():
    session = carrying()
    session.tell(session.ask().number, [0.05, 0.0])
    session.set_goal(GOAL)
    assert session.goals[-1].carry_over
    session.ask()
    assert session.adapter.events == [0.85]
    session.void(2, "")
    assert not session.set_goal(GOAL, carry_over=False).carry_over


def test_a_loss_that_keeps_plans_near_is_named_with_how_to_take_it_back():
    session = carrying()
    session.tell(session.ask().number, "30cm long")
    session.set_goal(GOAL)
    session.tell(session.ask().number, "lost")
    session.adapter._expect = lambda *of: Expectation(0.9, 1.1, nearer=True)
    assert "since trial 2 was lost; void 2 if" in session.ask().expected.remark


def test_a_surprise_is_said_at_once_with_what_to_do_about_it():
    session = carrying()
    expected = Expectation(0.9, 1.1, (0.01, 0.0), (0.01, 0.02))
    session.adapter._expect = lambda *of: expected
    session.ask()
    told = session.tell(1, Reading.measured([0.21, 0.0], 0.0))
    assert told.surprise == (
        "20 standard deviations from the prediction (a typo? amend 1; other hardware? goal "
        "--new-hardware)"
    )
    assert session.amend(1, Reading.measured([0.04, 0.0], 0.0)).surprise == ""
    assert session.amend(1, Reading.measured([0.21, 0.0], 0.2)).surprise == ""  # a coarse look
    session.amend(1, hit=False)
    assert session.trials[0].surprise == ""
    session.ask()
    assert session.tell(2, "20 cm long").surprise.startswith("14 standard")  # of 15 cm


def test_the_adapter_hears_of_new_hardware_between_the_trials_before_and_after():
    session = carrying()
    session.tell(session.ask().number, [0.05, 0.0])
    for note, error in (("another ball", 0.01), (None, 0.02), ("gripper", 0.03)):
        session.set_goal([0.8, 0.0], new_hardware=note)
        session.tell(session.ask().number, [error, 0.0], hit=False)
    session.ask()
    heard = [0.85, "changed", 0.81, 0.82, "changed", 0.83]
    assert session.adapter.events == heard
    assert [goal.new_hardware for goal in session.goals] == [None, "another ball", None, "gripper"]
    again = carrying(session.log)
    again.void(5, "")
    again.ask()
    assert again.adapter.events == heard
    again.amend(2, [-0.05, 0.0])  # an earlier goal's
    again.void(3, "misread")
    again.tell(6, [0.0, 0.0])
    again.ask()
    assert again.adapter.events == [0.85, "changed", 0.75, "changed", 0.83, 0.8]


def test_what_was_expected_is_kept_with_the_trial(session):
    assert session.ask().expected == Expectation()
    expecting = carrying()
    trial = expecting.ask()
    assert trial.expected == Expectation(0.25, 2.5)
    assert carrying(expecting.log).open_trial.expected.p_hit == 0.25


def test_a_goal_waits_for_the_open_trial(session):
    session.ask()
    with pytest.raises(TrialStateError, match="tell or void it"):
        session.set_goal([0.8, 0.0])
    session.void(1, "")
    assert session.set_goal([0.8, 0.0], 0.02).tolerance.tolist() == [0.02, 0.02]


class Gate:
    """Refuses plans that go beyond a limit, which may change."""

    limit = 10.0

    calls = 0

    def __call__(self, plan, condition):
        self.calls += 1
        self.largest = float(np.abs(plan).max())
        return self

    def require(self):
        if self.largest > self.limit:
            raise RobotLimitError(f"{self.largest} is beyond {self.limit}", remedy="slow down")

    def as_json(self):
        return {"largest": self.largest}


class RaisingGate(Gate):
    """Refuses where it is called already."""

    def __call__(self, plan, condition):
        super().__call__(plan, condition).require()
        return self


def test_a_refused_plan_never_leaves_whenever_it_is_asked_for():
    gate = Gate()
    session = Session(
        RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, GOAL, 0.015, gate=gate
    )
    gate.limit = 0.5
    with pytest.raises(
        RobotLimitError, match=r"no plan for the goal 90 cm ahead, 10 cm left: 0\.9 is"
    ):
        session.ask()
    assert session.trials == ()
    gate.limit = 10.0
    assert (trial := session.ask()).gate == {"largest": 0.9}
    assert trial.verdict is gate
    assert (gate.calls, session.ask().verdict, gate.calls) == (2, gate, 3)
    gate.limit = 0.5
    with pytest.raises(RobotLimitError, match="void it and ask again"):
        session.ask()
    session.void(1, "refused")


@pytest.mark.parametrize("gate", [Gate(), RaisingGate()])
def test_where_a_correction_does_not_pass_the_last_plan_that_does_is_tried_once(gate):
    session = Session(
        RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, GOAL, 0.015, gate=gate
    )
    session.tell(session.ask().number, [-0.3, 0.0])
    gate.limit = 1.0
    trial = session.ask()
    assert 0.99 < trial.condition[0] <= 1.0
    np.testing.assert_array_equal(trial.plan[0], trial.condition)
    assert trial.expected.beyond
    assert trial.expected.remark.startswith(
        "moved only as far as passes, which may not do (1.2 is beyond"
    )
    session.tell(2, [-0.2, 0.0])
    with pytest.raises(
        RobotLimitError, match="trial 2 went as far as passes, and missed: dem"
    ) as e:
        session.ask()
    assert "slow down" not in str(e.value)  # one remedy is enough
    session.amend(2, [0.05, 0.0])
    assert session.ask().expected == Expectation()


@pytest.mark.parametrize("gate", [Gate(), None])
def test_a_plan_that_is_as_far_as_may_be_is_refused_once_it_missed(gate):
    session = carrying()
    session._gate = gate
    beyond = Expectation(0.0, 9.0, remark="the goal is nearer than", beyond=True)
    session.adapter._expect = lambda *of: beyond
    session.adapter._propose = lambda goal: goal
    session.tell(session.ask().number, hit=False)
    assert session.ask().expected.beyond
    session.tell(session.ask().number, [0.001, 0.02])
    with pytest.raises(OutOfReachError, match="trial 2 made the same plan and missed: the goal is"):
        session.ask()
    if gate is None:  # one of many goals does not end the others
        assert ask_all([session])[0].number == 3


class Beside(FullStepAdapter):
    def _propose(self, goal_seen):
        return goal_seen + np.array([0.01, 0.0])


def test_a_refusal_names_the_goal_what_was_asked_for_and_that_it_is_too_far():
    gate = Gate()
    gate.limit = 0.5
    with pytest.warns(UserWarning, match="outside"):
        session = Session(
            RepeatingGenerator().fit(DEMOS, seed=0), Beside(), DEMOS, [2.0, 0.1], 0.015, gate=gate
        )
    with pytest.raises(RobotLimitError) as refused:
        session.ask()
    assert str(refused.value).startswith(
        "no plan for the goal 200 cm ahead, 10 cm left, for which the plan would aim at 201 cm "
        "ahead, 10 cm left, which lies far outside the demonstrations (choose one nearer to them): "
    )


def test_a_goal_is_not_spoken_of_while_a_trial_waits(session):
    session.ask()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(TrialStateError, match="trial 1 waits to be told"):
            session.set_goal([2.0, 0.1])


@pytest.mark.parametrize("hit", ["no", 1, [True]])
def test_a_hit_is_yes_or_no(session, hit):
    session.ask()
    with pytest.raises(InvalidFeedbackError, match="hit must be"):
        session.tell(1, [0.0, 0.0], hit=hit)
    assert session.tell(1, [0.5, 0.0], hit=np.True_).hit is True


@pytest.mark.parametrize("error", [[0.1], [np.nan, 0.0], [0.1, np.inf], "x", [[1], [1, 2]]])
def test_bad_feedback_changes_nothing(session, error):
    trial = session.ask()
    with pytest.raises(InvalidFeedbackError):
        session.tell(1, error)
    assert session.open_trial is trial
    assert session.n_trials == 0


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
    assert [trial.stage for trial in session.trials] == [Stage.VOIDED]


@pytest.mark.parametrize("number", [1.0, "1", None, True, [1]])
def test_a_number_that_is_no_whole_number_is_named(session, number):
    trial = session.ask()
    for call in (session.tell, session.amend, session.void):
        with pytest.raises(TrialStateError, match="whole number"):
            call(number, [0.05, 0.0])
    assert session.trials == (trial,)
    assert session.tell(np.int64(1), [0.05, 0.0]).number == 1


@pytest.mark.parametrize(
    "tolerance",
    [0.0, -1.0, np.nan, np.inf, "x", "0.01", None, True, [0.1], [0.1, 0.0], [[0.1], 0.1]],
)
def test_bad_tolerances_are_named(tolerance):
    with pytest.raises(ConfigurationError, match="tolerance"):
        Session(RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, GOAL, tolerance)


def test_a_tolerance_that_nobody_gave_is_asked_for():
    with pytest.raises(ConfigurationError, match="give tolerance="):
        Session(RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, GOAL)


def test_one_number_for_several_units_is_refused():
    generator = RepeatingGenerator().fit(MIXED, seed=0)
    with pytest.raises(ConfigurationError, match=r"several units; give one for each of .* \[s\]"):
        Session(generator, FullStepAdapter(), MIXED, [0.9, 2.0], 0.02)


def test_a_goal_of_the_wrong_dimension_is_named():
    with pytest.raises(InvalidGoalError, match="2 components"):
        Session(RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS, [0.9], 0.01)


def test_a_log_that_does_not_fit_together_is_refused(session):
    session.tell(session.ask().number, [0.05, 0.0])
    log = Log()
    with pytest.raises(WorkspaceError, match="does not fit the ones before"):
        log.append(session.log.entries()[-1].event)


def test_asking_many_sessions_calls_the_generator_once_and_agrees_with_asking_each():
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    goals = [[0.85, 0.0], [0.9, 0.1], [0.95, -0.1]]
    sessions = [Session(generator, FullStepAdapter(), DEMOS, goal, 0.015) for goal in goals]
    pending = sessions[1].ask()
    trials = ask_all(sessions)
    assert generator.calls == 2
    assert trials[1] is pending
    np.testing.assert_allclose([trial.condition for trial in trials], goals)


def test_each_generator_is_called_once_for_its_own_sessions():
    first, second = (RepeatingGenerator().fit(DEMOS, seed=0) for _ in "ab")
    goals = [[0.85, 0.0], [0.9, 0.1], [0.95, -0.1]]
    sessions = [
        Session(generator, FullStepAdapter(), DEMOS, goal, 0.015)
        for generator, goal in zip((first, second, first), goals, strict=True)
    ]
    trials = ask_all(sessions)
    assert (first.calls, second.calls) == (1, 1)
    np.testing.assert_allclose([trial.plan[0] for trial in trials], goals)


def test_trials_cannot_be_changed_from_outside(session):
    trial = session.ask()
    with pytest.raises(ValueError, match="read-only"):
        trial.plan[0, 0] = 1.0


def test_a_session_cannot_be_asked_twice_at_once(session):
    with pytest.raises(ConfigurationError, match="different ones"):
        ask_all([session, session])
    assert session.ask().number == 1


class CallableAdapter(FullStepAdapter):
    """As a network would be."""

    def __call__(self, x):
        raise AssertionError("is no function that loads an adapter")


def test_a_member_that_can_be_called_is_not_called():
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    session = Session(generator, CallableAdapter(), DEMOS, GOAL, 0.015)
    np.testing.assert_array_equal(session.ask().condition, GOAL)


def test_any_callable_may_load_what_is_used():
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    loaders = [partial(lambda given: given, each) for each in (generator, FullStepAdapter(), DEMOS)]
    session = Session(*loaders, GOAL, 0.015)
    np.testing.assert_array_equal(session.ask().condition, GOAL)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_class_is_no_object(which):
    given = [RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS]
    given[which] = type(given[which])
    with pytest.raises(ConfigurationError, match="is a class; give an object, for instance"):
        Session(*given, GOAL, 0.015)


@pytest.mark.parametrize(
    ("which", "given", "remedy"),
    [
        (0, "auto", r"is no Generator; give one: pr\.make_generator\('auto'\)"),
        (1, "bayes", r"is no Adapter; give one: pr\.make_adapter\('bayes'\)"),
        (1, DEMOS, "is no Adapter; give one"),
        (2, [[0.0]], "is no Demonstrations; give one"),
        (
            2,
            "demos",
            r"is no Demonstrations; give one: pr\.Demonstrations\(plans, outcomes, format",
        ),
    ],
)
def test_a_name_or_another_part_is_no_object_of_its_kind(which, given, remedy):
    parts = [RepeatingGenerator().fit(DEMOS, seed=0), FullStepAdapter(), DEMOS]
    parts[which] = given
    with pytest.raises(ConfigurationError, match=remedy):
        Session(*parts, GOAL, 0.015)


def test_nothing_is_written_into_an_adapter(session):
    session.tell(session.ask().number, [0.05, 0.0])
    session.ask()
    assert set(vars(session.adapter)) == {"_outcome_dim", "_key", "seen"}


class Interrupted(FullStepAdapter):
    """Stops once in the middle of observing."""

    stops = True

    def _observe(self, condition, outcome_seen):
        super()._observe(condition, outcome_seen)
        if self.stops:
            self.stops = False
            raise KeyboardInterrupt


def test_what_an_interrupt_cut_off_is_observed_once():
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    session = Session(generator, Interrupted(), DEMOS, GOAL, 0.015)
    session.tell(session.ask().number, [0.05, 0.0])
    with pytest.raises(KeyboardInterrupt):
        session.ask()
    session.ask()
    assert len(session.adapter.seen) == 1


def test_absurd_errors_are_refused_before_anything_is_told(session):
    number = session.ask().number
    for error in ([1e308, 1e308], [2e6, 0.0]):
        with pytest.raises(InvalidFeedbackError, match="implausibly large"):
            session.tell(number, error)
    assert session.trials[0].stage is Stage.ASKED
    session.tell(number, [0.05, 0.0])


class MeanStepAdapter(FullStepAdapter):
    """Subtracts the mean of all errors, so that a stranger's trial shows."""

    def _propose(self, goal_seen):
        return goal_seen + np.mean([c - seen for c, seen in self.seen] or [[0.0, 0.0]], axis=0)


def test_two_sessions_that_share_an_adapter_go_as_if_each_had_its_own(session):
    adapter = MeanStepAdapter()
    generator = session.generator
    shared = [Session(generator, adapter, DEMOS, GOAL, 0.015) for _ in range(2)]
    alone = [Session(generator, MeanStepAdapter(), DEMOS, GOAL, 0.015) for _ in range(2)]
    errors = np.array([[[0.05, -0.02], [0.01, 0.03]], [[-0.04, 0.0], [0.02, 0.02]]])
    for error in (*errors, np.zeros((2, 2))):
        for sessions in (shared, alone):
            for each, seen in zip(sessions, error, strict=True):
                each.tell(each.ask().number, seen)
    for ours, theirs in zip(shared, alone, strict=True):
        for trial, expected in zip(ours.trials, theirs.trials, strict=True):
            np.testing.assert_array_equal(trial.condition, expected.condition)


class BrokenGenerator(RepeatingGenerator):
    """As a network whose weights were lost."""

    def generate(self, conditions):
        return super().generate(conditions) * np.nan


def test_a_plan_that_holds_no_numbers_is_never_given_out():
    generator = BrokenGenerator().fit(DEMOS, seed=0)
    session = Session(generator, FullStepAdapter(), DEMOS, GOAL, 0.015)
    with pytest.raises(InvalidPlanError, match="hold no numbers"):
        session.ask()
    assert not session.trials


@pytest.mark.slow
def test_threads_may_share_a_session(session):
    """Each tells what it asked for; of each trial one telling counts, and none is lost."""
    told, problems = [], []

    def work():
        for _ in range(25):
            try:
                trial = session.ask()
                session.tell(trial.number, [0.05, 0.0])
                told.append(trial.number)
            except TrialStateError:
                pass  # another was quicker
            except Exception as error:
                problems.append(error)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not problems
    assert sorted(told) == list(range(1, len(told) + 1))
    assert session.n_trials == len(told)


def test_what_another_session_did_is_known(session):
    """`while not session.solved` does not end for a goal that was reached before."""
    generator = RepeatingGenerator().fit(DEMOS, seed=0)
    other = Session(generator, FullStepAdapter(), DEMOS, None, 0.015, log=session.log)
    session.tell(session.ask().number, hit=True)
    assert session.solved
    other.set_goal([1.0, 0.0])
    assert not session.solved
    assert session.goal.tolist() == [1.0, 0.0]
    assert len(session.goals) == 2
    other.ask()
    assert session.open_trial.number == 2
    assert session.trials[0].number == 2


@pytest.mark.slow
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_a_session_in_memory_can_be_copied(copied):
    session = Session(
        SmoothInterpolation().fit(DEMOS, seed=0), BayesianAdapter(), DEMOS, GOAL, 0.015
    )
    session.tell(session.ask().number, "5cm long")
    twin = copied(session)
    assert twin.ask().plan.tolist() == session.ask().plan.tolist()
    twin.tell(2, hit=True)
    assert (twin.solved, session.solved) == (True, False)


def test_printed_it_is_short(session):
    trial = session.ask()
    assert repr(trial) == "Trial(1 for goal 1, asked, condition [0.9, 0.1], plan 3 x 2)"
    assert repr(session) == "Session(goal [0.9, 0.1] not reached, 0 trials told; trial 1 waits)"
    told = session.tell(1, [0.05, 0.0])
    assert "told, condition [0.9, 0.1], error [0.05, 0.0], miss" in repr(told)
    assert repr(session) == "Session(goal [0.9, 0.1] not reached, 1 trial told)"
    assert repr(Session(RepeatingGenerator(), FullStepAdapter(), DEMOS)) == "Session(no goal)"


def test_a_void_needs_no_reason(session):
    assert session.void(session.ask().number).note == ""


def test_an_error_as_large_as_is_expected_is_no_slip():
    """The first throw at a goal twice as far as the demonstration may fall short by metres."""
    turn = turn_and_scale(TurnJoint())
    one = Demonstrations(DEMOS.plans[:1], [[2.0, 0.1]], DEMOS.format, symmetry=turn)
    session = Session(make_generator("auto").fit(one, seed=0), BayesianAdapter(), one)
    session.set_goal(
        [3.9, 0.2], 0.015
    )  # within twice what was shown, whatever a slip of units would be
    error = 1.5 * np.array(session.ask().expected.sd) * [-1.0, 0.0]
    assert error[0] < -1.0  # metres, which from nowhere look like centimetres
    assert session.tell(1, error).reading.error_seen == pytest.approx(error)
    session.ask()
    with pytest.raises(InvalidFeedbackError, match="looks like centimetres"):
        session.tell(2, [-3.9, 0.2])


@pytest.mark.parametrize("outcome", [[0.9, 0.1], [0.91, 0.12], [0.8, 0.0], [1.10, 0.12]])
def test_an_outcome_is_not_taken_for_an_error(session, outcome):
    session.ask()
    with pytest.raises(InvalidFeedbackError, match="looks like where the object ended; give an er"):
        session.tell(1, outcome)
    assert session.n_trials == 0
    session.tell(1, "91 cm long, 12 cm left")  # who says so means it
    with pytest.raises(InvalidFeedbackError, match="looks like where the object ended"):
        session.amend(1, outcome)
    session.amend(1, [0.5, 0.1])


@pytest.mark.parametrize("error", [[5, 2], [0.0, -1.0]])
def test_numbers_of_another_unit_are_no_error(session, error):
    session.ask()
    with pytest.raises(InvalidFeedbackError, match="looks like centimetres; give metres"):
        session.tell(1, error)
    assert session.n_trials == 0
    session.tell(1, "120 cm long")
    with pytest.raises(InvalidFeedbackError, match="looks like centimetres; give metres"):
        session.amend(1, error)


def test_a_goal_is_a_place_in_the_outcomes_units_or_says_its_own(session):
    with pytest.raises(InvalidGoalError, match="x of 105 m looks like centimetres; give metres"):
        session.set_goal([105, 10])
    with pytest.raises(InvalidGoalError, match=r"goal: 105 m is .*say the unit"):
        session.set_goal("105 10")
    assert len(session.goals) == 1
    place = (100 * (GOAL + 0.01)).tolist()
    session.set_goal("{}cm {}cm".format(*place))
    np.testing.assert_allclose(session.goal, GOAL + 0.01)


def test_a_tolerance_of_another_unit_is_refused(session):
    with pytest.raises(ConfigurationError, match=r"tolerance: x of 1\.5 m looks like centimetres"):
        session.set_goal(GOAL, 1.5)
    assert len(session.goals) == 1
