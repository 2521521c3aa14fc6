"""What a kind of set varies, measured on its plans; and that aiming finds its outcome."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.simulation.tasks import make_task
from reproduction.following import warped as pace
from reproduction.zoo.human import KINDS, Manner, reach_and_strike

SCOOP, LOB, GRIPPER = make_task("zoo-scoop"), make_task("zoo-lob"), make_task("zoo-gripper")


def moving_frames(plans, least=1e-9):
    """First and last frame at which each plan moves."""
    steps = np.abs(np.diff(plans, axis=1)).max(axis=2) > least
    return steps.argmax(axis=1), steps.shape[1] - steps[:, ::-1].argmax(axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_the_same_again_and_its_outcomes_are_what_its_plans_do(kind):
    made, again = LOB.demonstrations(f"{kind}-5-3"), LOB.demonstrations(f"{kind}-5-3")
    np.testing.assert_array_equal(made.plans, again.plans)
    outcomes = [rollout.outcome for rollout in LOB.rollout(made.plans, None)]
    np.testing.assert_array_equal(made.outcomes_seen, outcomes)
    assert made.n == 5
    other = LOB.demonstrations(f"{kind}-5-4")
    assert not np.array_equal(made.plans, other.plans)


def test_clean_motions_begin_and_end_together_and_rest_at_both_ends():
    begin, end = moving_frames(SCOOP.demonstrations("clean-6-0").plans, 1e-5)
    assert np.ptp(begin) <= 1
    assert np.ptp(end) <= 1
    assert begin.min() > 10
    assert end.max() < SCOOP.horizon - 10


def test_delayed_motions_are_shifts_between_rests_longer_than_their_spread():
    begin, end = moving_frames(SCOOP.demonstrations("delayed-8-0").plans, 1e-5)
    assert np.ptp(begin) > 8
    assert np.ptp(end - begin) <= 2
    assert min(begin.min(), SCOOP.horizon - end.max()) > 0.7 * np.ptp(begin)


def test_short_rests_are_shorter_than_the_spread_of_starts():
    begin, end = moving_frames(SCOOP.demonstrations("short-rest-8-0").plans, 1e-5)
    assert SCOOP.horizon - end.max() < 0.5 * np.ptp(begin)


def test_tempo_changes_how_long_a_motion_takes():
    begin, end = moving_frames(SCOOP.demonstrations("tempo-8-0").plans, 1e-5)
    takes = end - begin
    assert takes.max() / takes.min() > 1.15


def test_cut_motions_end_in_mid_swing():
    plans = SCOOP.demonstrations("cut-8-0").plans
    speed = np.abs(np.diff(plans, axis=1)).max(axis=2)
    assert np.all(speed[:, -1] > 0.02 * speed.max(axis=1))


def test_a_pause_stands_between_the_two_phases():
    task = GRIPPER
    aims = task.aims(np.full(3, 0.5))
    at = round(task.strategy(aims, 0).pause_at / task.format.dt)
    pace = []
    for pause in (0.0, 0.2):
        nothing = np.zeros((2, 4))
        manner = Manner(1.0, 0.0, 1.0, np.zeros(3), pause, nothing, 0, np.zeros((80, 4)))
        steps = np.abs(np.diff(manner.path(task, aims), axis=0)).max(axis=1)
        pace.append(steps[at + 1 : at + 10].max())
    assert pace[1] < 1e-9 < pace[0]


def test_a_warp_keeps_the_way_and_changes_the_pace():
    waves, nothing = np.array([0.3, -0.2, 0.1]), np.zeros((2, 7))
    manner, even = (
        Manner(0.5, 0.0, 1.0, warp, 0.0, nothing, 0, np.zeros((SCOOP.horizon, 7)))
        for warp in (waves, 0 * waves)
    )
    aims = SCOOP.aims(np.array([0.5, 0.5]))
    warped, straight = manner.path(SCOOP, aims), even.path(SCOOP, aims)
    np.testing.assert_allclose(warped[[0, -1]], straight[[0, -1]], atol=1e-9)
    assert np.abs(warped - straight).max() > 0.02
    assert np.all(np.diff(pace(np.linspace(0, 1, 200), waves)) > 0)


def test_a_gripper_opens_in_six_frames_in_every_tempo():
    for kind in ("clean", "tempo", "warped"):
        opening = GRIPPER.demonstrations(f"{kind}-6-0").plans[:, :, 3]
        between = (opening > 1e-3) & (opening < 1 - 1e-3)
        assert set(between.sum(axis=1)) <= {5, 6}
        np.testing.assert_array_equal(opening[:, [0, -1]], np.tile([0.0, 1.0], (6, 1)))


def test_a_third_of_a_styled_set_moves_otherwise():
    """The wrist does more in the other style."""
    plans = SCOOP.demonstrations("styles-9-1").plans
    wrist, shoulder = np.ptp(plans[:, :, 5], axis=1), np.ptp(plans[:, :, 1], axis=1)
    assert np.sum(wrist > shoulder) == 3


def test_one_demonstration_of_an_outlier_set_is_odd():
    plans = SCOOP.demonstrations("outlier-8-0").plans
    assert np.sum(np.ptp(plans[:, :, 5], axis=1) > np.ptp(plans[:, :, 1], axis=1)) == 1


def test_jitter_is_encoder_noise_on_joints_that_are_held():
    held = GRIPPER.demonstrations("jitter-8-0").plans[:, -10:]
    assert held[:, :, :3].std(axis=1).mean() == pytest.approx(2e-5, rel=0.15)
    assert np.all(held[:, :, 3] == 1.0)
    assert np.all(np.ptp(GRIPPER.demonstrations("clean-8-0").plans[:, -10:], axis=1) == 0)


def test_postures_differ_little_at_home_and_more_when_wound_up():
    clean, varied = (SCOOP.demonstrations(f"{kind}-8-0").plans for kind in ("clean", "postures"))
    assert np.all(np.ptp(clean[:, 0], axis=0) == 0)
    home, wound = varied[:, 0].std(axis=0), varied[:, -1].std(axis=0)
    assert np.median(home / SCOOP.posture) == pytest.approx(0.5, rel=0.4)
    assert np.mean(wound / SCOOP.posture) > 2 * np.mean(home / SCOOP.posture)


def test_two_phases_are_minimum_jerk_strokes_one_after_the_other():
    strategy = reach_and_strike((0.0,), (-1.0,), (2.0,), reach=0.4, strike=0.6, overlap=0.1)
    assert [move.change for move in strategy.moves] == [(-1.0,), (3.0,)]
    assert strategy.duration == pytest.approx(0.9)
    assert strategy.pause_at == pytest.approx(0.3)


@pytest.mark.parametrize("name", ["A", "clean", "clean-6", "clean-2-0", "odd-6-0", "clean-6-x"])
def test_a_name_that_is_no_set_is_refused_with_all_kinds(name):
    with pytest.raises(ConfigurationError, match=f"no demonstration set '{name}'.*short-rest"):
        LOB.demonstrations(name)


def test_scattered_outcomes_are_as_far_apart_as_chance_has_them():
    def nearest(kind):
        found = []
        for seed in range(6):
            shares = SCOOP.demonstrations(f"{kind}-8-{seed}").outcomes_seen - SCOOP.region[0]
            shares = shares / np.ptp(SCOOP.region, axis=0)
            gaps = np.linalg.norm(shares[:, None] - shares, axis=-1) + 9 * np.eye(8)
            found.append(gaps.min())
        return np.median(found)

    assert nearest("scattered") < 0.5 * nearest("mixed")
