"""The optimiser loop: its learning rate, its averaged weights and what it reports."""

import itertools
from dataclasses import replace
from math import nan

import numpy as np
import pytest
import safetensors.torch
import torch

from prior_reinforce.errors import FileFormatError
from prior_reinforce.generators.network import training
from prior_reinforce.generators.network.config import UNetConfig
from prior_reinforce.generators.network.training import build, learning_rate_factor, optimise

CONFIG = UNetConfig(training_steps=3, learning_rate=0.1, warmup_steps=1, weight_decay=0.0)


def test_learning_rate_rises_then_falls_as_a_cosine():
    config = replace(CONFIG, warmup_steps=10, training_steps=110)
    factors = [learning_rate_factor(step, config) for step in range(110)]
    assert factors[0] == 0
    assert factors[5] == pytest.approx(0.5)
    assert factors[10] == 1
    assert factors[60] == pytest.approx(0.5)
    assert all(a > b for a, b in itertools.pairwise(factors[10:]))


def linear(seed: int = 0) -> torch.nn.Linear:
    return build(lambda: torch.nn.Linear(1, 1, bias=False), seed)


@pytest.mark.slow
def test_averaged_weights_are_those_worked_by_hand():
    """w of each step, then 0.5 of the average and 0.5 of the new one, from the second step on."""
    seen = []
    network = linear()

    def loss():
        seen.append(network.weight.item())
        return ((network.weight - 3) ** 2).sum()

    averaged = optimise(network, loss, CONFIG, seen.append, decay=lambda n: 0.5)
    weights = [*[w for w in seen if isinstance(w, float)][1:], network.weight.item()]
    expected = weights[0]
    for weight in weights[1:]:
        expected = 0.5 * expected + 0.5 * weight
    assert averaged.weight.item() == pytest.approx(expected, abs=1e-6)
    assert averaged.weight.item() != network.weight.item()
    assert not averaged.training


def test_the_first_step_of_a_warm_up_moves_nothing():
    network = linear()
    before = network.weight.item()
    config = replace(CONFIG, training_steps=1)
    optimise(network, lambda: (network.weight**2).sum(), config, lambda progress: None)
    assert network.weight.item() == before


@pytest.mark.slow
def test_a_minimum_is_found_and_the_mean_loss_falls():
    heard = []
    network = linear()
    config = replace(CONFIG, training_steps=400)
    fitted = optimise(network, lambda: ((network.weight - 3) ** 2).sum(), config, heard.append)
    assert fitted.weight.item() == pytest.approx(3, abs=1e-3)
    assert heard[-1].loss < 0.1 * heard[0].loss
    assert len(heard) == 200
    assert (heard[-1].step, heard[-1].n_steps) == (400, 400)


def interrupted(path, config, at):
    """Fit a line to random points until the `at`-th step; None: to the end."""
    network, rng, asked = linear(), torch.Generator().manual_seed(5), itertools.count(1)

    def loss():
        if next(asked) == at:
            raise KeyboardInterrupt
        x = torch.randn((4, 1), generator=rng)
        return ((network(x) - 3 * x) ** 2).mean()

    heard = []
    how = {"decay": lambda n: 1 - (1 + n) ** -0.75, "rng": rng, "state": path}
    fitted = optimise(network, loss, config, heard.append, **how)
    return fitted.weight.item(), heard[-1]


@pytest.mark.slow
def test_an_interrupted_training_goes_on_to_the_same_last_digit(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_SAVED_EVERY", 0.0)
    monkeypatch.setattr(training, "_SAVING", np.inf)
    config = replace(CONFIG, training_steps=20)
    whole, _ = interrupted(None, config, None)
    for at in (8, 3, 6):
        with pytest.raises(KeyboardInterrupt):
            interrupted(tmp_path / "state", config, at)
    weight, last = interrupted(tmp_path / "state", config, None)
    assert weight == whole
    assert last.step == 20


@pytest.mark.slow
def test_a_state_that_takes_long_to_save_is_saved_seldom(tmp_path, monkeypatch):
    clock, saves = [0.0], []

    def save(*_):
        saves.append(clock[0])
        clock[0] += 20.0

    def now():
        clock[0] += 1.0
        return clock[0]

    monkeypatch.setattr(training.time, "monotonic", now)
    monkeypatch.setattr(training._Run, "save", save)
    interrupted(tmp_path / "state", replace(CONFIG, training_steps=900), None)
    assert saves[0] == pytest.approx(60, abs=5)
    assert saves[1] - saves[0] == pytest.approx(20 / 0.02, rel=0.1)


def test_the_state_of_another_training_is_refused_by_its_path(tmp_path):
    path = tmp_path / "state"
    told = [safetensors.torch.save({"progress": torch.tensor([n, 0.0])}) for n in (1.0, 3.0, nan)]
    for content in (b"", b"x" * 64, *told):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=str(path)):
            interrupted(path, CONFIG, None)


def test_a_network_is_drawn_from_its_seed_and_the_global_generator_stays():
    state = torch.get_rng_state()
    assert torch.equal(linear(3).weight, linear(3).weight)
    assert not torch.equal(linear(3).weight, linear(4).weight)
    assert torch.equal(torch.get_rng_state(), state)
