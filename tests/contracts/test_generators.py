"""What every generator keeps to. A new one: add a line to FACTORIES."""

import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import torch

from prior_reinforce.errors import FileFormatError, InvalidGoalError, NotFittedError
from prior_reinforce.generators import (
    DiffusionConfig,
    DiffusionGenerator,
    DynamicMovementPrimitives,
    FitProgress,
    Generator,
    NearestNeighbours,
    SmoothInterpolation,
    UNetRegression,
    UNetRegressionConfig,
    load_generator,
)
from prior_reinforce.generators.dmp import DynamicMovementPrimitivesConfig
from prior_reinforce.generators.saving import CONFIG_FILE, TENSOR_FILE
from prior_reinforce.generators.config import UNetSize
from prior_reinforce.plans.motions import Demonstrations, PlanFormat

# Trained for a moment only: these tests are about the contract, not about quality.
_TINY = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=8)
_MOMENT = DiffusionConfig(network=_TINY, training_steps=8, warmup_steps=2, sampling_steps=3)


def _small_ddpm() -> DiffusionGenerator:
    config = DiffusionConfig(
        network=_TINY, training_steps=8, representation="frames", sampler="ddpm", noise_levels=6,
        sampling_steps=6,
    )  # fmt: skip
    return DiffusionGenerator(config, threads=1)


FACTORIES: list[Callable[[], Generator]] = [
    lambda: DiffusionGenerator(_MOMENT, threads=1),
    _small_ddpm,
    NearestNeighbours,
    SmoothInterpolation,
    DynamicMovementPrimitives,
    lambda: DynamicMovementPrimitives(DynamicMovementPrimitivesConfig(segmented=False)),
    lambda: UNetRegression(UNetRegressionConfig(network=_TINY, training_steps=8)),
]
IDS = [
    "diffusion-splines-mean-shift",
    "diffusion-frames-ddpm",
    "nearest",
    "interpolation",
    "dmp",
    "dmp-whole",
    "regression",
]

pytestmark = [pytest.mark.parametrize("make", FACTORIES, ids=IDS)]


def demonstrations(n: int = 4, horizon: int = 40, action_dim: int = 3, k: int = 2):
    rng = np.random.default_rng(0)
    outcomes = rng.uniform(size=(n, k)) * [0.3, 40.0, 1e-3][:k]
    times = np.linspace(0, 1, horizon)
    ramps = np.clip((times - rng.uniform(0, 0.3, (n, 1))) / 0.6, 0, 1)[:, :, None]
    plans = rng.normal(size=(n, 1, action_dim)) + ramps**2 * (3 - 2 * ramps)
    names = tuple(f"joint{d}" for d in range(action_dim))
    plan_format = PlanFormat(names, ("rad",) * action_dim, 0.02)
    return Demonstrations(plans, outcomes, plan_format, outcome_units=("m", "s", "N")[:k])


def inside(demos: Demonstrations, n: int) -> np.ndarray:
    low, high = demos.outcomes_seen.min(axis=0), demos.outcomes_seen.max(axis=0)
    return np.random.default_rng(1).uniform(low, high, (n, len(low)))


@pytest.mark.parametrize(("horizon", "action_dim", "k"), [(140, 7, 2), (5, 1, 1), (62, 2, 3)])
def test_plans_have_the_demonstrated_shape_and_are_finite(make, horizon, action_dim, k):
    demos = demonstrations(horizon=horizon, action_dim=action_dim, k=k)
    generator = make().fit(demos, seed=0)
    plans = generator.generate(inside(demos, 3))
    assert plans.shape == (3, horizon, action_dim)
    assert plans.dtype == np.float64
    assert np.all(np.isfinite(plans))
    assert generator.generate(np.empty((0, k))).shape == (0, horizon, action_dim)


def test_two_demonstrations_are_enough(make):
    demos = demonstrations(n=2)
    assert make().fit(demos, seed=0).generate(demos.outcomes_seen).shape == demos.plans.shape


