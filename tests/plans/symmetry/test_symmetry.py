"""Symmetries as data, and what they do to plans."""

import json
from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.symmetry import (
    Amplitude,
    Symmetry,
    Tempo,
    TurnIncrements,
    TurnJoint,
    TurnPath,
    TurnPoses,
    scale_alone,
    shift,
    turn_and_scale,
)

CHAIN = robot_limits("panda").chain
SYMMETRIES = [
    turn_and_scale(TurnJoint()),
    turn_and_scale(TurnJoint(), scale=Amplitude(steps=(6,))),
    turn_and_scale(TurnPath(CHAIN, (0.43, 0.0), tuple(range(7))), (0.43, 0.0)),
    turn_and_scale(TurnPoses(vector=(3, 4, 5))),
    turn_and_scale(TurnIncrements((-0.05, 0.0)), scale=Tempo(increments=(0, 1))),
    shift(),
    scale_alone(),
    replace(turn_and_scale(TurnJoint()), rival=shift()),
]


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=lambda symmetry: symmetry.name)
def test_a_symmetry_is_data_and_comes_back_from_it(symmetry):
    again = Symmetry.from_data(json.loads(json.dumps(symmetry.data())))
    assert again == symmetry
    plan, w = np.linspace(0, 1, 210).reshape(30, 7), np.full(symmetry.k, 0.05)
    np.testing.assert_array_equal(again.move(plan, w), symmetry.move(plan, w))


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=lambda symmetry: symmetry.name)
def test_a_plan_that_is_not_moved_is_the_same(symmetry):
    plan = np.linspace(0, 1, 210).reshape(30, 7)
    np.testing.assert_array_equal(symmetry.move(plan, np.zeros(symmetry.k)), plan)


def test_data_of_another_kind_is_refused_by_name():
    data = turn_and_scale(TurnJoint()).data()
    for changed in ({"chart": {"type": "spherical"}}, {"code": "print()"}, {"exact": [True]}):
        with pytest.raises(ConfigurationError, match=r"symmetry|exact"):
            Symmetry.from_data({**data, **changed})


def test_increments_are_those_that_its_moves_name():
    turn = TurnIncrements(yaw=2)
    assert turn_and_scale(turn, scale=Tempo(increments=(0, 1))).increments == (0, 1, 2)
    assert shift((3, 4), lead=5).increments == (3, 4)
    assert shift().increments == ()


def test_ranges_are_data_and_nothing_is_said_where_they_are_not_known():
    plain, known = turn_and_scale(TurnJoint()), turn_and_scale(TurnJoint(range=(-2.0, 3.0)))
    assert set(plain.data()["moves"][1]) == {"type", "joint", "gain", "ramp"}
    assert Symmetry.from_data(json.loads(json.dumps(known.data()))) == known
    assert known != plain
    assert known.endless == plain


def test_a_motion_by_a_whole_turn_more_is_brought_to_where_another_is():
    near, moved = np.full((4, 2), 3.0), np.full((5, 2), -3.1)
    known = turn_and_scale(TurnJoint(1, range=(-6.0, 6.0)))
    brought = known.toward(moved, near)
    np.testing.assert_allclose(brought, [-3.1, 2 * np.pi - 3.1] * np.ones((5, 2)))
    np.testing.assert_array_equal(known.endless.toward(moved, near), moved)
