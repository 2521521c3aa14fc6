"""One demonstration is enough: from Python, on contact physics, with words by eye."""

from dataclasses import replace

import numpy as np
import pytest

import prior_reinforce as pr
from prior_reinforce.perception import make_perception
from prior_reinforce.plans.symmetry import TurnJoint, turn_and_scale
from prior_reinforce.simulation.protocol import run_goals


def test_one_demonstration_of_a_throw_reaches_goals_around_it():
    task, eye = pr.make_task("basketball-v1"), make_perception("eye")
    demos = task.demonstrations("A").only([0])
    generator = pr.make_generator("auto").fit(demos, seed=0)
    session = pr.Session(generator, pr.BayesianAdapter(), demos, tolerance=task.tolerance)
    rng, trials = np.random.default_rng(0), []
    for goal in ([1.05, 0.10], [1.15, -0.15], [0.95, 0.15]):
        session.set_goal(goal)
        while not session.solved and session.n_trials < 10:
            trial = session.ask()
            (rollout,) = task.rollout(trial.plan[None], rng)
            session.tell(trial.number, eye.perceive(rollout, session.goal, rng))
        assert session.solved
        trials.append(session.n_trials)
    assert demos.n + np.mean(trials) <= 3.5


def test_after_lost_was_told_the_demonstration_is_moved_half_as_far():
    task = pr.make_task("basketball-v1")
    demos = task.demonstrations("A").only([0])
    generator = pr.make_generator("auto").fit(demos, seed=0)
    session = pr.Session(generator, pr.BayesianAdapter(), demos, [1.3, 0.1], task.tolerance)
    chart, moved = demos.symmetry.chart, []
    for _ in range(2):
        trial = session.ask()
        moved.append(chart.to(trial.condition)[0] - chart.to(demos.outcomes_seen[0])[0])
        session.tell(trial.number, "lost")
    assert moved[1] / moved[0] == pytest.approx(0.5, abs=1e-6)


def _by_eye(task, demos, goals):
    """Trials of each goal, in lock step, from demonstrations that may have a rival."""
    generator = pr.make_generator("auto").fit(demos, seed=0)
    with make_perception("eye") as eye:
        return run_goals(
            task, generator, pr.BayesianAdapter, eye, demos, np.array(goals), rounds=10, seed=0
        )


@pytest.mark.slow
def test_an_axis_that_is_wrong_is_left_for_its_rival_and_that_is_said():
    """A push that is declared to be carried: where the stone lies is the rival."""
    task, base = pr.make_task("curling"), turn_and_scale(TurnJoint())
    shown, goals = task.demonstrations("A").only([3]), [[0.87, -0.14], [0.9, -0.07], [0.98, 0.14]]
    alone = _by_eye(task, shown.with_symmetry(base), goals[:1])
    assert alone[0].solved_at is None
    reached = _by_eye(task, shown.with_symmetry(replace(base, rival=task.symmetry)), goals)
    assert np.mean([goal.solved_at for goal in reached]) <= 4
    taken = [trial for goal in reached for trial in goal.trials if trial.model]
    assert "did not follow" in taken[0].expected.remark
    assert "(0.43, 0.0)" in taken[0].expected.remark


@pytest.mark.slow
def test_a_rival_is_not_taken_up_where_nothing_is_wrong():
    task = pr.make_task("basketball-v1")
    shown = task.demonstrations("A").only([1])
    rival = pr.make_task("curling").symmetry
    demos = shown.with_symmetry(replace(shown.symmetry, rival=rival))
    reached = _by_eye(task, demos, task.sample_goals(12, np.random.default_rng(7)))
    assert not any(
        trial.model or trial.expected.remark for goal in reached for trial in goal.trials
    )


@pytest.mark.slow
def test_a_reading_that_spoke_against_the_axis_and_is_voided_gives_it_back():
    task, base = pr.make_task("curling"), turn_and_scale(TurnJoint())
    shown = task.demonstrations("A").only([3])
    demos = shown.with_symmetry(replace(base, rival=task.symmetry))
    generator = pr.make_generator("auto").fit(demos, seed=0)
    session = pr.Session(generator, pr.BayesianAdapter(), demos, [0.87, -0.14], task.tolerance)
    first = session.ask()
    session.tell(first.number, "lost")
    session.tell(session.ask().number, "lost")
    second = session.ask()
    assert (first.model, second.model) == ("", "rival")
    session.void(second.number)
    session.void(first.number)
    assert session.ask().model == ""
