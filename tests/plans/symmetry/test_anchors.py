"""From where plans are moved: mixed within the hull, from its edge beyond, or the nearest."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.plans.symmetry import (
    Anchors,
    Delay,
    Learned,
    Tempo,
    TurnJoint,
    scale_alone,
    shift,
    turn_and_scale,
)
from prior_reinforce.plans.symmetry.anchors import into_hull

TURN = turn_and_scale(TurnJoint())
OUTCOMES = np.array([[0.9, 0.1], [1.0, -0.2], [1.1, 0.15], [1.2, 0.0]])


def test_a_demonstration_is_its_own_base():
    anchors = Anchors(TURN, OUTCOMES, np.zeros((4, 2)))
    base, weights = anchors.base(anchors.z)
    assert anchors.mixed
    np.testing.assert_allclose(base, anchors.z, atol=1e-9)
    np.testing.assert_allclose(weights, np.eye(4), atol=1e-9)


def test_within_the_hull_nothing_is_left_to_a_scaling_and_beyond_it_the_rest():
    anchors = Anchors(TURN, OUTCOMES, np.zeros((4, 2)))
    far = np.log([1.05, 0.5, 2.0])
    base, weights = anchors.base(np.column_stack([far, [0.0, 3.0, -3.0]]))
    low, high = anchors.z[:, 0].min(), anchors.z[:, 0].max()
    np.testing.assert_allclose(base[:, 0], [far[0], low, high])
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(base[:, 1], weights @ anchors.z[:, 1])


def test_the_nearest_is_moved_where_all_is_exact_or_there_is_one():
    for symmetry, outcomes in ((shift(), OUTCOMES), (TURN, OUTCOMES[:1])):
        anchors = Anchors(symmetry, outcomes, np.zeros_like(outcomes))
        assert not anchors.mixed
        base, weights = anchors.base(anchors.z + 0.01)
        np.testing.assert_array_equal(base, anchors.z)
        np.testing.assert_array_equal(weights, np.eye(len(outcomes)))


def test_the_nearest_is_moved_where_labels_are_coarser_than_the_gaps():
    assert Anchors(TURN, OUTCOMES, np.full((4, 2), 0.03)).mixed
    assert not Anchors(TURN, OUTCOMES, np.full((4, 2), 0.3)).mixed
    assert not Anchors(TURN, OUTCOMES[[0, 0]], np.zeros((2, 2))).mixed


def test_the_nearest_is_moved_where_a_clock_releases():
    """People are at different points of their motion then."""
    for keep_horizon in (False, True):
        clocked = turn_and_scale(TurnJoint(), scale=Tempo(about=30.0, keep_horizon=keep_horizon))
        assert clocked.clocked is keep_horizon
        assert Anchors(clocked, OUTCOMES, np.zeros((4, 2))).mixed is not keep_horizon
    of_three = turn_and_scale(TurnJoint(), scale=clocked.moves[0], others=(Learned(),))
    third = np.array([[0.5], [0.8], [0.6], [0.9]])
    assert Anchors(of_three, np.hstack([OUTCOMES, third]), np.zeros((4, 3))).mixed


def test_where_a_clock_releases_outcomes_do_not_jump_from_one_demonstration_to_the_next():
    anchors = Anchors(
        scale_alone(Tempo(about=30.0, keep_horizon=True)),
        np.array([[0.5], [1.0]]),
        np.zeros((2, 1)),
    )
    middle = anchors.z.mean()
    aims = middle + np.linspace(-0.3, 0.3, 601)[:, None]
    base, weights = anchors.base(aims)
    assert np.abs(np.diff(base[:, 0])).max() < 0.02 * np.ptp(anchors.z)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights[300], 0.5)
    np.testing.assert_array_equal(weights[0], [1.0, 0.0])
    each, _ = anchors.moves(aims[300])
    np.testing.assert_allclose(each, aims[300] - anchors.z)
    each, _ = anchors.moves(aims[0])
    assert np.isinf(each[1]).all()


def test_noise_is_carried_into_the_chart():
    anchors = Anchors(TURN, np.array([[2.0, 0.0]]), np.array([[0.1, 0.4]]))
    np.testing.assert_allclose(anchors.sd, [[0.05, 0.2]])
    alone = Anchors(scale_alone(), np.array([[0.5]]), np.array([[0.1]]))
    np.testing.assert_allclose(alone.sd, [[0.2]])


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_points_of_a_hull_are_the_nearest_ones(dimensions):
    rng = np.random.default_rng(dimensions)
    corners = rng.uniform(-1, 1, (9, dimensions))
    inside = rng.dirichlet(np.ones(9), 20) @ corners
    np.testing.assert_allclose(into_hull(inside, corners), inside, atol=1e-6)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    beyond = into_hull(np.array([[2.0, 0.3], [-1.0, -1.0]]), square)
    np.testing.assert_allclose(beyond, [[1.0, 0.3], [0.0, 0.0]], atol=1e-6)


def test_two_components_that_are_left_are_mixed_over_both():
    scale, turn = TURN.moves
    eye = np.eye(3)
    three = replace(
        TURN,
        moves=(scale, turn, Delay(-20.0)),
        exact=[False, True, False],
        gain_mean=eye,
        gain_sd=eye,
        **{name: np.full(3, 0.1) for name in ("offset_sd", "bend_sd", "between_sd", "farthest")},
    )
    outcomes = np.random.default_rng(0).uniform(0.5, 1.0, (6, 3))
    anchors = Anchors(three, outcomes, np.zeros((6, 3)))
    assert anchors.mixed
    base, _ = anchors.base(anchors.z[:2] + np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(base[:, [0, 2]], anchors.z[:2][:, [0, 2]], atol=1e-6)


def test_what_is_learned_is_mixed_to_half_the_range_beyond_however_coarse_labels_are():
    turn_alone = turn_and_scale(TurnJoint(), scale=Learned())
    anchors = Anchors(turn_alone, OUTCOMES, np.full((4, 2), 0.3))
    aims = np.column_stack([np.log([1.05, 0.85, 1.3, 0.5, 2.0]), [0.0, 3.0, -3.0, 0.0, 0.0]])
    base, weights = anchors.base(aims)
    low, high = anchors.z[:, 0].min(), anchors.z[:, 0].max()
    beyond = 0.5 * (high - low)
    np.testing.assert_allclose(base[:, 0], [*aims[:3, 0], low - beyond, high + beyond])
    np.testing.assert_allclose(base[:, 1], weights @ anchors.z[:, 1])
    assert not Anchors(turn_alone, OUTCOMES[:1], np.zeros((1, 2))).mixed
