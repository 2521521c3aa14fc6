"""Timeline alignment finds shifts that are known, and moves nothing it need not move."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

DT = 0.02  # [s]
FRAMES = np.arange(140)
TRUE_SHIFTS = np.array([0.131, -0.067, 0.0, -0.243, 0.199, 0.054])  # [s], none a whole frame


def ramp(start: float, duration: float) -> np.ndarray:
    """Minimum-jerk path from 0 to 1; start and duration in [s]."""
    s = np.clip((FRAMES * DT - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def throw(shift: float, stretch: float = 1.0) -> np.ndarray:
    """Four joints, one of which never moves, one of which goes back and forth; shape (H, 4)."""
    return np.stack(
        [
            stretch * ramp(1.0 + shift, 0.9) - 0.2,
            0.5 * (ramp(1.0 + shift, 0.45) - ramp(1.5 + shift, 0.4)),
            np.full(len(FRAMES), 0.7),
            ramp(1.1 + shift, 0.6),
        ],
        axis=1,
    )


def demonstrations(plans: np.ndarray) -> Demonstrations:
    outcomes = np.random.default_rng(0).normal(size=(len(plans), 2))
    names = tuple(f"joint{d}" for d in range(plans.shape[2]))
    return Demonstrations(plans, outcomes, PlanFormat(names, ("rad",) * len(names), DT))


def misaligned(jitter: float = 0.0, stretches: np.ndarray | None = None) -> Demonstrations:
    rng = np.random.default_rng(1)
    stretches = np.ones(6) if stretches is None else stretches
    plans = np.stack([throw(s, a) for s, a in zip(TRUE_SHIFTS, stretches, strict=True)])
    return demonstrations(plans + jitter * rng.normal(size=plans.shape))


def errors_in_frames(shifts: np.ndarray) -> np.ndarray:
    """Estimated minus true, up to the common offset that no motion can tell."""
    errors = (shifts + TRUE_SHIFTS) / DT
    return np.asarray(errors - errors.mean())


def test_equal_motions_are_aligned_to_a_thousandth_of_a_frame():
    """One motion at six times: the shifts come back, and the plans then agree."""
    alignment = align(misaligned())
    assert np.abs(errors_in_frames(alignment.shifts)).max() < 1e-3
    assert alignment.demonstrations.plans.std(axis=0).max() < 2e-4  # [rad], interpolation only


def test_motions_of_unequal_size_are_aligned_to_a_tenth_of_a_frame():
    stretches = np.array([0.6, 0.8, 1.0, 1.2, 1.4, 1.6])
    alignment = align(misaligned(stretches=stretches))
    assert np.abs(errors_in_frames(alignment.shifts)).max() < 0.1


def test_two_milliradians_of_jitter_cost_less_than_a_tenth_of_a_frame():
    alignment = align(misaligned(jitter=0.002))
    assert np.abs(errors_in_frames(alignment.shifts)).max() < 0.1


def test_a_shift_is_a_shift_of_the_recorded_plan():
    """A'(t) = A(t - s): between the held ends, only time has changed."""
    before = misaligned()
    alignment = align(before)
    assert alignment.demonstrations.horizon == before.horizon
    for i in range(before.n):
        expected = throw(TRUE_SHIFTS[i] + alignment.shifts[i])
        np.testing.assert_allclose(alignment.demonstrations.plans[i], expected, atol=5e-4)
    np.testing.assert_array_equal(alignment.demonstrations.outcomes_seen, before.outcomes_seen)
    assert alignment.demonstrations.format == before.format


def test_aligning_twice_changes_nothing_more():
    once = align(misaligned())
    twice = align(once.demonstrations)
    assert np.abs(twice.shifts).max() / DT < 1e-3
    np.testing.assert_allclose(twice.demonstrations.plans, once.demonstrations.plans, atol=1e-5)


def test_constant_plans_are_left_as_they_are():
    plans = np.stack([np.full((140, 2), value) for value in (0.1, -0.3, 1.5)])
    alignment = align(demonstrations(plans))
    np.testing.assert_array_equal(alignment.shifts, 0)
    np.testing.assert_allclose(alignment.demonstrations.plans, plans, atol=1e-12)


def test_a_constant_plan_among_moving_ones_does_not_disturb_them():
    before = misaligned()
    plans = np.concatenate([before.plans, np.full((1, 140, 4), 0.4)])
    alignment = align(demonstrations(plans))
    assert np.abs(errors_in_frames(alignment.shifts[:6])).max() < 1e-3
    np.testing.assert_allclose(alignment.demonstrations.plans[6], plans[6], atol=1e-12)


def test_the_horizon_grows_rather_than_cut_a_motion_off():
    """Two motions that fill their recordings, one quick at its beginning, one at its end."""
    quick_first = ramp(0.1, 0.5) + 0.3 * ramp(0.6, 2.0)
    quick_last = 0.3 * ramp(0.1, 2.0) + ramp(2.1, 0.5)
    before = np.stack([quick_first, quick_last])[:, :, None] * np.ones(2)
    alignment = align(demonstrations(before))
    aligned = alignment.demonstrations.plans
    assert alignment.shifts[0] - alignment.shifts[1] == pytest.approx(2.0, abs=DT)
    assert 60 <= aligned.shape[1] - 140 <= 90  # 100 frames, less rests of 5 to 20 at either side
    np.testing.assert_allclose(aligned[:, 0], 0, atol=2e-3)
    np.testing.assert_allclose(aligned[:, -1], 1.3, atol=2e-3)


def test_a_step_like_channel_does_not_overshoot():
    plans = np.stack(
        [
            np.stack([ramp(1 + s, 0.9), (1.4 + s < FRAMES * DT).astype(float)], axis=1)
            for s in (0.013, -0.027)
        ]
    )
    gripper = align(demonstrations(plans)).demonstrations.plans[:, :, 1]
    assert gripper.min() >= 0
    assert gripper.max() <= 1


def test_a_demonstration_that_ends_in_mid_swing_goes_on():
    """Moved earlier, it shows frames that nobody recorded: they keep its velocity."""
    plans = misaligned().plans[:, :100]
    aligned = align(demonstrations(plans))
    assert np.abs(errors_in_frames(aligned.shifts)).max() < 1.5
    earliest = int(np.argmin(aligned.shifts))
    steps = np.diff(aligned.demonstrations.plans[earliest, :, 0])
    recorded = np.diff(plans[earliest, :, 0])
    if recorded[-1] > 1e-3:
        assert steps[-2] == pytest.approx(recorded[-4:].mean(), rel=0.3)


@pytest.mark.parametrize("smoothing", [-0.01, float("nan")])
def test_a_senseless_smoothing_is_refused(smoothing: float):
    with pytest.raises(ConfigurationError, match="smoothing"):
        align(misaligned(), smoothing=smoothing)
