"""What every motion generator keeps to."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prior_reinforce.arrays import Points
from prior_reinforce.errors import FileFormatError, InvalidGoalError, NotFittedError
from prior_reinforce.generators import GENERATORS, load_generator
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.registry import own_class
from prior_reinforce.testing.synthetic import synthetic_demonstrations

_ELSEWHERE = """
import sys
import numpy as np
from prior_reinforce.generators import load_generator
folder, own = sys.argv[1], sys.argv[2] or None
generator = load_generator(f"{folder}/model", own=own)
np.save(f"{folder}/plans.npy", generator.generate(np.load(f"{folder}/conditions.npy")))
"""


class GeneratorContract:
    """Inherit it, and name the generator: `make = staticmethod(SoftmaxBlend)`.

    Every test fits at least one: give a network few steps and a tiny size. The class must be one
    that another process can import.
    """

    make: Callable[[], Generator]
    """Makes a generator that is fitted in a moment."""

    @pytest.mark.parametrize(("horizon", "action_dim", "k"), [(140, 7, 2), (5, 1, 1), (62, 2, 3)])
    def test_plans_have_the_demonstrated_shape_and_are_finite(
        self, horizon: int, action_dim: int, k: int
    ) -> None:
        demos = synthetic_demonstrations(4, horizon=horizon, action_dim=action_dim, k=k)
        generator = self.make().fit(demos, seed=0)
        plans = generator.generate(_inside(demos, 3))
        assert plans.shape == (3, horizon, action_dim)
        assert plans.dtype == np.float64
        assert np.all(np.isfinite(plans))
        assert generator.generate(np.empty((0, k))).shape == (0, horizon, action_dim)

    def test_two_demonstrations_are_enough(self) -> None:
        demos = synthetic_demonstrations(2)
        plans = self.make().fit(demos, seed=0).generate(demos.outcomes_seen)
        assert plans.shape == demos.plans.shape

    def test_two_that_look_the_same_by_eye_are_no_trouble(self) -> None:
        demos = synthetic_demonstrations(5)
        outcomes = demos.outcomes_seen.copy()
        outcomes[1] = outcomes[4]
        noise = np.full_like(outcomes, 0.02)
        alike = replace(demos, outcomes_seen=outcomes, outcome_noise=noise)
        plans = self.make().fit(alike, seed=0).generate(_inside(demos, 3))
        low, high = demos.plans.min(), demos.plans.max()
        assert np.all((plans > low - (high - low)) & (plans < high + (high - low)))

    def test_the_same_seed_gives_the_same_plans_and_leaves_everything_as_it_was(self) -> None:
        import torch

        demos = synthetic_demonstrations(4)
        conditions = _inside(demos, 5)
        before = conditions.copy()
        threads, torch_state, numpy_state = (
            torch.get_num_threads(), torch.get_rng_state(), _global_numpy_state(),
        )  # fmt: skip
        first = self.make().fit(demos, seed=3).generate(conditions)
        torch.rand(3)
        torch.set_rng_state(torch_state)
        second = self.make().fit(demos, seed=3).generate(conditions)
        np.testing.assert_array_equal(first, second)
        np.testing.assert_array_equal(conditions, before)
        assert torch.get_num_threads() == threads
        assert torch.equal(torch.get_rng_state(), torch_state)
        np.testing.assert_array_equal(_global_numpy_state(), numpy_state)

    def test_a_plan_depends_on_its_condition_alone(self) -> None:
        demos, generator = self._fitted()
        conditions = _inside(demos, 6)
        together = generator.generate(conditions)
        generator.generate(conditions[::-1])
        np.testing.assert_array_equal(generator.generate(conditions), together)
        np.testing.assert_allclose(generator.generate(conditions[4:5])[0], together[4], atol=1e-4)

    def test_what_was_generated_is_not_shared(self) -> None:
        demos, generator = self._fitted()
        plans = generator.generate(demos.outcomes_seen)
        kept = plans.copy()
        plans += 1
        np.testing.assert_array_equal(generator.generate(demos.outcomes_seen), kept)

    def test_saved_and_loaded_it_generates_the_same_bit_for_bit(self, tmp_path: Path) -> None:
        demos, generator = self._fitted()
        generator.save(tmp_path / "model")
        conditions = _inside(demos, 5)
        loaded = load_generator(tmp_path / "model", own=_own_name(generator))
        assert type(loaded) is type(generator)
        np.testing.assert_array_equal(loaded.generate(conditions), generator.generate(conditions))
        assert loaded.remarks == generator.remarks
        loaded.save(tmp_path / "copy")
        saved, copied = (
            {file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()}
            for folder in ("model", "copy")
        )
        assert copied == saved

    def test_a_damaged_model_is_a_named_error(self, tmp_path: Path) -> None:
        _, generator = self._fitted()
        generator.save(tmp_path)
        weights = tmp_path / "model.safetensors"
        packed = bytearray(weights.read_bytes())
        packed[-3] ^= 1
        weights.write_bytes(packed)
        with pytest.raises(FileFormatError, match="checksum"):
            load_generator(tmp_path, own=_own_name(generator))

    def test_bad_conditions_are_named(self) -> None:
        _, generator = self._fitted()
        bad: Any
        for bad in (np.zeros(2), np.zeros((3, 1)), np.zeros((1, 2, 2)), [["a", "b"]]):
            with pytest.raises(InvalidGoalError):
                generator.generate(bad)
        with pytest.raises(InvalidGoalError, match="row 1"):
            generator.generate(np.array([[0.1, 0.2], [np.nan, 0.2]]))

    def test_before_fit_it_says_so(self, tmp_path: Path) -> None:
        with pytest.raises(NotFittedError):
            self.make().generate(np.zeros((1, 2)))
        with pytest.raises(NotFittedError):
            self.make().save(tmp_path / "model")
        assert not (tmp_path / "model").exists()

    def test_progress_ends_with_all_steps_done(self) -> None:
        heard: list[FitProgress] = []
        self.make().fit(synthetic_demonstrations(4), seed=0, progress=heard.append)
        assert [p.step for p in heard] == sorted({p.step for p in heard})
        assert heard[-1].step == heard[-1].n_steps
        assert all(np.isfinite(p.loss) and p.seconds_left >= 0 for p in heard)
        assert heard[-1].seconds_left == 0

    def test_another_process_gives_the_same_plans(self, tmp_path: Path) -> None:
        demos, generator = self._fitted()
        generator.save(tmp_path / "model")
        conditions = _inside(demos, 4)
        np.save(tmp_path / "conditions.npy", conditions)
        # One thread there by default: the generator sets the number itself.
        environment = os.environ | {
            "OMP_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        }
        own = _own_name(generator) or ""
        subprocess.run(
            [sys.executable, "-c", _ELSEWHERE, str(tmp_path), own], check=True, env=environment
        )
        plans = np.load(tmp_path / "plans.npy")
        np.testing.assert_array_equal(plans, generator.generate(conditions))

    def _fitted(self) -> tuple[Demonstrations, Generator]:
        demos = synthetic_demonstrations(4)
        return demos, self.make().fit(demos, seed=0)


def _inside(demos: Demonstrations, n: int) -> Points:
    """Conditions inside the demonstrated outcomes."""
    low, high = demos.outcomes_seen.min(axis=0), demos.outcomes_seen.max(axis=0)
    return np.random.default_rng(1).uniform(low, high, (n, len(low)))


def _own_name(generator: Generator) -> str | None:
    """`module:Class` of a generator that a model does not name; None for one of ours."""
    return own_class(GENERATORS.name_of(generator))


def _global_numpy_state() -> Any:
    return np.random.get_state()[1].copy()  # type: ignore[index]  # noqa: NPY002
