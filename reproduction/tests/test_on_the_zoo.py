"""What the package makes of the zoo: timing, patterns, the default generator, the adapter."""

from functools import partial

import numpy as np
import pytest

from prior_reinforce.adapters import displacement
from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.generators.auto import Auto
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.patterns import patterns
from prior_reinforce.generators.timing.evidence import choose_timing
from prior_reinforce.generators.timing.timeline import decompose
from prior_reinforce.perception.exact import Exact
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.simulation.protocol import run_goals
from prior_reinforce.simulation.tasks import make_task


def test_what_demonstrations_do_not_rest_in_is_played_on():
    demos = make_task("zoo-scoop").demonstrations("cut-6-0")
    assert not decompose(demos, "start").timeline.rests[1]


@pytest.mark.parametrize(
    ("task", "name", "why"),
    [
        ("zoo-push", "tempo-6-1", "(start), as a rule"),  # tempo tells better, not by half
        ("zoo-drag", "clean-8-0", "(tempo); other timings would do equally well here"),
    ],
)
def test_the_reason_is_no_better_than_the_evidence(task, name, why):
    assert choose_timing(make_task(task).demonstrations(name)).reason.endswith(why)


@pytest.mark.parametrize("kind", ["styles-9-0", "outlier-8-0", "mixed-8-0"])
def test_two_manners_of_one_throw_are_one_pattern(kind):
    assert len(patterns(make_task("zoo-scoop").demonstrations(kind))) == 1


@pytest.mark.parametrize("name", ["zoo-sidearm", "zoo-overarm", "zoo-bank"])
def test_two_ways_are_told_apart_by_what_each_tells_of_its_own(name):
    """Motions that return, whose mirror image correlates with them at a delay."""
    demos = make_task(name).demonstrations("ways-12-101")
    one, other = patterns(demos)
    assert len(one) == len(other) == 6
    turns = demos.plans[:, :, 1 if name == "zoo-overarm" else 0]
    far = turns[np.arange(12), np.abs(turns - turns[:, :1]).argmax(axis=1)]
    assert max(far[list(one)]) < min(far[list(other)]) or min(far[list(one)]) > max(
        far[list(other)]
    )


@pytest.mark.parametrize("task", ["zoo-push", "zoo-gripper", "zoo-strike"])
def test_one_pattern_is_learned_in_closed_form_and_comes_back(task):
    demos = make_task(task).demonstrations("mixed-8-0")
    made = Auto().fit(demos, seed=0)
    assert isinstance(made.generator.generator, SmoothInterpolation)
    off = made.generate(demos.outcomes_seen) - demos.plans
    assert np.sqrt(np.mean(off**2, axis=1)).max() < 1e-4
    assert made.remarks[0].startswith("generator: closed form")
    assert made.remarks[1].startswith("timing:")


def test_it_is_loaded_as_it_was_learned(tmp_path):
    demos: Demonstrations = make_task("zoo-slide").demonstrations("tempo-5-1")
    made = make_generator("auto").fit(demos, seed=0)
    made.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert loaded.remarks == made.remarks
    np.testing.assert_array_equal(
        loaded.generate(demos.outcomes_seen), made.generate(demos.outcomes_seen)
    )


def test_ways_that_do_not_mix_are_each_learned_in_closed_form(tmp_path):
    """A plan is of the way with the nearest outcome: nothing of the other is in it."""
    demos = make_task("zoo-sidearm").demonstrations("ways-12-101")
    made = Auto().fit(demos, seed=0)
    assert "within each of 2 patterns that do not mix" in made.remarks[0]
    off = made.generate(demos.outcomes_seen) - demos.plans
    assert np.sqrt(np.mean(off**2, axis=1)).max() < 1e-3
    goals = make_task("zoo-sidearm").sample_goals(20, np.random.default_rng(7000))
    landed = make_task("zoo-sidearm").rollout(made.generate(goals), None)
    errors = [np.linalg.norm(r.outcome - goal) for r, goal in zip(landed, goals, strict=True)]
    assert np.max(errors) < 0.1  # of all twelve mixed, a third of a metre in the median
    made.save(tmp_path)
    np.testing.assert_array_equal(load_generator(tmp_path).generate(goals), made.generate(goals))


def test_no_condition_is_far_from_its_goal(monkeypatch):
    """Two demonstrations lie a tenth of a millimetre apart; cubic weights of them are a cliff."""
    monkeypatch.setattr(displacement, "smooth_weights", partial(smooth_weights, kernel="cubic"))
    task = make_task("zoo-slide")
    demonstrations = task.demonstrations("scattered-6-1").without_symmetry()
    generator = make_generator("interpolation,kernel=cubic").fit(demonstrations, seed=0)
    goals = task.sample_goals(30, np.random.default_rng([0, 1]))
    results = run_goals(
        task, generator, BayesianAdapter, Exact(), demonstrations, goals, rounds=8, seed=0
    )
    spread = demonstrations.outcomes_seen.std()
    for result in results:
        away = [abs(float(trial.condition[0] - result.goal[0])) for trial in result.trials]
        assert max(away) <= (6.0 + 0.7) * spread  # a correction, and a search beside it
