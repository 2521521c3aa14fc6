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
from prior_reinforce.generators import load_generator
from prior_reinforce.generators.base import FitProgress, Generator, Wrapper
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.registry import PLUGINS
from prior_reinforce.testing.synthetic import synthetic_demonstrations

_ELSEWHERE = """
import importlib
import sys
import numpy as np
from prior_reinforce.generators import load_generator
folder = sys.argv[1]
generator = load_generator(f"{folder}/model")
np.save(f"{folder}/plans.npy", generator.generate(np.load(f"{folder}/conditions.npy")))
"""


class GeneratorContract:
    """Inherit it, and name the generator: `make = staticmethod(SoftmaxBlend)`.

    Every test fits at least one: give a network few steps and a tiny size. A class of one's own is
    registered under its `name` (`GENERATORS.add`) by the module that it stands in.
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
        shape = (3, horizon, action_dim)
        assert plans.shape == shape, f"3 conditions give plans {shape}, as demonstrated"
        assert plans.dtype == np.float64, "plans are float64"
        assert np.all(np.isfinite(plans)), "plans are finite"
        none = generator.generate(np.empty((0, k)))
        assert none.shape == (0, horizon, action_dim), (
            "no conditions give no plans, of shape (0, ...)"
        )

    @pytest.mark.filterwarnings("ignore:the outcomes lie almost on one line")
    def test_two_demonstrations_are_enough(self) -> None:
        demos = synthetic_demonstrations(2)
        plans = self.make().fit(demos, seed=0).generate(demos.outcomes_seen)
        assert plans.shape == demos.plans.shape, "two demonstrations are enough to learn from"

    def test_two_that_look_the_same_by_eye_are_no_trouble(self) -> None:
        demos = synthetic_demonstrations(5)
        outcomes = demos.outcomes_seen.copy()
        outcomes[1] = outcomes[4]
        noise = np.full_like(outcomes, 0.02)
        alike = replace(demos, outcomes_seen=outcomes, outcome_noise=noise)
        plans = self.make().fit(alike, seed=0).generate(_inside(demos, 3))
        low, high = demos.plans.min(), demos.plans.max()
        inside = np.all((plans > low - (high - low)) & (plans < high + (high - low)))
        assert inside, (
            "two demonstrations with one outcome, known to 0.02, throw plans out of what was "
            f"demonstrated: {plans.min():.3g} to {plans.max():.3g}, and {low:.3g} to {high:.3g} was"
        )

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
        assert np.array_equal(first, second), "the same seed gives the same plans, bit for bit"
        assert np.array_equal(conditions, before), "generate leaves its conditions as they were"
        assert torch.get_num_threads() == threads, "torch's number of threads is left as it was"
        kept = torch.equal(torch.get_rng_state(), torch_state)
        assert kept, (
            "torch's global random state is left as it was; draw from the seed given to fit"
        )
        kept = np.array_equal(_global_numpy_state(), numpy_state)
        assert kept, (
            "NumPy's global random state is left as it was; draw from the seed given to fit"
        )

    def test_a_plan_depends_on_its_condition_alone(self) -> None:
        demos, generator = self._fitted()
        conditions = _inside(demos, 6)
        together = generator.generate(conditions)
        generator.generate(conditions[::-1])
        again, alone = generator.generate(conditions), generator.generate(conditions[4:5])[0]
        assert np.array_equal(again, together), "a plan is the same each time it is asked for"
        near = np.allclose(alone, together[4], rtol=1e-7, atol=1e-4)
        assert near, "a plan depends on its condition, and on no other that is asked for with it"

    def test_what_was_generated_is_not_shared(self) -> None:
        demos, generator = self._fitted()
        plans = generator.generate(demos.outcomes_seen)
        kept = plans.copy()
        plans += 1
        again = generator.generate(demos.outcomes_seen)
        assert np.array_equal(again, kept), "generate returns a fresh array each time"

    def test_saved_and_loaded_it_generates_the_same_bit_for_bit(self, tmp_path: Path) -> None:
        demos, generator = self._fitted()
        generator.save(tmp_path / "model")
        conditions = _inside(demos, 5)
        loaded = load_generator(tmp_path / "model")
        assert type(loaded) is type(generator), "a saved generator is loaded as its own class"
        same = np.array_equal(loaded.generate(conditions), generator.generate(conditions))
        assert same, "from_state rebuilds what state gave: the same plans, bit for bit"
        assert loaded.remarks == generator.remarks, "remarks are kept with the model"
        loaded.save(tmp_path / "copy")
        saved, copied = (
            {file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()}
            for folder in ("model", "copy")
        )
        assert copied == saved, "saved, loaded and saved again, a model is the same files"

    def test_a_damaged_model_is_a_named_error(self, tmp_path: Path) -> None:
        _, generator = self._fitted()
        generator.save(tmp_path)
        weights = tmp_path / "model.safetensors"
        packed = bytearray(weights.read_bytes())
        packed[-3] ^= 1
        weights.write_bytes(packed)
        with pytest.raises(FileFormatError, match="checksum"):
            load_generator(tmp_path)

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
        assert not (tmp_path / "model").exists(), "a save that is refused writes nothing"

    def test_progress_ends_with_all_steps_done(self) -> None:
        heard: list[FitProgress] = []
        self.make().fit(synthetic_demonstrations(4), seed=0, progress=heard.append)
        assert heard, "_fit calls progress(FitProgress(...)), at least once, when it is done"
        steps = [p.step for p in heard]
        assert steps == sorted({*steps}), f"progress reports steps that grow, not {steps}"
        done = (heard[-1].step, heard[-1].seconds_left)
        assert done == (heard[-1].n_steps, 0), f"progress ends with all steps done, not {heard[-1]}"
        sound = all(np.isfinite(p.loss) and p.seconds_left >= 0 for p in heard)
        assert sound, "progress reports a finite loss, and seconds left that are not negative"

    def test_another_process_gives_the_same_plans(self, tmp_path: Path) -> None:
        demos, generator = self._fitted()
        generator.save(tmp_path / "model")
        conditions = _inside(demos, 4)
        np.save(tmp_path / "conditions.npy", conditions)
        # One thread there by default: the generator sets the number itself.
        environment = os.environ | {
            "OMP_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            PLUGINS: _modules(generator),
        }
        command = [sys.executable, "-c", _ELSEWHERE, str(tmp_path)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert not done.returncode, f"another process cannot load the model: {done.stderr[-2000:]}"
        same = np.array_equal(np.load(tmp_path / "plans.npy"), generator.generate(conditions))
        assert same, "another process that loads the model generates the same plans, bit for bit"

    def _fitted(self) -> tuple[Demonstrations, Generator]:
        demos = synthetic_demonstrations(4)
        return demos, self.make().fit(demos, seed=0)


def _modules(generator: Generator) -> str:
    """Modules of a generator and of what it wraps: importing them registers their classes."""
    inner = [_modules(generator.generator)] if isinstance(generator, Wrapper) else []
    return ",".join([type(generator).__module__, *inner])


def _inside(demos: Demonstrations, n: int) -> Points:
    """Conditions inside the demonstrated outcomes."""
    low, high = demos.outcomes_seen.min(axis=0), demos.outcomes_seen.max(axis=0)
    return np.random.default_rng(1).uniform(low, high, (n, len(low)))


def _global_numpy_state() -> Any:
    return np.random.get_state()[1].copy()  # type: ignore[index]  # noqa: NPY002
