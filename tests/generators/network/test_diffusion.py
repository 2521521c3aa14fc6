"""The diffusion generator learns a handful of synthetic throws, of any make."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import NotFittedError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.network.config import DiffusionConfig, PerceptronSize, UNetSize
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.timing.timed import Timed
from prior_reinforce.plans.motions import Demonstrations

SMALL = DiffusionConfig(
    coordinates="time",
    network=UNetSize(
        widths=(32, 64), step_width=32, condition_width=32, activation="silu"
    ),
    prediction="sample",
    training_steps=200,
    batch_size=12,
    learning_rate=4e-3,
    warmup_steps=20,
    sampling_steps=5,
    ema_limit=0.99,
)  # fmt: skip


FEW = DiffusionConfig(perceptron=PerceptronSize(members=2, width=32), training_steps=30)


def misses(generator: Timed, demos: Demonstrations) -> np.ndarray:
    """Rms over time at the demonstrations' own outcomes, in ranges of each dimension: (N, D)."""
    span = np.maximum(np.ptp(demos.plans, axis=(0, 1)), 1e-9)
    return np.sqrt(np.mean((generator.generate(demos.outcomes_seen) - demos.plans) ** 2, 1)) / span


@pytest.mark.slow
def test_demonstrations_come_back_and_between_them_the_direction_follows_the_condition(throws):
    """The network alone, with nothing around it but timing."""
    demos = throws(4, 80)
    generator = Timed(DiffusionGenerator(SMALL)).fit(demos, seed=0)
    assert misses(generator, demos).max() < 0.02
    middle = demos.outcomes_seen.mean(axis=0, keepdims=True)
    plan = generator.generate(middle)[0]
    assert plan[40, 2] == pytest.approx(middle[0, 1], abs=0.1 * np.ptp(demos.outcomes_seen[:, 1]))


def test_mixed_dimensions_come_back_at_outcomes_of_mixed_units(swing, plan_format):
    t = np.arange(32) / 32
    starts = np.array([0.0, 0.12, 0.25])
    plans = np.stack(
        [
            np.stack(
                [
                    swing(t, start, 0.6),
                    (t > 0.4 + start).astype(float),  # gripper
                    np.full(32, 0.7),  # constant
                    0.01 * swing(t, 0.5 + start, 1.0),  # cut off in mid-swing, of another scale
                ],
                axis=1,
            )
            for start in starts
        ]
    )
    outcomes = np.array([[0.9, 20.0], [1.0, 35.0], [1.1, 10.0]])
    plan = replace(plan_format(4), units=("rad", "rad", "rad", "m"))
    demos = Demonstrations(plans, outcomes, plan, OutcomeFormat(("x", "y"), ("m", "s")))
    errors = {}
    for steps in (0, 500):
        generator = Timed(DiffusionGenerator(replace(SMALL, training_steps=steps)))
        errors[steps] = misses(generator.fit(demos, seed=0), demos)[:, [0, 3]].max()
    assert errors[500] < 0.05
    assert errors[0] > 0.3
    back = generator.generate(outcomes)
    np.testing.assert_allclose(back[:, :, 1:3], plans[:, :, 1:3], atol=1e-12)
    between = generator.generate(np.array([[0.95, 28.0], [1.05, 20.0]]))
    assert set(np.unique(between[:, :, 1])) <= {0.0, 1.0}


def test_two_seeds_differ_and_the_generator_can_be_fitted_again(throws):
    demos = throws(3, 40)
    config = replace(SMALL, training_steps=5)
    generator = DiffusionGenerator(config)
    first = generator.fit(demos, seed=0).generate(demos.outcomes_seen)
    second = generator.fit(demos, seed=1).generate(demos.outcomes_seen)
    assert not np.array_equal(first, second)
    again = generator.fit(demos, seed=0).generate(demos.outcomes_seen)
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("other", [{"sampler": "ddpm"}, {"shared_noise": False}])
def test_a_network_sampled_otherwise_is_the_one_that_was_fitted_so(throws, other):
    demos = throws(3)
    network = DiffusionGenerator(FEW).fit(demos, seed=0)
    before = network.generate(demos.outcomes_seen)
    sampled = network.sampled(**other)
    as_fitted = DiffusionGenerator(replace(FEW, **other)).fit(demos, seed=0)
    plans = sampled.generate(demos.outcomes_seen)
    np.testing.assert_array_equal(plans, as_fitted.generate(demos.outcomes_seen))
    assert np.abs(plans - before).max() > 1e-6
    assert sampled.config == as_fitted.config
    np.testing.assert_array_equal(network.generate(demos.outcomes_seen), before)


def test_fresh_noise_is_another_plan_of_the_same_network(throws):
    demos = throws(3)
    network = DiffusionGenerator(replace(FEW, shared_noise=False)).fit(demos, seed=0)
    before = network.generate(demos.outcomes_seen)
    one, other = (network.sampled(seed=n).generate(demos.outcomes_seen) for n in (1, 2))
    assert np.abs(one - other).max() > 1e-6
    assert np.array_equal(network.sampled(seed=1).generate(demos.outcomes_seen), one)
    assert np.array_equal(network.sampled(seed=0).generate(demos.outcomes_seen), before)
    with pytest.raises(NotFittedError):
        DiffusionGenerator(FEW).sampled(seed=1)


def test_in_the_demonstrations_span_plans_are_mixtures_and_nearest_at_their_own_outcomes(throws):
    demos = throws(4)
    config = DiffusionConfig(perceptron=PerceptronSize(width=64), training_steps=300)
    own = {
        steps: DiffusionGenerator(replace(config, training_steps=steps)).fit(demos, seed=0)
        for steps in (0, 300)
    }
    span = np.ptp(demos.plans, axis=(0, 1))
    errors = {
        steps: np.abs((network.generate(demos.outcomes_seen) - demos.plans) / span).max()
        for steps, network in own.items()
    }
    assert errors[300] < 0.05
    assert errors[0] > 0.3
    flat = demos.plans.reshape(4, -1)
    plan = own[300].generate([[0.95, 0.1]]).reshape(-1)
    weights = np.linalg.lstsq((flat[1:] - flat[0]).T, plan - flat[0], rcond=None)[0]
    np.testing.assert_allclose(flat[0] + weights @ (flat[1:] - flat[0]), plan, atol=2e-3)
