"""The diffusion generator learns a handful of synthetic throws, of any make."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from throws import plan_format, swing, throws

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import DiffusionConfig, DiffusionGenerator, load_generator
from prior_reinforce.generators.diffusion_training import draw_batch, learning_rate_factor
from prior_reinforce.generators.unet_size import UNetSize
from prior_reinforce.plans.motions import Demonstrations

SMALL = DiffusionConfig(
    network=UNetSize(
        widths=(32, 64), step_width=32, condition_width=32, activation="silu"
    ),
    prediction="sample",
    training_steps=500,
    batch_size=12,
    learning_rate=2e-3,
    warmup_steps=20,
    sampling_steps=5,
    ema_limit=0.99,
)  # fmt: skip


def fitted(demos: Demonstrations, config: DiffusionConfig = SMALL) -> DiffusionGenerator:
    return DiffusionGenerator(config, threads=1).fit(demos, seed=0)


def misses(generator: DiffusionGenerator, demos: Demonstrations) -> np.ndarray:
    """Rms over time at the demonstrations' own outcomes, in ranges of each dimension: (N, D)."""
    span = np.maximum(np.ptp(demos.plans, axis=(0, 1)), 1e-9)
    return np.sqrt(np.mean((generator.generate(demos.outcomes_seen) - demos.plans) ** 2, 1)) / span


@pytest.mark.slow
@pytest.mark.parametrize(("n", "horizon"), [(2, 62), (4, 140)])
def test_demonstrations_come_back_at_their_own_outcomes(n, horizon):
    demos = throws(n, horizon)
    assert misses(fitted(demos), demos).max() < 0.01


@pytest.mark.slow
def test_a_horizon_of_five_comes_back():
    rng = np.random.default_rng(0)
    demos = Demonstrations(
        rng.uniform(-1, 1, (3, 5, 2)), np.array([[0.1], [0.2], [0.3]]), plan_format(2)
    )
    assert misses(fitted(demos), demos).max() < 0.02


@pytest.mark.slow
def test_mixed_dimensions_come_back_at_outcomes_of_mixed_units():
    t = np.arange(64) / 64
    starts = np.array([0.0, 0.12, 0.25])
    plans = np.stack(
        [
            np.stack(
                [
                    swing(t, start, 0.6),
                    (t > 0.4 + start).astype(float),  # gripper
                    np.full(64, 0.7),  # constant
                    0.01 * swing(t, 0.5 + start, 1.0),  # cut off in mid-swing, of another scale
                ],
                axis=1,
            )
            for start in starts
        ]
    )
    outcomes = np.array([[0.9, 20.0], [1.0, 35.0], [1.1, 10.0]])
    plan = replace(plan_format(4), units=("rad", "rad", "rad", "m"))
    demos = Demonstrations(plans, outcomes, plan, outcome_units=("m", "s"))
    generator = fitted(demos)
    assert misses(generator, demos)[:, [0, 3]].max() < 0.01
    back = generator.generate(outcomes)
    np.testing.assert_array_equal(back[:, :, 1:3], plans[:, :, 1:3])
    between = generator.generate(np.array([[0.95, 28.0], [1.05, 20.0]]))
    assert set(np.unique(between[:, :, 1])) <= {0.0, 1.0}


@pytest.mark.slow
def test_between_demonstrations_the_direction_follows_the_condition():
    demos = throws(4)
    generator = fitted(demos)
    middle = demos.outcomes_seen.mean(axis=0, keepdims=True)
    plan = generator.generate(middle)[0]
    assert plan[70, 2] == pytest.approx(middle[0, 1], abs=0.1 * np.ptp(demos.outcomes_seen[:, 1]))


def test_two_seeds_differ_and_the_generator_can_be_fitted_again():
    demos = throws(3, 40)
    config = replace(SMALL, training_steps=5)
    generator = DiffusionGenerator(config, threads=1)
    first = generator.fit(demos, seed=0).generate(demos.outcomes_seen)
    second = generator.fit(demos, seed=1).generate(demos.outcomes_seen)
    assert not np.array_equal(first, second)
    again = generator.fit(demos, seed=0).generate(demos.outcomes_seen)
    np.testing.assert_array_equal(first, again)


