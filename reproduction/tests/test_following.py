"""The filter that an arm follows a hand with."""

import numpy as np

from reproduction.following import follow


def test_the_follower_answers_a_step_like_a_critically_damped_filter():
    """1 - (1 + w t) exp(-w t), for the bilinear rule at 80 Hz and 2 Hz."""
    dt, w = 0.0125, 2 * np.pi * 2.0
    step = np.zeros((140, 2))
    step[1:, 0] = 1.0
    followed = follow(step, dt, bandwidth=2.0)
    t = (np.arange(140) - 0.5) * dt
    np.testing.assert_allclose(followed[1:, 0], (1 - (1 + w * t) * np.exp(-w * t))[1:], atol=5e-3)
    np.testing.assert_array_equal(followed[:, 1], 0.0)
