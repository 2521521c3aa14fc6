from functools import partial

import numpy as np
import pytest
from scipy.stats import norm

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.adapters.displacement import BayesianConfig
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading

CORNERS = np.array([[0.8, -0.2], [0.8, 0.0], [0.8, 0.2], [1.0, -0.2], [1.0, 0.0], [1.0, 0.2]])
GOAL = np.array([0.9, 0.05])
TOLERANCE = 0.015


def started(outcomes=CORNERS, units=(), noise=(), correction=(), **settings) -> BayesianAdapter:
    plans = np.random.default_rng(0).normal(size=(len(outcomes), 4, 1))
    format_ = PlanFormat(("j1",), ("rad",), 0.02)
    adapter = BayesianAdapter(BayesianConfig(**settings))
    adapter.start(
        Demonstrations(
            plans,
            outcomes,
            format_,
            OutcomeFormat(tuple("xyz"[: len(units)]), units),
            outcome_noise=np.reshape(noise, (-1, outcomes.shape[1])),
            outcome_correction=np.reshape(correction, (-1, outcomes.shape[1])),
        )
    )
    return adapter


def throw(adapter, goal, moved, seen=Reading.by_eye, words=True):
    """One trial where outcomes are condition plus `moved`; by eye, or as `seen` makes a reading."""
    condition = adapter.propose(goal)
    error = condition + moved - goal
    if words:
        steps = np.array([0.0, 0.02, 0.05, 0.1, 0.2])
        nearest = np.abs(np.abs(error)[:, None] - steps).argmin(axis=1)
        error = np.sign(error) * steps[nearest] + 0.0
    adapter.observe(condition, goal, seen(error))
    return condition


def test_the_first_condition_is_the_goal():
    for goal in np.random.default_rng(0).uniform([0.7, -0.3], [1.1, 0.3], size=(20, 2)):
        np.testing.assert_allclose(started().propose(goal), goal, atol=1e-9)


def test_what_labels_say_to_be_off_is_corrected_from_the_first_throw_on():
    adapter = started(noise=np.full((6, 2), 0.02), correction=np.full((6, 2), [0.0125, -0.01]))
    np.testing.assert_allclose(adapter.propose(GOAL), GOAL - [0.0125, -0.01], atol=1e-4)


@pytest.mark.parametrize("units", [("s",), ("m", "rad"), ("m", "m", "deg")])
def test_a_correction_is_in_each_components_own_unit(units):
    off, spread = np.array([0.0125, -0.3, 20.0])[: len(units)], [1.0, 30.0, 2000.0]
    outcomes = np.random.default_rng(1).uniform(0.0, 1.0, (6, len(units))) * spread[: len(units)]
    adapter = started(outcomes, units, correction=np.tile(off, (6, 1)))
    goal = outcomes.mean(axis=0)
    np.testing.assert_allclose(adapter.propose(goal), goal - off, atol=1e-4 * spread[-1])


@pytest.mark.parametrize("trials", [0, 6, 12])
@pytest.mark.parametrize("hit_or_miss", [False, True])
def test_beyond_what_labels_say_everything_is_learned_as_without(trials, hit_or_miss):
    """Goals that lie as much farther, and the same readings, give as much more displacement."""
    slope, shift, noise = np.array([[0.1, 0.02], [0.0, -0.05]]), [0.01, 0.0], np.full((6, 2), 0.02)
    known = started(noise=noise, correction=CORNERS @ slope + shift)
    plain = started(noise=noise)
    rng = np.random.default_rng(0)
    for condition in rng.uniform([0.8, -0.2], [1.0, 0.2], size=(trials, 2)):
        reading = Reading.by_eye(rng.choice([-0.05, 0.0, 0.02], size=2))
        if hit_or_miss:
            reading = Reading.only(False, 2).within(np.full(2, TOLERANCE))
        plain.observe(condition, condition, reading)
        known.observe(condition, condition + condition @ slope + shift, reading)
    places = rng.uniform([0.8, -0.2], [1.0, 0.2], size=(10, 2))
    more = places @ slope + shift
    np.testing.assert_allclose(
        known.displacement(places), plain.displacement(places) + more, atol=1e-7
    )
    np.testing.assert_allclose(
        known.p_hit(places, places + more, TOLERANCE), plain.p_hit(places, places, TOLERANCE),
        atol=1e-7,
    )  # fmt: skip


