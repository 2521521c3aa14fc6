"""When channels that jump do so, and that their parts add up again."""

import numpy as np
import pytest

from prior_reinforce.generators.timing.events import Step, transitions
from tests.plans.test_signals import OPENS, plans


def test_the_time_of_a_transition_is_its_middle():
    at = transitions(plans()[:, :, 2])
    assert at is not None
    np.testing.assert_allclose(at[:, 0] - at[0, 0], np.array(OPENS) - OPENS[0], atol=1e-9)
    assert at[0, 0] == pytest.approx(OPENS[0] + 3, abs=0.2)


def test_demonstrations_that_change_differently_often_have_no_common_transitions():
    values = plans()[:, :, 2].copy()
    values[1, 80:] = 0.0
    assert transitions(values) is None


@pytest.mark.parametrize("sigma", [2e-4, 2e-3])
def test_noise_is_no_transition(sigma):
    noisy = plans()[:, :, 2] + sigma * np.random.default_rng(0).normal(size=(4, 90))
    at = transitions(noisy, sigma)
    assert at is not None
    np.testing.assert_allclose(at[:, 0], np.array(OPENS) + 3, atol=0.3)


def test_parts_add_up_to_the_channel():
    opened_and_closed = np.interp(np.arange(90), [0, 30, 36, 60, 64, 89], [0, 0, 1, 1, 0.2, 0.2])
    step, times = Step(0, (40, 65)), np.array([33, 62])
    tau = np.arange(-20.0, 120)
    parts = step.split(opened_and_closed, times, tau)
    samples = np.arange(90.0) + (np.array(step.phases) - times)[:, None] + 20
    np.testing.assert_allclose(step.join(parts, samples), opened_and_closed, atol=1e-12)


def test_a_switch_takes_its_nearest_value():
    step = Step(0, (3,), levels=(0.0, 1.0))
    halfway = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])[:, None]
    values = step.join(halfway, np.arange(6.0)[None])
    assert values.tolist() == [0, 0, 0, 1, 1, 1]
