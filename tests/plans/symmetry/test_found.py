"""A turn about the base that demonstrations show is found; other tasks show none."""

from dataclasses import replace

import numpy as np
import pytest

import prior_reinforce as pr
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Learned, TurnJoint
from prior_reinforce.plans.symmetry.found import find_turn

FORM = PlanFormat(("base", "lift", "grip"), ("rad", "rad", "1"), 0.02)


def throws(n=6, *, way=1.0, ahead=0.0, centre=(0.0, 0.0), off=0.0, form=FORM, slope=1.0):
    """Swings of `lift` whose `base` is turned by the outcome's bearing about an axis."""
    rng = np.random.default_rng(0)
    bearing, distance = ahead + rng.uniform(-0.5, 0.5, n), rng.uniform(0.8, 1.2, n)
    place = distance[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)]) + centre
    s = np.linspace(0, 1, 50)
    swing = 10 * s**3 - 15 * s**4 + 6 * s**5
    plans = np.zeros((n, 50, form.action_dim))
    base = 0.7 + way * slope * bearing + off * rng.normal(size=n)
    plans[:, :, 0] = base[:, None] + 0.05 * swing
    plans[:, :, 1] = swing * distance[:, None]
    return Demonstrations(plans, place, form)


@pytest.mark.parametrize("n", [4, 8])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_first_joint_that_follows_the_bearing_is_a_turn_about_the_base(way, n):
    found = find_turn(throws(n, way=way, off=0.01))
    assert found is not None
    assert found.moves == (Learned(), TurnJoint(0, way))
    # A plan turned by 0.3 rad is the plan with another first joint.
    plan = throws().plans[0]
    moved = found.move(plan, np.array([0.0, 0.3]))
    np.testing.assert_allclose(moved - plan, [[way * 0.3, 0, 0]] * len(plan), atol=1e-12)


def test_a_turn_is_found_where_all_begin_at_one_pose():
    shown = throws()
    plans = shown.plans.copy()
    plans[:, :, 0] *= np.minimum(np.linspace(0.0, 1.4, 50), 1.0)
    assert np.ptp(plans[:, 0, 0]) == 0
    found = find_turn(Demonstrations(plans, shown.outcomes_seen, FORM))
    assert found is not None
    assert found.moves[1] == TurnJoint(0, 1.0)


def test_a_hand_off_the_axis_by_a_twentieth_is_no_base_elsewhere():
    assert find_turn(throws(8, centre=(0.05, 0.0))) is not None


def pushes(*, slope=1.0, names=("dx", "dy", "dyaw"), units=("m", "m", "rad"), ahead=0.0):
    """Straight pushes with increments that head where the object is to go."""
    rng = np.random.default_rng(0)
    bearing, distance = ahead + rng.uniform(-0.5, 0.5, 6), rng.uniform(0.8, 1.2, 6)
    place = distance[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    speed = np.sin(np.linspace(0, np.pi, 50)) * distance[:, None] * 0.01
    heading = slope * bearing[:, None]
    steps = np.stack([speed * np.cos(heading), speed * np.sin(heading), 0 * speed], axis=2)
    return Demonstrations(steps, place, PlanFormat(names, units, 0.02))


@pytest.mark.parametrize("ahead", [0.0, np.pi])
def test_increments_that_head_where_the_object_goes_are_a_turn_about_the_origin(ahead):
    shown = pushes(ahead=ahead)
    found = find_turn(shown)
    assert found is not None
    made = pr.make_generator("auto").fit(shown, seed=0)
    assert "dx and dy turn with the outcome's bearing" in made.remarks[0]
    for off in (-0.45, 0.02, 0.4):
        bearing = ahead + off
        (plan,) = made.generate([[np.cos(bearing), np.sin(bearing)]])
        dx, dy = plan[:, :2].sum(axis=0)
        assert np.cos(np.arctan2(dy, dx) - bearing) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    "shown",
    [
        pushes(slope=0.4),
        pushes(names=("dx", "dz", "dyaw")),
        pushes(names=("dx", "dy", "drx")),  # which a turn would leave behind
        throws(form=replace(FORM, names=("delta_base", "delta_lift", "grip"))),
        pushes(names=("x", "y", "delta_grip"), units=("m", "m", "1")),  # poses
    ],
    ids=["slope", "height", "attitude", "joints", "poses"],
)
def test_other_increments_show_none(shown):
    assert find_turn(shown) is None


@pytest.mark.parametrize("ahead", [0.0, 2.75, np.pi, -np.pi / 2])
def test_throws_may_go_anywhere_about_the_base(ahead):
    made = pr.make_generator("auto").fit(throws(ahead=ahead), seed=0)
    for off in (-0.6, -0.04, 0.04, 0.3):
        bearing = ahead + off
        (plan,) = made.generate([[np.cos(bearing), np.sin(bearing)]])
        assert plan[0, 0] == pytest.approx(0.7 + bearing, abs=1e-3)


@pytest.mark.parametrize(
    "demonstrations",
    [
        throws(3),  # too few
        throws(off=0.2),  # a joint that goes where it likes
        throws(8, slope=0.4),  # a push, for which the arm turns less
        throws(8, centre=(-0.8, 0.0)),  # an axis far behind the base
        throws(8, centre=(0.15, 0.1)),  # outcomes that are not seen from the base
        throws(form=replace(FORM, names=("dx", "dy", "dyaw"), units=("m", "m", "rad"))),
        throws(form=replace(FORM, names=("x", "y", "yaw"), units=("m", "m", "rad"))),
        throws(form=replace(FORM, units=("1", "1", "1"))),
    ],
    ids=["few", "noise", "slope", "far", "elsewhere", "increments", "poses", "no angles"],
)
def test_other_demonstrations_show_none(demonstrations):
    assert find_turn(demonstrations) is None


def test_outcomes_that_are_no_places_show_none():
    shown = throws()
    for form in (
        OutcomeFormat(("x", "y"), ("cm", "cm")),
        OutcomeFormat(("height", "x"), ("m", "m")),
    ):
        other = Demonstrations(shown.plans, shown.outcomes_seen, shown.format, form)
        assert find_turn(other) is None
    one = Demonstrations(shown.plans, shown.outcomes_seen[:, :1], shown.format)
    assert find_turn(one) is None


@pytest.mark.parametrize("name", ["A", "B"])
@pytest.mark.parametrize(
    ("task", "way"),
    [("basketball-v1", 1.0), ("so101", -1.0), ("curling", None), ("fishing", None)],
)
def test_shipped_throws_show_a_turn_about_the_base_and_pushes_none(task, way, name):
    found = find_turn(pr.make_task(task).demonstrations(name))
    if way is None:
        assert found is None
    else:
        assert found is not None
        assert found.moves[1] == TurnJoint(0, way)
