"""One pattern stays one, however people vary; motions that do not mix are told apart."""

import numpy as np
import pytest

from prior_reinforce.generators.patterns import patterns
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task

OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2], [0.9, 0.0], [0.7, 0.1]])


def throws(signs) -> Demonstrations:
    """Swings of 40 frames at other times, from above (1) or from below (-1)."""
    starts = np.array([5, 31, 12, 24, 18, 9])[:, None]
    s = np.clip((np.arange(90) - starts) / 40, 0, 1)
    swing = 10 * s**3 - 15 * s**4 + 6 * s**5
    size = np.asarray(signs)[:, None] * (0.6 + 0.5 * OUTCOMES[:, :1])
    plans = np.stack([size * swing, 0.5 * swing * size], axis=-1)
    return Demonstrations(plans, OUTCOMES, PlanFormat(("a", "b"), ("rad",) * 2, 0.02))


def test_one_motion_is_one_pattern():
    assert patterns(throws((1,) * 6)) == (tuple(range(6)),)


def test_a_throw_from_below_does_not_mix_with_one_from_above():
    assert patterns(throws((1, -1, 1, 1, -1, 1))) == ((0, 2, 3, 5), (1, 4))


def test_a_throw_that_mirrored_ones_drive_away_from_its_like_is_still_of_its_pattern():
    """Aligned with all of them, the first agrees with none."""
    assert patterns(throws((1, -1, -1, 1, 1, -1))) == ((0, 3, 4), (1, 2, 5))


def test_pushes_to_either_side_are_one_pattern():
    """Opposite motions that an affine function of the outcome tells."""
    s = np.clip(np.arange(60) / 40, 0, 1)
    outcomes = np.array([[-0.3], [-0.2], [-0.1], [0.1], [0.2], [0.3]])
    plans = outcomes[:, :, None] * (10 * s**3 - 15 * s**4 + 6 * s**5)[None, :, None]
    demos = Demonstrations(plans, outcomes, PlanFormat(("x",), ("m",), 0.02))
    assert patterns(demos) == (tuple(range(6)),)


@pytest.mark.parametrize("name", ["A", "B"])
def test_two_ways_round_that_end_alike_are_told_apart_by_how_they_move(name):
    """Where they move differs more by how far they push than by the way round."""
    demos = make_task("curling-round").demonstrations(name)
    one, other = patterns(demos)
    assert len(one) == len(other) == 6
    side = demos.plans[:, :, 0] - demos.plans[:, :1, 0]  # the base turns to the side gone round
    far = side[np.arange(12), np.abs(side).argmax(axis=1)]
    assert len({np.sign(far[list(one)]).sum(), -np.sign(far[list(other)]).sum()}) == 1


def test_two_ways_that_were_shown_along_lines_are_sorted():
    """The outcomes of each lie on a diagonal, so that no spline tells what is left out."""
    along = np.array([-0.2, -0.1, 0.05, 0.12, 0.2])[:, None]
    outcomes = np.vstack([along * [1.0, side] + [0.9, 0.0] for side in (1.0, -1.0)])
    s = np.clip(np.arange(60) / 40, 0, 1)
    swing = 10 * s**3 - 15 * s**4 + 6 * s**5
    back = swing + 2.0 * np.sin(np.pi * s) ** 2
    size = 0.5 + outcomes[:, :1]
    plans = np.stack([size * swing, size * np.where(np.arange(10)[:, None] < 5, back, swing)], -1)
    demos = Demonstrations(plans, outcomes, PlanFormat(("a", "b"), ("rad",) * 2, 0.02))
    assert patterns(demos) == (tuple(range(10)),)


def test_what_does_not_move_is_one_pattern():
    still = Demonstrations(
        np.ones((6, 20, 2)), OUTCOMES, PlanFormat(("a", "b"), ("rad",) * 2, 0.02)
    )
    assert patterns(still) == (tuple(range(6)),)


def test_of_three_components_no_three_demonstrations_are_a_pattern_of_their_own():
    """Where each is told by two others, it is by chance that halves tell more than all do."""
    outcomes = np.random.default_rng(11).uniform([1.0, -0.2, 0.6], [1.5, 0.2, 0.8], (6, 3))
    s = np.linspace(0, 1, 80)
    swing, there_and_back = 10 * s**3 - 15 * s**4 + 6 * s**5, np.sin(np.pi * s) ** 2
    manner = 3.0 * (-1.0) ** np.arange(6)[:, None] * there_and_back
    x, y, z = outcomes.T[:, :, None]
    plans = np.stack([x * swing, y * swing, z * there_and_back, manner], axis=-1)
    form = PlanFormat(("x", "y", "z", "pitch"), ("m", "m", "m", "rad"), 0.02)
    assert patterns(Demonstrations(plans, outcomes, form)) == (tuple(range(6)),)
