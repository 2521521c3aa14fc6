"""What the numbers of a plan's frames mean; how turns and signs move is in `test_whole_turns`."""

import numpy as np
import pytest

from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.plan_format import PlanFormat, stepped, summed


@pytest.mark.parametrize(
    ("names", "units", "dt", "message"),
    [
        ((), (), 0.1, "at least one"),
        (("a", "a"), ("rad", "rad"), 0.1, "differ"),
        (("a", "b"), ("rad",), 0.1, "as many units"),
        (("a",), ("rad",), 0.0, "positive"),
        (("a",), ("rad",), float("nan"), "positive"),
    ],
)
def test_bad_formats_are_named(names, units, dt, message):
    with pytest.raises(InvalidPlanError, match=message):
        PlanFormat(names, units, dt)


def test_a_text_is_no_list_of_names():
    with pytest.raises(InvalidPlanError, match=r"units must be a list such as \['rad'\], got a"):
        PlanFormat(("pan", "arm"), "rad", 0.02)
    with pytest.raises(InvalidPlanError, match="names must be a list"):
        PlanFormat("pan", ("rad",), 0.02)


def test_increments_are_told_by_name_and_a_rate_is_none():
    names = ("dx", "dyaw", "drx", "delta_joint1", "u", "joint1", "dy", "d_joint2", "DZ")
    units = ("m", "rad", "rad", "rad", "m", "rad", "m/s", "rad/s", "m")
    form = PlanFormat(names, units, 0.02)
    assert [names[i] for i in form.increments] == ["dx", "dyaw", "drx", "delta_joint1", "DZ"]


@pytest.mark.parametrize(
    "name",
    [
        *("left_dx", "ee_dx", "d_x", "delta.x", "delta x", "action.delta_x", "action/delta_x"),
        *("deltaX", "dX", "x_delta", "joint1_delta", "dpos_x", "dgripper", "gripper_delta"),
        *("increment_0", "Δx", "∆x", "d_joint1", "world_vector_0", "gripper_dyaw"),
    ],
)
def test_increments_have_many_names(name):
    assert PlanFormat((name,), ("rad",), 0.02).increments == (0,)
    assert PlanFormat((name,), ("rad/sec",), 0.02).increments == ()


@pytest.mark.parametrize(
    "name",
    [
        *("dq1", "vx", "dt", "d1", "d_3", "id", "grid_x", "width", "dist", "q_d_1", "index"),
        *("delta_1", "left_delta3", "rel_x", "joint1_rel", "relative_encoder_1"),
    ],
)
def test_rates_slides_and_other_names_are_no_increments(name):
    assert PlanFormat((name,), ("rad",), 0.02).increments == ()


def test_rates_beside_their_joints_as_plans_are_exported_are_no_increments():
    names = ("joint1", "d_joint1", "dd_joint1", "d_joint2")
    assert PlanFormat(names, ("rad",) * 4, 0.02).increments == (3,)


@pytest.mark.parametrize(
    "names", ["theta1 theta2 dtheta1 dtheta2", "x y theta dx dy dtheta", "X Y DX dY"]
)
def test_velocities_of_a_state_are_no_increments(names):
    names = names.split()
    assert PlanFormat(tuple(names), ("rad",) * len(names), 0.02).increments == ()


def test_increments_are_summed_from_0_and_taken_apart_again():
    frames = np.array([[1.0, 5.0], [2.0, 6.0], [-0.5, 7.0]])
    poses = summed(frames, [0])
    np.testing.assert_array_equal(poses, [[0, 5], [1, 6], [3, 7], [2.5, 7]])
    np.testing.assert_array_equal(stepped(poses, [0]), frames)
    np.testing.assert_array_equal(summed(np.stack([frames, frames]), [0])[1], poses)