def test_the_same_seed_gives_the_same_plans_and_leaves_everything_as_it_was(make):
    demos = demonstrations()
    conditions = inside(demos, 5)
    before = conditions.copy()
    threads, torch_state, numpy_state = (
        torch.get_num_threads(), torch.get_rng_state(), np.random.get_state()[1].copy(),  # noqa: NPY002
    )  # fmt: skip
    first = make().fit(demos, seed=3).generate(conditions)
    torch.rand(3)
    torch.set_rng_state(torch_state)
    second = make().fit(demos, seed=3).generate(conditions)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(conditions, before)
    assert torch.get_num_threads() == threads
    assert torch.equal(torch.get_rng_state(), torch_state)
    np.testing.assert_array_equal(np.random.get_state()[1], numpy_state)  # noqa: NPY002


def test_a_plan_depends_on_its_condition_alone(make):
    demos = demonstrations()
    generator = make().fit(demos, seed=0)
    conditions = inside(demos, 6)
    together = generator.generate(conditions)
    generator.generate(conditions[::-1])
    np.testing.assert_array_equal(generator.generate(conditions), together)
    np.testing.assert_allclose(generator.generate(conditions[4:5])[0], together[4], atol=1e-4)


def test_what_was_generated_is_not_shared(make):
    demos = demonstrations()
    generator = make().fit(demos, seed=0)
    plans = generator.generate(demos.outcomes_seen)
    kept = plans.copy()
    plans += 1
    np.testing.assert_array_equal(generator.generate(demos.outcomes_seen), kept)


def test_saved_and_loaded_it_generates_the_same_bit_for_bit(make, tmp_path):
    demos = demonstrations()
    generator = make().fit(demos, seed=0)
    generator.save(tmp_path / "model")
    conditions = inside(demos, 5)
    loaded = load_generator(tmp_path / "model")
    assert type(loaded) is type(generator)
    np.testing.assert_array_equal(loaded.generate(conditions), generator.generate(conditions))
    again = type(generator).load(tmp_path / "model")
    again.save(tmp_path / "copy")
    for name in (CONFIG_FILE, TENSOR_FILE):
        assert (tmp_path / "copy" / name).read_bytes() == (tmp_path / "model" / name).read_bytes()


def test_a_damaged_model_is_a_named_error(make, tmp_path):
    make().fit(demonstrations(), seed=0).save(tmp_path)
    packed = bytearray((tmp_path / TENSOR_FILE).read_bytes())
    packed[-3] ^= 1
    (tmp_path / TENSOR_FILE).write_bytes(packed)
    with pytest.raises(FileFormatError, match="checksum"):
        load_generator(tmp_path)


def test_bad_conditions_are_named(make):
    generator = make().fit(demonstrations(), seed=0)
    for bad in (np.zeros(2), np.zeros((3, 1)), np.zeros((1, 2, 2)), [["a", "b"]]):
        with pytest.raises(InvalidGoalError):
            generator.generate(bad)
    with pytest.raises(InvalidGoalError, match="row 1"):
        generator.generate(np.array([[0.1, 0.2], [np.nan, 0.2]]))


def test_before_fit_it_says_so(make, tmp_path):
    with pytest.raises(NotFittedError):
        make().generate(np.zeros((1, 2)))
    with pytest.raises(NotFittedError):
        make().save(tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_progress_ends_with_all_steps_done(make):
    heard: list[FitProgress] = []
    make().fit(demonstrations(), seed=0, progress=heard.append)
    assert [p.step for p in heard] == sorted({p.step for p in heard})
    assert heard[-1].step == heard[-1].n_steps
    assert all(np.isfinite(p.loss) and p.seconds_left >= 0 for p in heard)
    assert heard[-1].seconds_left == 0


def test_another_process_gives_the_same_plans(make, tmp_path):
    demos = demonstrations()
    generator = make().fit(demos, seed=0)
    generator.save(tmp_path / "model")
    conditions = inside(demos, 4)
    np.save(tmp_path / "conditions.npy", conditions)
    code = (
        "import sys, numpy as np; from prior_reinforce.generators import load_generator; "
        "folder = sys.argv[1]; g = load_generator(folder + '/model'); "
        "np.save(folder + '/plans.npy', g.generate(np.load(folder + '/conditions.npy')))"
    )
    # One thread there by default: the generator sets the number itself.
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, env=environment)
    np.testing.assert_array_equal(np.load(tmp_path / "plans.npy"), generator.generate(conditions))
