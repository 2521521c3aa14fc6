"""The chain from hand to recorded pose: tracker, tremor."""

import numpy as np

from reproduction.demonstrations.teleoperation import Teleoperation, record

DT = 0.0125
STILL = np.tile([0.4, 0.1, 0.3, 0.0, 0.2, -0.1], (140, 1))


def test_a_still_hand_of_a_perfect_tracker_records_what_was_meant():
    perfect = Teleoperation(tremor=0.0, tremor_angle=0.0, resolution=1e-9, resolution_angle=1e-9)
    recorded = record(STILL, DT, perfect, np.random.default_rng(0))
    np.testing.assert_allclose(recorded, STILL, atol=2e-9)


def test_tremor_is_slow_small_and_absent_at_both_ends():
    hand = Teleoperation()
    recorded = np.array([record(STILL, DT, hand, np.random.default_rng(s)) for s in range(40)])
    drift = recorded - STILL
    middle = drift[:, 40:100]
    assert np.all(np.abs(middle[..., :3].std(axis=(0, 1)) / hand.tremor - 1) < 0.35)
    assert np.all(np.abs(middle[..., 3:].std(axis=(0, 1)) / hand.tremor_angle - 1) < 0.35)
    assert np.abs(np.diff(recorded[:, :2], axis=1)).max() < 1e-4
    assert np.abs(np.diff(recorded[:, -2:], axis=1)).max() < 1e-4
    window = np.hanning(60)[:, None]  # against leakage from the window's ends
    spectrum = np.abs(np.fft.rfft(window * (middle - middle.mean(axis=1)[:, None]), axis=1)) ** 2
    frequency = np.fft.rfftfreq(60, DT)
    assert spectrum[:, frequency > 5].sum() < 0.05 * spectrum.sum()