def test_presets_and_representation_are_one_word_each():
    paper = DiffusionGenerator(preset="paper").config
    assert paper.network.widths == (256, 512, 1024)
    assert (paper.representation, paper.sampler, paper.prediction) == ("frames", "ddpm", "epsilon")
    assert (paper.learning_rate, paper.warmup_steps, paper.training_steps) == (2e-4, 500, 5000)
    assert DiffusionGenerator(representation="frames").config.representation == "frames"
    assert DiffusionGenerator().config == DiffusionConfig()


@pytest.mark.parametrize(
    "wrong",
    [{"training_steps": 0}, {"sampling_steps": 101}, {"learning_rate": 0.0}, {"ema_limit": 1.0},
     {"margin": -0.1}, {"warmup_steps": -1}, {"noise_draws": 3}, {"prediction": "eps"},
     {"sampler": "dpm"}, {"representation": "spline"}],
)  # fmt: skip
def test_settings_out_of_range_are_named(wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        DiffusionConfig(**wrong)


def test_config_and_preset_contradict_each_other():
    with pytest.raises(ConfigurationError, match="not both"):
        DiffusionGenerator(DiffusionConfig(), preset="paper")


@pytest.mark.parametrize(
    "device",
    [
        "gpu",
        "meta",
        pytest.param(
            "cuda", marks=pytest.mark.skipif(torch.cuda.is_available(), reason="it is there")
        ),
    ],
)
def test_a_device_that_is_not_there_is_named(device, tmp_path):
    with pytest.raises(ConfigurationError, match=device):
        DiffusionGenerator(device=device)
    config = replace(SMALL, training_steps=1)
    DiffusionGenerator(config, threads=1).fit(throws(2, 20), seed=0).save(tmp_path)
    with pytest.raises(ConfigurationError, match=device):
        load_generator(tmp_path, device=device)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_what_was_learned_on_a_gpu_is_loaded_on_either(tmp_path):
    demos = throws(3, 40)
    config = replace(SMALL, training_steps=5)
    learned = DiffusionGenerator(config, device="cuda").fit(demos, seed=0)
    learned.save(tmp_path)
    plans = learned.generate(demos.outcomes_seen)
    on_gpu = load_generator(tmp_path, device="cuda")
    np.testing.assert_array_equal(on_gpu.generate(demos.outcomes_seen), plans)
    on_cpu = load_generator(tmp_path)
    np.testing.assert_allclose(on_cpu.generate(demos.outcomes_seen), plans, atol=1e-2)


def test_configuration_survives_json():
    config = DiffusionConfig.preset("paper")
    assert DiffusionConfig.from_json(config.to_json()) == config


def test_learning_rate_rises_then_falls_as_a_cosine():
    config = replace(SMALL, warmup_steps=10, training_steps=110)
    factors = [learning_rate_factor(step, config) for step in range(110)]
    assert factors[0] == 0
    assert factors[5] == pytest.approx(0.5)
    assert factors[10] == 1
    assert factors[60] == pytest.approx(0.5)
    assert all(a > b for a, b in itertools.pairwise(factors[10:]))


@pytest.mark.parametrize(("n", "size"), [(6, 24), (6, 10), (40, 24)])
def test_a_batch_holds_every_demonstration_alike_and_one_noise_level_of_each_stratum(n, size):
    config = replace(SMALL, batch_size=size, noise_levels=1000, stratified=True)
    rows, levels = draw_batch(n, config, torch.Generator().manual_seed(0))
    counts = np.bincount(rows, minlength=n)
    assert counts.sum() == size
    assert np.ptp(counts) <= 1
    strata = np.sort(levels.numpy()) * size // 1000
    assert np.all(np.abs(strata - np.arange(size)) <= 1)


def test_the_papers_batch_is_one_pass_over_the_demonstrations():
    config = DiffusionConfig.preset("paper")
    rows, levels = draw_batch(6, config, torch.Generator().manual_seed(0))
    assert sorted(rows.tolist()) == [0, 1, 2, 3, 4, 5]
    assert levels.min() >= 0
    assert levels.max() < 100
