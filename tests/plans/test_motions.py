"""Motions: what is checked once, and what comes back from disk."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidGoalError,
    InvalidPlanError,
)
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import (
    Learned,
    TurnJoint,
    TurnPoses,
    scale_alone,
    shift,
    turn_and_scale,
)

FORMAT = PlanFormat(names=("joint1", "joint2"), units=("rad", "rad"), dt=0.01)
RNG_SEED = 0


def make(n=4, horizon=5, **changes):
    rng = np.random.default_rng(RNG_SEED)
    given = {
        "plans": rng.normal(size=(n, horizon, 2)),
        "outcomes_seen": rng.uniform(0.5, 1.0, size=(n, 2)),
        "format": FORMAT,
    }
    return Demonstrations(**(given | changes))


def test_round_trip_keeps_every_bit_and_the_meaning(tmp_path):
    demos = make(outcome_format=OutcomeFormat(("x", "t"), ("m", "s")))
    demos.save(tmp_path / "demos.npz")
    loaded = Demonstrations.load(tmp_path / "demos.npz")
    np.testing.assert_array_equal(loaded.plans, demos.plans)
    np.testing.assert_array_equal(loaded.outcomes_seen, demos.outcomes_seen)
    assert loaded.format == FORMAT
    assert loaded.outcome_format == OutcomeFormat(("x", "t"), ("m", "s"))


@pytest.mark.parametrize(
    "change",
    [
        {"format": PlanFormat(("a", "b"), ("rad", "rad"), 0.02)},
        {"format": PlanFormat(("a", "c"), ("rad", "rad"), 0.01)},
        {"format": PlanFormat(("a", "b"), ("rad", "m"), 0.01)},
        {"outcome_format": OutcomeFormat(("y", "x"), ("m", "m"))},
        {"outcome_format": OutcomeFormat(("x", "y"), ("m", "rad"))},
    ],
)
def test_the_same_numbers_that_mean_something_else_are_other_demonstrations(change):
    demos = replace(make(), format=PlanFormat(("a", "b"), ("rad", "rad"), 0.01))
    assert replace(demos, **change).sha256 != demos.sha256
    assert replace(demos).sha256 == demos.sha256


def test_some_demonstrations_keep_their_outcomes_and_noise():
    demos = make()
    noisy = replace(demos, outcome_noise=0.01 + 0 * demos.outcomes_seen)
    some = noisy.only((2, 0))
    np.testing.assert_array_equal(some.plans, demos.plans[[2, 0]])
    np.testing.assert_array_equal(some.outcomes_seen, demos.outcomes_seen[[2, 0]])
    assert some.outcome_noise.shape == some.outcomes_seen.shape
    assert noisy.sha256 != demos.sha256
    with pytest.raises(InvalidDemonstrationsError, match="outcome_noise"):
        replace(demos, outcome_noise=-noisy.outcome_noise)


def test_what_outcomes_are_expected_to_be_is_kept_with_them(tmp_path):
    demos = make()
    correction = np.linspace(0.01, 0.03, demos.outcomes_seen.size).reshape(demos.n, -1)
    known = replace(demos, outcome_correction=correction)
    np.testing.assert_array_equal(known.only((2, 0)).outcome_correction, correction[[2, 0]])
    assert known.sha256 != demos.sha256
    assert known.sha256 != replace(demos, outcome_noise=correction).sha256
    known.save(tmp_path / "demos.npz")
    again = Demonstrations.load(tmp_path / "demos.npz")
    np.testing.assert_array_equal(again.outcome_correction, correction)
    with pytest.raises(InvalidDemonstrationsError, match="outcome_correction"):
        replace(demos, outcome_correction=correction[:, :1])
    with pytest.raises(InvalidDemonstrationsError, match="outcome_correction"):
        replace(demos, outcome_correction=correction + np.nan)


def test_saving_twice_gives_the_same_arrays_and_no_pickle(tmp_path):
    make().save(tmp_path / "demos.npz")
    with np.load(tmp_path / "demos.npz", allow_pickle=False) as archive:
        arrays = {"plans", "outcomes_seen", "outcome_noise", "outcome_correction"}
        assert set(archive.files) == {*arrays, "metadata"}
        assert json.loads(str(archive["metadata"]))["format"]["dt"] == 0.01


def test_arrays_are_own_copies_and_read_only():
    plans = np.zeros((2, 3, 2))
    plans[1] = 1
    demos = make(plans=plans, outcomes_seen=[[0.1, 0.2], [0.3, 0.1]])
    plans += 5
    assert demos.plans.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        demos.plans[0, 0, 0] = 9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plans": np.zeros((4, 5, 3))}, "3 action dimensions"),
        ({"plans": np.zeros((4, 5))}, "shape"),
        ({"plans": np.full((4, 5, 2), np.nan)}, "finite"),
        ({"plans": [np.zeros((5, 2))] * 3 + [np.zeros((6, 2))]}, r"mixed horizons \[5, 6\]"),
        ({"outcomes_seen": np.zeros((3, 2))}, "4 plans need as many outcomes"),
        ({"outcomes_seen": np.full((4, 2), np.inf)}, "finite"),
        ({"outcomes_seen": [[0.1, 0.2]] * 4}, "all outcomes agree"),
        ({"outcomes_seen": [[0.1 * i, 0.2 * i] for i in range(4)]}, "one line"),
        ({"outcomes_seen": [[0.1 * i, 0.2] for i in range(4)]}, "component 1"),
        ({"plans": np.zeros((0, 5, 2)), "outcomes_seen": np.zeros((0, 2))}, "at least one"),
        ({"outcome_format": OutcomeFormat(("x",), ("m",))}, "2 components"),
    ],
)
def test_bad_demonstrations_are_named(changes, message):
    with pytest.raises(InvalidDemonstrationsError, match=message):
        make(**changes)


def test_plan_times_follow_dt():
    plan = Plan(np.zeros((4, 2)), FORMAT)
    np.testing.assert_allclose(plan.times, [0, 0.01, 0.02, 0.03])


def test_units_that_look_wrong_are_only_warned_about():
    with pytest.warns(UserWarning, match="centimetres"):
        make(outcomes_seen=np.random.default_rng(0).uniform(50, 100, (4, 2)))
    with pytest.warns(UserWarning, match="degrees"):
        make(plans=np.random.default_rng(0).normal(size=(4, 5, 2)) * 90)


def test_odd_units_are_warned_about_once(tmp_path):
    with pytest.warns(UserWarning, match="degrees"):
        odd = make(plans=np.random.default_rng(0).normal(size=(4, 5, 2)) * 90)
    odd.save(tmp_path / "odd.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Demonstrations.load(tmp_path / "odd.npz").only([0, 1, 2]).with_plans(odd.plans[:3])


def test_goal_far_outside_warns_and_says_how_far_and_a_near_one_is_silent():
    demos = make(outcomes_seen=[[0.8, -0.2], [1.0, -0.2], [0.8, 0.2], [1.0, 0.2]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(demos.check_goal([1.05, 0.0]), [1.05, 0.0])
    with pytest.warns(
        UserWarning, match="lies 50 cm in x outside .* inside is 100 cm ahead, 0 cm left; check"
    ):
        demos.check_goal([1.5, 0.0])


def test_half_the_extent_beyond_the_outcomes_is_far_outside_and_less_is_not():
    made = make(n=2, outcomes_seen=[[0.8, -0.2], [1.0, 0.2]])
    np.testing.assert_allclose(made.far_outside(np.array([0.9, 0.75])), [0.0, 0.55])
    np.testing.assert_array_equal(made.far_outside(np.array([0.9, 0.39])), [0.0, 0.0])


def test_how_far_outside_a_goal_is_can_be_said_however_far():
    with pytest.warns(UserWarning, match=r"goal 9e\+07 cm ahead") as warned:
        make().check_goal([9e5, 0.7])
    assert len(warned) == 1


@pytest.mark.parametrize("value", [3e304, -1.7e308, 1.1e6])
def test_absurd_numbers_are_refused_on_entry(value):
    """By one rule: whatever their unit, they are no plan, outcome or goal, and overflow later."""
    demos = make()
    with pytest.raises(InvalidGoalError, match="implausibly large"):
        demos.check_goal([value, 0.7])
    with pytest.raises(InvalidDemonstrationsError, match="implausibly large"):
        replace(demos, outcomes_seen=demos.outcomes_seen + value)
    with pytest.raises(InvalidDemonstrationsError, match="implausibly large"):
        replace(demos, plans=demos.plans + value)
    with pytest.raises(InvalidPlanError, match="implausibly large"):
        Plan(demos.plans[0] + value, FORMAT)


def test_what_is_masked_is_no_data():
    demos = make()
    masked = np.ma.masked_greater(demos.outcomes_seen, 0.7)
    with pytest.raises(InvalidDemonstrationsError, match="leave out what is masked"):
        replace(demos, outcomes_seen=masked)


@pytest.mark.slow
def test_missing_truncated_flipped_and_foreign_files_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="no demonstrations at"):
        Demonstrations.load(tmp_path / "none.npz")
    make().save(tmp_path / "demos.npz")
    whole = (tmp_path / "demos.npz").read_bytes()
    bad = tmp_path / "bad.npz"
    for size in (0, 10, len(whole) // 2, len(whole) - 3):
        bad.write_bytes(whole[:size])
        with pytest.raises(FileFormatError, match="must be a demonstrations file"):
            Demonstrations.load(bad)
    rng = np.random.default_rng(1)
    for position in rng.integers(0, len(whole), 100):
        flipped = bytearray(whole)
        flipped[position] ^= 1 << int(rng.integers(8))
        bad.write_bytes(flipped)
        try:
            loaded = Demonstrations.load(bad)
        except (FileFormatError, InvalidDemonstrationsError):
            continue
        np.testing.assert_array_equal(loaded.plans, make().plans)
    np.savez(bad, other=np.zeros(3))
    with pytest.raises(FileFormatError):
        Demonstrations.load(bad)
    np.savez(bad, plans=np.array([{}], dtype=object), outcomes_seen=[1], metadata="{}")
    with pytest.raises(FileFormatError):
        Demonstrations.load(bad)


REPEATED = [[0.1, 0.2], [0.3, 0.1], [0.1, 0.2], [0.4, 0.5]]


def test_outcomes_that_were_measured_alike_are_warned_of_and_kept():
    with pytest.warns(UserWarning, match=r"0 and 2 have the same outcome.*the mean of both"):
        demos = make(outcomes_seen=REPEATED)
    assert demos.n == 4
    demos.with_plans(demos.plans)  # said once


def test_outcomes_that_look_alike_by_eye_are_kept_without_a_word():
    assert make(outcomes_seen=REPEATED, outcome_noise=np.full((4, 2), 0.03)).n == 4


def test_metres_are_doubted_sooner_where_nobody_said_them():
    far = [[10.0, 0.2], [16.0, 0.1], [22.0, 0.3], [28.0, 0.5]]
    with pytest.warns(UserWarning, match=r"28 m looks like centimetres.* divide by 100$"):
        make(outcomes_seen=far)
    with pytest.warns(UserWarning, match=r"840 m looks like millimetres.* divide by 1000$"):
        make(outcomes_seen=30 * np.array(far))
    assert make(outcomes_seen=far, outcome_format=OutcomeFormat.metres(2)).n == 4


def test_outcomes_that_differ_by_rounding_are_the_same():
    almost = np.array(REPEATED)
    almost[2] += 1e-12
    with pytest.warns(UserWarning, match="0 and 2 have the same outcome"):
        make(outcomes_seen=almost)


def test_a_plan_is_drawn_by_unit_and_printed_in_a_line():
    form = PlanFormat(("pan", "$arm", "gripper"), ("rad", "rad", "percent"), 0.02)
    plan = Plan(np.linspace(0, [1.0, 2.0, 70.0], 11), form)
    assert repr(plan) == "Plan(11 frames x 3, 0.2 s: pan, $arm, gripper)"
    joints, gripper = plan.plot().axes
    assert [len(axes.lines) for axes in (joints, gripper)] == [2, 1]
    np.testing.assert_array_equal(joints.lines[1].get_ydata(), plan.actions[:, 1])
    np.testing.assert_allclose(gripper.lines[0].get_xdata(), plan.times)
    assert gripper.get_ylabel() == "[percent]"


def test_demonstrations_are_printed_in_a_line():
    demos = Demonstrations(np.zeros((2, 5, 1)), [[0.1], [0.2]], PlanFormat(["a"], ["rad"], 0.1))
    assert repr(demos) == "Demonstrations(2 plans, 5 frames x 1, 0.4 s: a; outcomes x [m])"


TURN = turn_and_scale(TurnJoint(1))


def test_a_symmetry_is_kept_through_all_that_is_made_of_demonstrations(tmp_path):
    demos = make(symmetry=TURN)
    assert demos.symmetry == TURN.around(demos.outcomes_seen)
    assert demos.with_plans(demos.plans + 1).symmetry == demos.symmetry
    assert demos.only([0, 2]).symmetry == TURN.around(demos.outcomes_seen[[0, 2]])
    demos.save(tmp_path / "demos.npz")
    loaded = Demonstrations.load(tmp_path / "demos.npz")
    assert loaded.symmetry == demos.symmetry
    assert loaded.sha256 == demos.sha256


def test_a_symmetry_is_part_of_the_fingerprint_and_can_be_taken_off():
    demos, plain = make(symmetry=TURN), make()
    assert plain.symmetry is None
    assert demos.sha256 != plain.sha256
    assert demos.without_symmetry().sha256 == plain.sha256
    assert plain.with_symmetry(TURN).sha256 == demos.sha256


@pytest.mark.parametrize(
    ("symmetry", "message"),
    [
        (scale_alone(), "moves 1 components, but outcomes have 2"),
        (turn_and_scale(TurnJoint(2)), "columns that plans do not have; they have 2: joint1"),
    ],
)
def test_a_symmetry_that_does_not_fit_is_refused(symmetry, message):
    with pytest.raises(InvalidDemonstrationsError, match=message):
        make(symmetry=symmetry)


def test_a_motion_is_turned_in_metres_alone():
    """A place in metres among outcomes in centimetres would move plans by metres."""
    centimetres = OutcomeFormat(("x", "y"), ("cm", "cm"), (1.5, 1.5))
    with pytest.raises(ConfigurationError, match=r"outcomes are in cm.* write units m"):
        make(symmetry=TURN, outcome_format=centimetres)
    with pytest.raises(ConfigurationError, match="outcomes are in cm"):
        make(outcome_format=centimetres).with_symmetry(TURN)
    for names, units, symmetry in [
        (("joint1", "joint2"), ("deg", "deg"), TURN),
        (("x", "y"), ("mm", "mm"), shift()),
        (("x", "y"), ("mm", "mm"), turn_and_scale(TurnPoses((0.4, 0.0), (0, 1)), (0.4, 0.0))),
    ]:
        with pytest.raises(ConfigurationError, match=f"plans are in {units[0]}.* m and rad"):
            make(format=PlanFormat(names, units, 0.01)).with_symmetry(symmetry)
    tempo = make(
        format=PlanFormat(("x", "y"), ("mm", "mm"), 0.01),
        outcomes_seen=[[1.0], [2.0], [3.0], [4.0]],
    )
    assert tempo.with_symmetry(scale_alone()).symmetry is not None  # which knows no place


def test_one_demonstration_has_the_spread_of_its_symmetry():
    one = make(n=1, outcomes_seen=[[2.0, 0.0]], symmetry=TURN)
    np.testing.assert_allclose(one.spread, [0.3, 0.3])
    np.testing.assert_allclose(make(n=4).spread, make(n=4).outcomes_seen.std(axis=0))
    with pytest.raises(InvalidDemonstrationsError, match="state the symmetry"):
        make(n=1).spread  # noqa: B018


def test_outcomes_on_a_line_are_enough_with_a_symmetry():
    line = [[0.1 * i, 0.2] for i in range(1, 5)]
    demos = make(outcomes_seen=line, symmetry=TURN)
    assert demos.spread[1] > 0.01
    assert demos.repeated_outcomes() == []
    with pytest.raises(InvalidDemonstrationsError, match="all outcomes agree"):
        demos.without_symmetry()


def test_a_goal_is_far_outside_where_the_symmetry_is_believed_no_more():
    one = make(n=1, outcomes_seen=[[1.0, 0.0]], symmetry=TURN)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one.check_goal([-0.9, 0.9])
        one.check_goal([2.0, 0.0])
    np.testing.assert_allclose(one.far_outside(np.array([4.0, 0.0])), [4.0 - np.exp(0.9), 0.0])
    with pytest.warns(
        UserWarning, match="goal 400 cm ahead, 0 cm left lies 154 cm in x from where"
    ):
        one.check_goal([4.0, 0.0])


def test_a_goal_is_far_outside_at_half_the_range_of_what_is_learned():
    several = make(symmetry=turn_and_scale(TurnJoint(), scale=Learned()))
    reach = np.linalg.norm(several.outcomes_seen, axis=1)
    edge = reach.max() * np.sqrt(reach.max() / reach.min())
    assert not np.any(several.far_outside(np.array([0.99 * edge, 0.0])))
    np.testing.assert_allclose(several.far_outside(np.array([1.1 * edge, 0.0])), [0.1 * edge, 0.0])


def test_demonstrations_made_of_others_mute_no_warnings_but_their_own(monkeypatch):
    """`catch_warnings` is of all threads, and two of them leave it muted for good."""
    with pytest.warns(UserWarning, match="looks like centimetres"):
        demos = make(outcomes_seen=[[90.0, 0.1], [80.0, 0.2], [85.0, 0.1], [95.0, 0.3]])
    monkeypatch.setattr(warnings, "catch_warnings", None)
    assert demos.only((0, 1, 2)).n == 3
