"""What kind of signal a channel is, and how much of it is noise."""

import numpy as np
import pytest

from prior_reinforce.plans.channels import kinds, noise, transitions, without_noise_where_held

FRAMES = np.arange(90)
RAMP = (0.0, 0.05, 0.24, 0.54, 0.83, 0.98, 1.0)
OPENS = (40, 52, 47, 60)


def swing(start: float = 20, duration: float = 40) -> np.ndarray:
    s = np.clip((FRAMES - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def gripper(opens: int) -> np.ndarray:
    return np.interp(FRAMES - opens, np.arange(len(RAMP)), RAMP)


def plans() -> np.ndarray:
    """A joint, a base that is turned and then held, a gripper, a valve."""
    rng = np.random.default_rng(0)
    return np.stack(
        [
            np.stack(
                [
                    (1 + 0.1 * i) * swing(15 + i),
                    0.3 * i + 2e-5 * rng.normal(size=90),
                    gripper(at),
                    (at < FRAMES).astype(float),
                ],
                axis=1,
            )
            for i, at in enumerate(OPENS)
        ]
    )


def test_each_channel_has_its_kind():
    assert kinds(plans(), ("rad", "rad", "1", "1")) == ("smooth", "held", "step", "switch")


def test_a_quick_motion_of_all_joints_is_no_step():
    quick = np.stack([np.stack([a * swing(40, 8), swing(41, 7)], axis=1) for a in (1, 1.2, 1.4)])
    assert kinds(quick, ("rad", "rad")) == ("smooth", "smooth")


@pytest.mark.parametrize("amplitude", [3e-4, 1e-2])
def test_a_channel_that_moves_little_is_not_held(amplitude: float):
    moved = plans()
    moved[:, :, 1] = amplitude * moved[:, :, 0]
    assert kinds(moved, ("rad", "rad", "1", "1"))[1] == "smooth"


def test_the_time_of_a_transition_is_its_middle():
    at = transitions(plans()[:, :, 2])
    assert at is not None
    np.testing.assert_allclose(at[:, 0] - at[0, 0], np.array(OPENS) - OPENS[0], atol=1e-9)
    assert at[0, 0] == pytest.approx(OPENS[0] + 3, abs=0.2)


def test_demonstrations_that_change_differently_often_have_no_common_transitions():
    values = plans()[:, :, 2].copy()
    values[1, 80:] = 0.0
    assert transitions(values) is None


def test_noise_is_estimated_to_a_quarter_beside_a_motion():
    rng = np.random.default_rng(3)
    noisy = plans()[:, :, :1] + 1e-3 * rng.normal(size=(4, 90, 1))
    assert noise(noisy)[0] == pytest.approx(1e-3, rel=0.25)
    assert noise(np.random.default_rng(0).normal(size=(3, 12, 2))).tolist() == [0.0, 0.0]


def test_a_held_channel_is_its_mean_and_all_else_stays():
    given = plans()
    still = without_noise_where_held(given, ("rad", "rad", "m", "bool"))
    np.testing.assert_array_equal(np.ptp(still[:, :, 1], axis=1), 0)
    np.testing.assert_allclose(still[:, 0, 1], given[:, :, 1].mean(axis=1))
    np.testing.assert_array_equal(still[:, :, [0, 2, 3]], given[:, :, [0, 2, 3]])


def test_a_constant_channel_keeps_its_last_digit():
    given = np.full((2, 90, 1), 0.1)
    np.testing.assert_array_equal(without_noise_where_held(given, ("rad",)), given)