def test_a_shift_of_six_centimetres_is_found_in_three_trials_by_eye():
    adapter, shift = started(), np.array([-0.06, 0.02])
    for _ in range(3):
        throw(adapter, GOAL, shift)
    assert np.linalg.norm(adapter.propose(GOAL) + shift - GOAL) < TOLERANCE


def test_what_was_learned_for_one_goal_serves_another():
    adapter, shift = started(), np.array([-0.06, 0.02])
    for goal in (GOAL, [0.85, -0.1], [0.95, -0.05]):
        for _ in range(3):
            throw(adapter, np.array(goal), shift)
    other = np.array([0.95, 0.15])
    assert np.linalg.norm(adapter.propose(other) + shift - other) < 0.02


def after_two_hits(seen=Reading.measured) -> BayesianAdapter:
    adapter = started()
    for goal in (GOAL, np.array([0.85, -0.1])):
        adapter.observe(goal, goal, seen([0.0, 0.0]))
    return adapter


@pytest.mark.parametrize("size", [0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("seen", [Reading.by_eye, partial(Reading.measured, sd=0.002)])
def test_a_table_that_is_bumped_unsaid_is_hit_again_in_a_few_throws(size, seen):
    """One reading may be obeyed or not, a second that agrees is; P(hit) does not rise meanwhile."""
    adapter, shift = after_two_hits(), np.array([0.8, -0.6]) * size
    said, off = [], []
    for _ in range(5):
        condition = adapter.propose(GOAL)
        said.append(adapter.expect(condition, GOAL, TOLERANCE).p_hit)
        off.append(np.linalg.norm(condition + shift - GOAL))
        throw(adapter, GOAL, shift, seen, words=seen is Reading.by_eye)
    assert off[2] < 0.4 * off[0] + TOLERANCE
    assert min(off) < TOLERANCE
    assert said[1] < said[0]
    other = np.array([0.95, 0.15])
    assert np.linalg.norm(adapter.propose(other) + shift - other) < 0.15 * size + TOLERANCE


def test_a_reading_that_the_next_ones_contradict_was_told_wrongly():
    adapter, seen = after_two_hits(), partial(Reading.measured, sd=0.002)
    adapter.observe(adapter.propose(GOAL), GOAL, Reading.measured([0.3, -0.1], 0.002))
    throw(adapter, GOAL, np.zeros(2), seen, words=False)
    assert np.linalg.norm(adapter.propose(GOAL) - GOAL) < TOLERANCE
    assert 2 in adapter._trials._histories[0].mistaken
    assert adapter.expect(adapter.propose(GOAL), GOAL, TOLERANCE).p_hit > 0.5


def test_a_reading_far_from_what_was_believed_is_news_until_the_next_one():
    """What is expected of a trial, and how surely, is what a surprise is held against."""
    adapter, seen = after_two_hits(), partial(Reading.measured, sd=0.002)
    jump = np.array([0.16, -0.12])
    condition = adapter.propose(GOAL)
    expected = adapter.expect(condition, GOAL, TOLERANCE)
    assert np.linalg.norm(expected.error) < TOLERANCE
    assert np.linalg.norm((condition + jump - GOAL - expected.error) / expected.sd) > 5
    throw(adapter, GOAL, jump, seen, words=False)
    again = adapter.expect(condition, GOAL, TOLERANCE)
    assert np.linalg.norm((condition + jump - GOAL - again.error) / again.sd) < 2
    assert again.p_hit < 0.6


def test_where_nothing_learned_leads_to_the_goal_what_was_demonstrated_is_tried():
    """A motion that lost its object says where it lost it, and points away from everywhere."""
    adapter, goal = started(), np.array([0.97, -0.12])
    lost = Reading.measured([-0.35, 0.12], 0.002, hit=False).within(np.full(2, TOLERANCE))
    for _ in range(6):
        adapter.observe(adapter.propose(GOAL), GOAL, lost)
    assert np.linalg.norm(adapter.propose(goal) - goal) < 0.1


def test_a_goal_that_was_moved_is_told_from_a_table_that_was():
    adapter, moved = after_two_hits(), np.array([0.1, 0.1])
    seen = partial(Reading.measured, sd=0.002)
    for _ in range(2):
        throw(adapter, GOAL, moved, seen, words=False)
    other = np.array([0.85, -0.1])
    throw(adapter, other, np.zeros(2), seen, words=False)
    assert np.linalg.norm(adapter.propose(other) - other) < TOLERANCE
    assert np.linalg.norm(adapter.propose(GOAL) + moved - GOAL) < TOLERANCE


def test_after_a_change_that_is_said_less_is_sure():
    adapter, shift = started(), np.array([-0.07, 0.03])
    for condition in np.random.default_rng(1).uniform([0.8, -0.2], [1.0, 0.2], size=(12, 2)):
        adapter.observe(condition, condition, Reading.measured(shift, 0.001))
    condition = adapter.propose(GOAL)
    assert np.linalg.norm(condition + shift - GOAL) < 0.01
    sure = adapter.expect(condition, GOAL, TOLERANCE)
    assert sure.p_hit > 0.7
    assert sure.trials == pytest.approx(1 + 1.24 * (1 - sure.p_hit))
    adapter.change_hardware()
    assert adapter.expect(condition, GOAL, TOLERANCE).p_hit < 0.3
    np.testing.assert_allclose(adapter.propose(GOAL), condition, atol=0.005)


@pytest.mark.parametrize("before", [0, 20])
def test_a_change_that_is_said_is_expected_however_long_nothing_had_changed(before):
    adapter, shift = started(), np.array([0.06, -0.04])
    rng = np.random.default_rng(1)
    for condition in rng.uniform(CORNERS.min(axis=0), CORNERS.max(axis=0), size=(before, 2)):
        adapter.observe(condition, condition, Reading.measured([0.0, 0.0], 0.005))
    adapter.change_hardware()
    assert adapter.expect(GOAL, GOAL, TOLERANCE).p_hit < 0.3
    throw(adapter, GOAL, shift)
    assert np.linalg.norm(adapter.propose(GOAL) + shift - GOAL) < 0.025


def test_what_a_demonstration_would_teach_is_what_adding_it_takes_off():
    places = np.random.default_rng(0).uniform([0.8, -0.2], [1.0, 0.2], size=(40, 2))
    new = np.array([[0.9, 0.1], [1.05, 0.25], [0.801, 0.2]])  # the last beside another
    adapter = started()
    gains = adapter.gain(new, places, demonstrations=True)
    before = adapter._trials._mean_variance(
        adapter._trials._inputs(*[adapter._trials._normalisation.apply(places)] * 2)
    )
    for one, gain in zip(new, gains, strict=True):
        more = started(np.vstack([CORNERS, one]))
        same = adapter._trials._normalisation  # a seventh changes the spread a little
        more._trials._prior.normalisation = more._trials._normalisation = same
        more._trials._prior._set_demonstrations(
            same.apply(np.vstack([CORNERS, one])), np.zeros((7, 2)), np.zeros((7, 2))
        )
        after = more._trials._mean_variance(more._trials._inputs(*[same.apply(places)] * 2))
        assert gain == pytest.approx(1 - after / before, abs=1e-9)


def test_labels_that_are_off_are_found_as_the_mixture_that_they_make():
    """Where labels are off the field is their spline: four readings tell of all of it."""
    noise = np.full_like(CORNERS, 0.03)
    weights = smooth_weights(CORNERS, noise=noise)
    places = np.random.default_rng(0).uniform([0.8, -0.2], [1.0, 0.2], size=(40, 2))
    for seed in range(4):
        off = np.random.default_rng(seed).normal(0.0, 0.03, size=CORNERS.shape)
        adapter = started(noise=noise)
        for condition in np.array([[0.82, -0.18], [0.98, -0.1], [0.82, 0.02], [0.9, 0.1]]):
            moved = (weights(condition[None]) @ off)[0]
            adapter.observe(condition, condition, Reading.measured(moved, 0.001))
        conditions = np.array([adapter.propose(goal) for goal in places])
        left = conditions + weights(conditions) @ off - places
        assert np.linalg.norm(left) < 0.3 * np.linalg.norm(weights(places) @ off)


def test_a_generator_that_is_wrong_in_its_own_ways_is_not_taken_for_labels():
    """A wave that no mixture of six labels makes: models of greater size are left."""
    adapter = started()

    def moved(c):
        return 0.05 * np.array([np.sin(40 * c[1]), np.cos(40 * c[0])])

    rng = np.random.default_rng(4)
    for condition in rng.uniform(CORNERS.min(axis=0), CORNERS.max(axis=0), size=(20, 2)):
        adapter.observe(condition, condition, Reading.measured(moved(condition), 0.002))
    greater = adapter._trials._prior.generator_variance > 0.1**2
    weights = adapter._trials._histories[0].posterior.model_weights
    assert np.all(weights[greater].sum(axis=0) > 0.99)


def test_one_component_may_be_far_off_where_the_other_is_not():
    adapter = started()
    for condition in np.random.default_rng(0).uniform([0.8, -0.2], [1.0, 0.2], size=(8, 2)):
        off = 0.15 * (condition[1] / 0.2) ** 2
        adapter.observe(condition, condition, Reading.measured([off, 0.0], 0.001))
    weights = adapter._trials._histories[0].posterior.model_weights
    of_greater = weights[adapter._trials._prior.generator_variance > 0.1**2].sum(axis=0)
    assert of_greater[0] > 0.99
    assert of_greater[1] < 0.2


def predicted(adapter, conditions):
    """Weights of models, and variances of displacements there, most probably."""
    at = adapter._trials._normalisation.apply(conditions)
    best, places = adapter._trials._histories[0], adapter._trials._inputs(at, at)
    _, variance = best.predict(adapter._trials._prior, places, adapter._trials._memory)
    return best.posterior.model_weights, variance


def test_what_the_demonstrations_hardware_did_is_no_shift():
    """Demonstrations say c = r of their own day: a shift of today does not contradict them."""
    adapter, shift = started(), np.array([0.08, 0.0])
    for goal in ([0.85, -0.1], [0.95, 0.1]):
        for _ in range(2):
            throw(adapter, np.array(goal), shift)
    at_a_demonstration = CORNERS[1]
    moved = at_a_demonstration - adapter.propose(at_a_demonstration)
    np.testing.assert_allclose(moved, shift, atol=0.025)


def test_hardware_beforehand_moves_no_first_throw_but_what_is_said_of_it():
    """Before any trial every model expects the same landing; sizes say only how surely."""
    often, seldom = started(p_changed=0.2), started(p_changed=0.05)
    goal = np.array([0.93, 0.04])
    condition = often.propose(goal)
    np.testing.assert_array_equal(seldom.propose(goal), condition)
    said = [adapter.p_hit(condition[None], goal[None], 0.02)[0] for adapter in (often, seldom)]
    assert said[1] > said[0] + 0.02


def test_p_hit_of_one_component_by_hand():
    adapter = started(np.array([[0.0], [2.0], [1.0], [3.0]]))
    condition, goal = np.array([1.4]), np.array([1.5])
    _, variance = predicted(adapter, condition[None])
    sd = adapter._trials._normalisation.scale[0] * np.sqrt(variance[:, 0, 0])
    inside = norm.cdf(1.6, condition[0], sd) - norm.cdf(1.4, condition[0], sd)
    less = np.array([1.0, 2 / 3, 4 / 9]) / (1 + 2 / 3 + 4 / 9)
    expected = inside @ np.kron(less, np.kron([0.8, 0.2], less))  # size, hardware, noise
    assert adapter.expect(condition, goal, 0.1).p_hit == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("tolerance", [np.full(3, 0.05), np.array([0.03, 0.2, 0.06])])
@pytest.mark.parametrize("k", [2, 3])
def test_p_hit_is_the_share_of_sampled_outcomes_within_the_tolerance(k, tolerance):
    rng = np.random.default_rng(k)
    adapter = started(rng.uniform(size=(8, k)))
    goal = np.full(k, 0.5)
    for _ in range(3):
        throw(adapter, goal, 0.05 * np.ones(k))
    condition = adapter.propose(goal) + 0.03
    inside = []
    for share, history in adapter._trials._weighted_histories():
        at = adapter._trials._inputs(adapter._trials._normalisation.apply(condition[None]), goal)
        mean, variance = history.predict(adapter._trials._prior, at, adapter._trials._memory)
        weights = history.posterior.model_weights
        moved = np.empty((200_000, k))
        for j in range(k):
            model = rng.choice(len(mean), p=weights[:, j], size=len(moved))
            moved[:, j] = rng.normal(mean[model, j, 0], np.sqrt(variance[model, j, 0]))
        landed = condition + adapter._trials._normalisation.scale * moved
        off = (landed - goal) / tolerance[:k]
        inside.append(share * np.mean(np.linalg.norm(off, axis=1) <= 1.0))
    said = adapter.expect(condition, goal, tolerance[:k]).p_hit
    assert said == pytest.approx(sum(inside), abs=0.01)


def test_what_missed_in_one_component_is_searched_beside_by_its_own_tolerance():
    """A metre and a second, of which 2 cm and 0.2 s count: what missed is as far to the side."""
    adapter = started(CORNERS * [1.0, 10.0], units=("m", "s"))
    goal, tolerance, tried = GOAL * [1.0, 10.0], np.array([0.02, 0.2]), []
    for _ in range(4):
        tried.append(adapter.propose(goal))
        adapter.observe(tried[-1], goal, Reading.only(False, 2).within(tolerance))
    apart = np.array(tried)[:, None] - tried
    apart = np.linalg.norm(apart / tolerance, axis=-1)[np.triu_indices(4, 1)]
    assert apart.min() > 0.3
    assert adapter.expect(tried[0], goal, tolerance).p_hit < 0.3


def test_p_hit_grows_with_the_tolerance_and_with_what_is_known():
    adapter = started()
    p = [adapter.expect(GOAL, GOAL, tolerance).p_hit for tolerance in (0.005, 0.015, 0.05, 0.5)]
    assert np.all(np.diff(p) > 0)
    assert p[-1] == pytest.approx(1.0, abs=0.03)
    for _ in range(4):
        throw(adapter, GOAL, np.array([0.02, 0.0]), Reading.measured, words=False)
    condition = adapter.propose(GOAL)
    assert adapter.expect(condition, GOAL, 0.015).p_hit > 0.9 > p[1]
    assert adapter.expect(condition + 0.1, GOAL, 0.015).p_hit < 0.05


def test_what_a_reading_would_teach_is_what_it_takes_off_the_variance():
    adapter = started(noise=np.full((6, 2), 0.02), generator_sd=(1e-6,), hardware_sd=(0.3, 0.3))
    throw(adapter, GOAL, np.array([0.03, 0.0]))
    region = np.random.default_rng(0).uniform([0.8, -0.2], [1.0, 0.2], size=(40, 2))
    at = np.array([0.85, -0.12])
    (gain,) = adapter.gain(at[None], region)
    before = adapter._trials._mean_variance(
        adapter._trials._inputs(*[adapter._trials._normalisation.apply(region)] * 2)
    )
    sd = 0.1 * adapter._trials._normalisation.scale
    adapter.observe(at, at, Reading.measured([0.0, 0.0], sd))
    after = adapter._trials._mean_variance(
        adapter._trials._inputs(*[adapter._trials._normalisation.apply(region)] * 2)
    )
    assert gain == pytest.approx(1 - after / before, abs=0.02)


def test_the_displacement_is_what_outcomes_were_off_by_and_of_which_hardware_is_a_part():
    adapter, shift = started(), np.array([0.06, -0.03])
    for corner in CORNERS:
        adapter.observe(corner, corner, Reading.measured(shift, 0.001))
    np.testing.assert_allclose(adapter.displacement(CORNERS), np.tile(shift, (6, 1)), atol=0.004)
    of_old = adapter.displacement(CORNERS, hardware=False)
    assert np.linalg.norm(of_old, axis=1).max() < 0.5 * np.linalg.norm(shift)


def test_a_throw_teaches_more_than_a_demonstration_where_hardware_changed():
    adapter = started(hardware_sd=(0.5, 0.5))
    region = np.random.default_rng(0).uniform([0.8, -0.2], [1.0, 0.2], size=(40, 2))
    throws, shown = (adapter.gain(region, region, demonstrations=d) for d in (False, True))
    assert throws.max() > 3 * shown.max()
    assert np.all(throws > 0)


def test_a_demonstration_teaches_where_there_is_none_and_not_beside_another():
    adapter = started()
    region = np.random.default_rng(0).uniform([0.8, -0.2], [1.2, 0.2], size=(40, 2))
    shown = adapter.gain(np.array([[1.2, 0.0], [0.9, 0.01]]), region, demonstrations=True)
    assert shown[0] > 0.05
    assert shown[0] > shown[1]


def test_proposals_depend_on_what_was_observed_alone():
    asked, silent = started(), started()
    for adapter in (asked, silent):
        for i in range(40):
            error = 0.02 * np.array([np.sin(i), np.cos(i)])
            adapter.observe(GOAL + 0.05 * error, GOAL, Reading.by_eye(np.round(error, 2)))
            if adapter is asked:
                adapter.propose(GOAL)
    np.testing.assert_array_equal(asked.propose(GOAL), silent.propose(GOAL))


def test_metres_and_milliseconds_are_as_good_as_metres_and_seconds():
    proposals, hits = [], []
    for factor in ([1.0, 1.0], [1.0, 1000.0]):
        adapter = started(factor * CORNERS, units=("m", "s"))
        adapter.observe(factor * GOAL, factor * GOAL, Reading.measured(np.multiply(factor, 0.03)))
        proposals.append(adapter.propose(factor * GOAL) / factor)
        hits.append(adapter.expect(factor * GOAL, factor * GOAL, np.multiply(factor, 0.02)).p_hit)
    np.testing.assert_allclose(*proposals, atol=1e-9)
    assert hits[0] == pytest.approx(hits[1])


def only_told_whether_it_hit(adapter, goal, shift, rounds) -> list[np.ndarray]:
    """Conditions until the goal is reached, where outcomes are condition plus shift."""
    tried = []
    for _ in range(rounds):
        tried.append(adapter.propose(goal))
        hit = bool(np.linalg.norm(tried[-1] + shift - goal) <= TOLERANCE)
        adapter.observe(
            tried[-1], goal, Reading.only(hit, len(goal)).within(np.full(len(goal), TOLERANCE))
        )
        if hit:
            break
    return tried


@pytest.mark.parametrize("shift", [[0.02, 0.0], [0.0, -0.025], [-0.015, 0.02]])
def test_of_hit_or_miss_alone_a_goal_is_searched_around(shift):
    noise = np.full((6, 2), 0.02)
    tried = only_told_whether_it_hit(started(noise=noise), GOAL, np.array(shift), rounds=20)
    assert np.linalg.norm(tried[-1] + shift - GOAL) <= TOLERANCE
    first = np.array(tried[:9])  # so many misses are remembered
    apart = np.linalg.norm(first[:, None] - first, axis=2)
    assert np.all(apart[np.triu_indices(len(first), 1)] > 0.2 * TOLERANCE)


def test_a_miss_makes_the_same_throw_less_probable():
    adapter = started(noise=np.full((6, 2), 0.02))
    at, goals, p = GOAL[None], GOAL[None], []
    for _ in range(4):
        p.append(float(adapter.p_hit(at, goals, TOLERANCE)[0]))
        adapter.observe(GOAL, GOAL, Reading.only(False, 2).within(np.full(2, TOLERANCE)))
    assert p[0] > 2 * p[1] > 2 * p[2]
    assert p[3] < 0.1
    expected = adapter.expect(GOAL, GOAL, TOLERANCE)
    assert expected.trials == pytest.approx(1 / expected.p_hit)  # such trials teach little
    adapter.observe(GOAL, GOAL, Reading.by_eye([0.02, 0.0], hit=False))
    assert adapter.expect(GOAL, GOAL, TOLERANCE).trials < 2.3
    adapter.observe(GOAL, GOAL, Reading.only(False, 2).within(np.full(2, TOLERANCE)))
    assert adapter.expect(GOAL, GOAL, TOLERANCE).trials < 2.3  # the reading before still teaches


def test_how_many_trials_a_hopeless_goal_takes_is_not_said():
    adapter = started(noise=np.full((6, 2), 0.02))
    expected = adapter.expect(GOAL, GOAL + 3.0, TOLERANCE)
    assert expected.p_hit < 0.01
    assert expected.trials is None


def test_a_miss_that_was_said_in_words_changes_nothing():
    """ "5 cm long" is no hit anyway."""
    told, untold = started(), started()
    reading = Reading.by_eye([0.05, 0.0], hit=False)
    told.observe(GOAL, GOAL, reading.within(np.full(2, TOLERANCE)))
    untold.observe(GOAL, GOAL, reading)
    np.testing.assert_array_equal(told.propose(GOAL), untold.propose(GOAL))


@pytest.mark.parametrize("tolerance", [0.006, 0.015])
def test_with_three_components_no_miss_is_thrown_again(tolerance):
    outcomes = np.random.default_rng(0).uniform(0.8, 1.2, size=(8, 3))
    adapter = started(outcomes, noise=np.full((8, 3), 0.01))
    goal, radius, tried = np.full(3, 1.0), np.full(3, tolerance), []
    for _ in range(5):
        tried.append(adapter.propose(goal))
        adapter.observe(tried[-1], goal, Reading.only(False, 3).within(radius))
    apart = np.linalg.norm(np.array(tried)[:, None] - np.array(tried), axis=2)
    assert np.all(apart[np.triu_indices(5, 1)] > 0.3 * tolerance)


def test_misses_before_a_change_are_judged_by_the_hardware_of_then():
    """Whether something was proposed in between makes no difference."""
    conditions = []
    for proposes in (False, True):
        adapter = started()
        reading = Reading.by_eye([0.05, 0.05], hit=False).within(np.full(2, TOLERANCE))
        adapter.observe(GOAL, GOAL, reading)
        if proposes:
            adapter.propose(GOAL)
        adapter.change_hardware()
        told = adapter._trials._memory
        assert len(told.bare_misses(told.to_goal).numbers) == 0
        conditions.append(adapter.propose(GOAL))
    np.testing.assert_array_equal(*conditions)


def test_noisy_numbers_that_missed_are_not_repeated():
    """Read as 0 with 2 cm of noise, but a miss of more than 1.5 cm."""
    adapter, radius = started(noise=np.full((6, 2), 0.03)), np.full(2, TOLERANCE)
    reading = Reading.measured([0.0, 0.0], 0.02, hit=False)
    adapter.observe(GOAL, GOAL, reading.within(radius))
    moved = np.linalg.norm(adapter.propose(GOAL) - GOAL)
    assert 0.5 * TOLERANCE < moved < 3 * TOLERANCE
    believed = started(noise=np.full((6, 2), 0.03))
    believed.observe(GOAL, GOAL, Reading.measured([0.0, 0.0], 0.02))
    assert np.linalg.norm(believed.propose(GOAL) - GOAL) < 0.1 * TOLERANCE


def test_where_the_tolerance_is_far_finer_than_the_eye_nothing_is_repeated():
    """The word 0 is anything within 1 cm, and what missed was to come within 2 mm."""
    outcomes = CORNERS * 2.5  # executions would be 6 mm apart, were they as far as on our tasks
    adapter, goal, fine = started(outcomes), np.array([2.3, 0.1]), np.full(2, 0.002)
    tried = []
    for _ in range(5):
        tried.append(adapter.propose(goal))
        adapter.observe(tried[-1], goal, Reading.by_eye([0.0, 0.0], hit=False).within(fine))
    apart = np.linalg.norm(np.array(tried)[:, None] - np.array(tried), axis=2)
    assert np.all(apart[np.triu_indices(5, 1)] > 0.001)
    assert adapter.expect(tried[0], goal, 0.002).p_hit < 0.05


def test_where_nothing_reaches_the_goal_no_throw_is_made_twice_for_it():
    """Beyond 2 m the throw falls back, so that no condition lands on 2.15 m; each miss was read."""
    shown = np.array([[1.0, -0.3], [1.0, 0.3], [2.0, -0.3], [2.0, 0.3], [1.5, 0.0], [1.6, 0.15]])
    adapter, goal, thrown = started(shown), np.array([2.15, 0.1]), []
    for _ in range(8):
        x, y = adapter.propose(goal)
        thrown.append((x, y))
        error = np.array([x if x < 2.0 else 2.0 - 1.2 * (x - 2.0), y]) - goal
        reading = Reading.estimated(error, 0.01, hit=False)
        adapter.observe(np.array([x, y]), goal, reading.within(np.full(2, 0.03)))
    apart = np.linalg.norm(np.array(thrown)[:, None] - thrown, axis=2)
    assert apart[np.triu_indices(8, 1)].min() > 0.01
