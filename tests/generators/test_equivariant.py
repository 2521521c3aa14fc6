"""Generators that learn what a symmetry leaves."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.generators.base import Wrapper
from prior_reinforce.generators.equivariant import Equivariant, padded
from prior_reinforce.plans.symmetry import (
    Learned,
    Shift,
    Tempo,
    TurnIncrements,
    TurnJoint,
    scale_alone,
    shift,
    turn_and_scale,
)
from prior_reinforce.session.session import Session
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.testing import synthetic_demonstrations

TURN = turn_and_scale(TurnJoint(2), scale=Tempo(exponent=1.0))
QUICK = "diffusion,training_steps=3"


def thrown(throws, n):
    """Throws whose third joint is their bearing, and whose amplitude is their distance."""
    demos = throws(n)
    reach, side = demos.outcomes_seen.T
    outcomes = np.column_stack([reach * np.cos(side), reach * np.sin(side)])
    return replace(demos, outcomes_seen=outcomes, symmetry=TURN)


@pytest.mark.parametrize("n", [2, 3, 6])
def test_demonstrations_come_back_and_turns_are_exact_at_any_bearing(throws, n):
    demos = thrown(throws, n)
    generator = make_generator("auto,symmetry=use").fit(demos, seed=0)
    at_home = generator.generate(demos.outcomes_seen)
    if n > 3:  # three and fewer are aligned first
        np.testing.assert_allclose(at_home, demos.plans, atol=0.02)
    z = TURN.chart.to(demos.outcomes_seen)
    turned = generator.generate(TURN.chart.back(z + np.array([0.0, 1.0])))
    np.testing.assert_allclose(turned, at_home + np.eye(3)[2], atol=1e-9)


def test_beyond_the_hull_plans_are_moved_from_its_edge(throws):
    demos = thrown(throws, 4)
    generator = make_generator("auto").fit(demos, seed=0)
    far = float(np.linalg.norm(demos.outcomes_seen, axis=1).max())
    (edge,) = generator.generate([[far, 0.0]])
    (beyond,) = generator.generate([[1.2 * far, 0.0]])
    np.testing.assert_allclose(beyond, TURN.move(edge, np.array([np.log(1.2), 0.0])), atol=1e-9)


def test_with_a_turn_alone_the_rest_is_extrapolated_by_what_was_learned(throws):
    """As without a symmetry: no plan is played faster, none stays at the edge."""
    demos = thrown(throws, 6).with_symmetry(turn_and_scale(TurnJoint(2), scale=Learned()))
    generator = make_generator("auto").fit(demos, seed=0)
    far = float(np.linalg.norm(demos.outcomes_seen, axis=1).max())
    edge, beyond = generator.generate([[far, 0.0], [1.1 * far, 0.0]])
    (mixed,) = generator.generator.generate([[np.log(1.1 * far)]])
    home = TURN.chart.to(demos.outcomes_seen)[:, 1].mean()
    np.testing.assert_allclose(beyond, mixed - home * np.eye(3)[2], atol=1e-9)
    assert np.abs(beyond - edge).max() > 0.01
    (turned,) = generator.generate(1.1 * far * np.array([[np.cos(1.0), np.sin(1.0)]]))
    np.testing.assert_allclose(turned, beyond + np.eye(3)[2], atol=1e-9)
    with pytest.raises(InvalidDemonstrationsError, match="more than 1 that differ in it, or leave"):
        make_generator("auto").fit(demos.only([0]), seed=0)


@pytest.mark.parametrize("choice", ["auto", QUICK])
def test_one_demonstration_is_moved(throws, choice):
    one = thrown(throws, 4).only([2])
    generator = make_generator(choice).fit(one, seed=0)
    np.testing.assert_array_equal(generator.generate(one.outcomes_seen), one.plans)
    z = TURN.chart.to(one.outcomes_seen)[0]
    w = np.array([-0.2, 0.4])
    (moved,) = generator.generate(TURN.chart.back(z + w)[None])
    np.testing.assert_allclose(moved, TURN.move(one.plans[0], w), atol=1e-9)
    assert "one place" not in generator.remarks[0]
    assert "the demonstration is moved" in generator.remarks[0]


@pytest.mark.parametrize("name", ["interpolation", "diffusion-paper"])
def test_one_demonstration_is_refused_by_name_without_the_layer(throws, name):
    one = thrown(throws, 4).only([0])
    for demos in (one, one.without_symmetry()):
        with pytest.raises(InvalidDemonstrationsError, match=r"at least two.*learn with auto"):
            make_generator(name).fit(demos, seed=0)
    with pytest.raises(InvalidDemonstrationsError, match="at least two"):
        make_generator("auto").fit(one.without_symmetry(), seed=0)


def test_a_plan_alone_is_not_padded_and_rests_in_a_batch(throws):
    generator = make_generator("auto").fit(thrown(throws, 4).only([1]), seed=0)
    goals = np.array([[0.4, 0.0], [0.9, 0.0], [1.3, 0.2]])
    batch = generator.generate(goals)
    alone = [generator.generate(goal[None])[0] for goal in goals]
    assert len({len(plan) for plan in alone}) > 1
    for plan, rested in zip(alone, batch, strict=True):
        np.testing.assert_array_equal(rested[: len(plan)], plan)
        assert not np.diff(rested[len(plan) - 1 :], axis=0).any()
    assert generator.generate(np.empty((0, 2))).shape == (0, 140, 3)


def test_where_a_clock_releases_one_is_moved_and_between_two_both_are_and_are_mixed(throws):
    clocked = turn_and_scale(TurnJoint(2), scale=Tempo(1.0, about=70.0, keep_horizon=True))
    demos = replace(thrown(throws, 4), symmetry=clocked)
    two = demos.only(np.argsort(np.linalg.norm(demos.outcomes_seen, axis=1))[[0, 3]].tolist())
    generator, z = make_generator("auto").fit(two, seed=0), clocked.chart.to(two.outcomes_seen)
    np.testing.assert_array_equal(generator.generate(two.outcomes_seen), two.plans)
    (plan,) = generator.generate(clocked.chart.back(z.mean(axis=0)[None]))
    both = [clocked.move(p, z.mean(axis=0) - of) for p, of in zip(two.plans, z, strict=True)]
    np.testing.assert_allclose(plan, np.mean(both, axis=0), atol=1e-9)


def test_increments_rest_at_nothing():
    short, long = np.ones((2, 2)), np.ones((4, 2))
    stacked = padded([short, long], increments=(1,))
    np.testing.assert_array_equal(stacked[0], [[1, 1], [1, 1], [1, 0], [1, 0]])


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize("choice", ["auto", QUICK])
def test_it_is_loaded_as_it_was_learned(throws, choice, n, tmp_path):
    demos = thrown(throws, 4).only(range(n))
    generator = make_generator(choice).fit(demos, seed=0)
    generator.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert isinstance(loaded, Equivariant)
    assert loaded.remarks == generator.remarks
    goals = np.array([[0.8, 0.1], [1.3, -0.4]])
    np.testing.assert_array_equal(loaded.generate(goals), generator.generate(goals))


def test_without_a_symmetry_it_is_the_generator_that_it_wraps(throws):
    demos = throws(6)
    bare = make_generator("auto,symmetry=none").fit(demos, seed=0)
    layered = make_generator("auto").fit(demos, seed=0)
    goals = demos.outcomes_seen[:2] + 0.01
    np.testing.assert_array_equal(layered.generate(goals), bare.generate(goals))
    assert layered.remarks == bare.remarks


class Around(Wrapper):
    name = "around"

    def _fit(self, demonstrations, seed, progress):
        raise NotImplementedError

    _generate = _fit


def test_auto_finds_the_turn_that_throws_show(tmp_path):
    shown = make_task("basketball-v1").demonstrations("A").without_symmetry()
    made = make_generator("auto").fit(shown, seed=0)
    assert "joint1 turns with the outcome's bearing" in made.remarks[0]
    goal, angle = np.array([1.0, 0.05]), 0.7  # turned by that, far outside the hull
    cos, sin = np.cos(angle), np.sin(angle)
    goals = np.stack([goal, [[cos, -sin], [sin, cos]] @ goal])
    plan, turned = made.generate(goals)
    np.testing.assert_allclose(turned - plan, [[angle, *[0.0] * 6]] * len(plan), atol=1e-9)
    made.save(tmp_path)
    loaded = load_generator(tmp_path)
    np.testing.assert_array_equal(loaded.generate(goals), made.generate(goals))
    assert repr(made) == "Equivariant(Auto(Timed(SmoothInterpolation(fitted))))"
    for choice in ("auto,symmetry=none", "interpolation,symmetry=use"):
        other = make_generator(choice).fit(shown, seed=0)
        assert not any("bearing" in remark for remark in other.remarks)
        assert other.with_symmetry_used(shown) is shown
    assert loaded.with_symmetry_used(shown).sha256 == made.with_symmetry_used(shown).sha256
    session = Session(made, BayesianAdapter(), shown, [1.0, 0.05], 0.015)
    assert session.informed_adapter().symmetry_odds["as stated"] > 0.8  # the adapter knows of it
    around = Around(made)  # of one's own: it knows by what it wraps
    assert around.with_symmetry_used(shown).sha256 == made.with_symmetry_used(shown).sha256


def test_the_switch_gives_what_is_learned_from_demonstrations_alone(throws):
    demos = thrown(throws, 6)
    plain = make_generator("auto").fit(demos.without_symmetry(), seed=0)
    none = make_generator("auto,symmetry=none").fit(demos, seed=0)
    goals = demos.outcomes_seen[:2] + 0.01
    np.testing.assert_array_equal(plain.generate(goals), none.generate(goals))


@pytest.mark.parametrize(
    ("symmetry", "k"),
    [
        (shift(), 2),
        (scale_alone(), 1),
        (turn_and_scale(TurnIncrements(), scale=Tempo(increments=(0, 1))), 2),
        (turn_and_scale(TurnJoint(), others=(Shift(1),)), 3),
    ],
    ids=lambda each: getattr(each, "name", None),
)
@pytest.mark.parametrize("n", [1, 5])
def test_every_symmetry_gives_finite_plans_for_goals_around(symmetry, k, n):
    demos = synthetic_demonstrations(5, k=k)
    demos = demos.only(range(n)) if n > 1 else demos.with_symmetry(symmetry).only([0])
    demos = demos.with_symmetry(symmetry)
    generator = make_generator("auto").fit(demos, seed=0)
    goals = demos.outcomes_seen[[0]] * np.linspace(0.7, 1.4, 5)[:, None]
    plans = generator.generate(goals)
    assert plans.shape[::2] == (5, 3)
    assert np.all(np.isfinite(plans))


def test_motions_that_differ_by_a_whole_turn_of_the_joint_are_mixed_as_one(throws):
    """Behind the arm, one person's 178 degrees are another's -182."""
    shown = thrown(throws, 4)
    behind = turn_and_scale(TurnJoint(2, range=(-2 * np.pi, 2 * np.pi)), scale=Learned())
    apart = shown.plans + np.pi * np.eye(3)[2]
    apart[::2, :, 2] -= 2 * np.pi
    demos = replace(shown, plans=apart, outcomes_seen=-shown.outcomes_seen, symmetry=behind)
    (plan,) = make_generator("auto").fit(demos, seed=0).generate(-shown.outcomes_seen[:1])
    off = (plan[0, 2] - apart[0, 0, 2]) / (2 * np.pi)
    assert off == pytest.approx(round(off), abs=0.02)
