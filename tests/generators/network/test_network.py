"""What diffusion and regression share: threads, devices, and weights that have to fit."""

import copy

import msgspec
import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import load_generator
from prior_reinforce.generators.network import threads, training
from prior_reinforce.generators.network.config import (
    DiffusionConfig,
    PerceptronSize,
    UNetSize,
)
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.network.perceptron import ConditionalPerceptron
from prior_reinforce.generators.network.unet import ConditionalUNet

TINY = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=16)
THIN = PerceptronSize(members=2, width=16, depth=1, step_width=8)
MEMBERS = [
    lambda **how: DiffusionGenerator(
        DiffusionConfig(coordinates="time", network=TINY, training_steps=2), **how
    ),
    lambda **how: DiffusionGenerator(DiffusionConfig(perceptron=THIN, training_steps=2), **how),
]
each = pytest.mark.parametrize("make", MEMBERS, ids=["time", "span"])


@each
def test_training_and_generating_use_one_thread_whatever_torch_was_set_to(
    make, throws, monkeypatch
):
    monkeypatch.setattr(threads, "_SPIN", False)  # pytest imports torch first
    used = set()
    for kind in (ConditionalUNet, ConditionalPerceptron):

        def listen(self, *inputs, forward=kind.forward):
            used.add(torch.get_num_threads())
            return forward(self, *inputs)

        monkeypatch.setattr(kind, "forward", listen)
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        make().fit(throws(2, 20), seed=0).generate(np.array([[0.9, 0.0]]))
        assert used == {1}
        assert torch.get_num_threads() == 2
        used.clear()
        generator = make(threads=2).fit(throws(2, 20), seed=0)
        assert used == {2}
        used.clear()
        generator.generate(np.array([[0.9, 0.0]]))
        assert used == {1}
    finally:
        torch.set_num_threads(before)


@each
def test_no_thread_is_named(make):
    with pytest.raises(ConfigurationError, match="threads"):
        make(threads=0)


@each
def test_another_seed_draws_other_initial_weights(make, throws):
    demos = throws(3, 20)
    one, other = (make().fit(demos, seed=s).generate(demos.outcomes_seen) for s in (0, 1))
    assert np.abs(one - other).max() > 1e-3


@each
def test_weights_of_another_network_are_a_damaged_model(make, throws):
    (layer,) = make().fit(throws(2, 20), seed=0).pack()
    settings = copy.deepcopy(layer.settings)
    settings["config"]["network"]["widths"] = (8, 32)
    if "perceptron" in settings["config"]:
        settings["config"]["perceptron"]["width"] = 32
    with pytest.raises(FileFormatError, match="learn it again"):
        make().unpack_layer(msgspec.structs.replace(layer, settings=settings))
    fewer = {k: v for k, v in layer.tensors.items() if not k.endswith(("head.1.bias", "last.bias"))}
    with pytest.raises(FileFormatError, match="learn it again"):
        make().unpack_layer(msgspec.structs.replace(layer, tensors=fewer))


@each
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
def test_a_device_that_is_not_there_is_named(make, device, throws, tmp_path):
    with pytest.raises(ConfigurationError, match=device):
        make(device=device)
    make().fit(throws(2, 20), seed=0).save(tmp_path)
    with pytest.raises(ConfigurationError, match=device):
        load_generator(tmp_path, device=device)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
@each
def test_what_was_learned_on_a_gpu_is_loaded_on_either(make, throws, tmp_path):
    demos = throws(3, 40)
    learned = make(device="cuda").fit(demos, seed=0)
    learned.save(tmp_path)
    plans = learned.generate(demos.outcomes_seen)
    on_gpu = load_generator(tmp_path, device="cuda")
    np.testing.assert_array_equal(on_gpu.generate(demos.outcomes_seen), plans)
    on_cpu = load_generator(tmp_path)
    np.testing.assert_allclose(on_cpu.generate(demos.outcomes_seen), plans, atol=1e-2)


@each
def test_a_killed_fit_goes_on_where_it_was(make, throws, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_SAVED_EVERY", 0.0)
    monkeypatch.setattr(training, "_SAVING", np.inf)
    demos, states = throws(3, 20), tmp_path / "states"
    whole = make().fit(demos, seed=0).generate(demos.outcomes_seen)
    steps = []

    def killed(progress):
        steps.append(progress.step)
        if len(steps) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(states=states).fit(demos, seed=0, progress=killed)
    (kept,) = states.iterdir()
    assert "rng" in load_file(kept)
    make(states=states).fit(demos, seed=1)  # another training, which leaves the state alone
    assert list(states.iterdir()) == [kept]
    again = make(states=states).fit(demos, seed=0, progress=lambda p: steps.append(p.step))
    assert steps == [1, 2, 2]
    assert np.array_equal(again.generate(demos.outcomes_seen), whole)
    assert not list(states.iterdir())
