import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prior_reinforce.environment import Rollout
from prior_reinforce.perception.eye import Eye


def seen_cm(error_cm: float, goal: float = 0.0) -> float:
    rollout = Rollout(outcome=np.array([goal + error_cm / 100.0]), valid=True)
    reading = Eye().perceive(rollout, np.array([goal]), np.random.default_rng(0))
    return float(100.0 * reading.error_seen[0])


@pytest.mark.parametrize(
    ("error", "seen"),
    [
        *[(0.0, 0), (0.9, 0), (1.1, 2), (3.4, 2), (3.6, 5), (7.4, 5), (7.6, 10), (14.9, 10)],
        *[(15.1, 20), (24.9, 20), (25.1, 30), (95.1, 100), (-1.1, -2), (-7.6, -10), (-25.1, -30)],
    ],
)
def test_rounds_to_0_2_5_or_tens_and_keeps_the_sign(error, seen):
    assert seen_cm(error) == pytest.approx(seen)


@pytest.mark.parametrize(
    ("tie", "seen"), [(1, 2), (3.5, 5), (7.5, 10), (15, 20), (25, 30), (-1, -2), (-35, -40)]
)
@pytest.mark.parametrize("goal", [0.0, 0.91, 0.1, 1.07])
def test_a_tie_counts_as_the_larger_whatever_the_rounding_of_floats(tie, seen, goal):
    assert seen_cm(tie, goal) == pytest.approx(seen)


@pytest.mark.slow
@given(st.floats(-3.0, 3.0))
def test_nothing_is_seen_further_off_than_half_a_step(error):
    rollout = Rollout(outcome=np.array([error]), valid=True)
    said = Eye().perceive(rollout, np.zeros(1), np.random.default_rng(0))
    seen = float(said.error_seen[0])
    assert said.low[0] - 1e-9 <= error <= said.high[0] + 1e-9
    half_step = 0.01 if abs(error) < 0.02 else 0.015 if abs(error) < 0.05 else 0.025
    half_step = half_step if abs(error) < 0.1 else 0.05
    assert abs(seen - error) <= half_step + 1e-9
    again = Rollout(outcome=np.array([seen]), valid=True)
    said = Eye().perceive(again, np.zeros(1), np.random.default_rng(0))
    assert said.error_seen[0] == pytest.approx(seen)


@pytest.mark.parametrize(
    ("error", "seen"),
    [
        ((0.9, 0.8), (2, 0)),
        ((-0.3, -0.98), (0, -2)),
        ((0.6, 0.6), (0, 0)),  # 0.85 cm: nearer to nothing than to 2 cm
        ((1.1, 0.9), (2, 0)),
        ((0.6, 0.8), (0, 2)),  # 1 cm: a tie
        ((-0.8, 0.6), (-2, 0)),
        ((0.7, 0.3, -0.9), (0, 0, -2)),
    ],
)
def test_a_miss_of_a_centimetre_is_never_called_none(error, seen):
    rollout = Rollout(outcome=np.array(error) / 100, valid=True)
    told = Eye().perceive(rollout, np.zeros(len(error)), np.random.default_rng(0))
    np.testing.assert_allclose(100 * told.error_seen, seen)
    assert np.all(100 * told.low <= error)
    assert np.all(error <= 100 * told.high)


def test_a_small_miss_to_the_left_is_no_negative_zero():
    assert not np.signbit(seen_cm(-0.5))
