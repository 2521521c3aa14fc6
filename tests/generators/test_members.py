"""Generators by name: what a choice makes, and what is loaded again."""

import subprocess
import sys

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import GENERATORS, load_generator, make_generator
from prior_reinforce.generators.auto import Auto
from prior_reinforce.generators.base import Wrapper
from prior_reinforce.generators.equivariant import Equivariant
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.network.config import DiffusionConfig
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.timing.timed import Timed
from prior_reinforce.registry import Member


class Own(SmoothInterpolation):
    """One's own."""

    name = "own"


@pytest.fixture(autouse=True)
def own(monkeypatch):
    """One's own generator under its name."""
    monkeypatch.setitem(GENERATORS.members, "own", Member(Own, "one's own"))


@pytest.mark.parametrize("name", GENERATORS.members)
def test_a_name_is_that_of_its_class(name):
    kind = GENERATORS.resolve(name)
    assert kind.name == ("diffusion" if name == "diffusion-paper" else name)


def without_symmetry(generator):
    """What is wrapped by the symmetry's layer, where there is one."""
    return generator.generator if isinstance(generator, Equivariant) else generator


@pytest.mark.parametrize("choice", [*GENERATORS.members, "interpolation,symmetry=use"])
def test_a_symmetry_is_used_by_our_own_generators_and_where_asked_for(choice):
    used = choice in ("auto", "diffusion") or "use" in choice
    assert isinstance(make_generator(choice), Equivariant) == used
    assert not isinstance(make_generator(f"{choice.split(',')[0]},symmetry=none"), Equivariant)


@pytest.mark.parametrize(
    ("choice", "timing"),
    [
        ("diffusion", "auto"),
        ("auto", None),
        ("diffusion-paper", None),
        ("interpolation", "auto"),
        ("diffusion,timing=none", None),
        ("interpolation,timing=align", "align"),
        ("interpolation,timing=start,kernel=linear", "start"),
        ("own,timing=align,kernel=linear", "align"),
        ("own", None),
    ],
)
def test_timing_of_a_choice(choice, timing):
    generator = without_symmetry(make_generator(choice))
    assert (generator.timing if isinstance(generator, Timed) else None) == timing
    inner = generator
    while isinstance(inner, Wrapper) and not isinstance(inner, Auto):
        inner = inner.generator
    assert GENERATORS.name_of(generator) == GENERATORS.name_of(inner)
    if "kernel" in choice:
        assert inner.config.kernel == "linear"


def test_settings_of_a_choice():
    config = make_generator("diffusion,training_steps=7,sampler=ddpm,timing=none").generator.config
    assert config == DiffusionConfig(training_steps=7, sampler="ddpm")
    assert isinstance(make_generator("diffusion,timing=none").generator, DiffusionGenerator)
    paper = make_generator("diffusion-paper").config
    assert paper == DiffusionConfig.paper()
    assert (paper.network.widths, paper.coordinates) == ((256, 512, 1024), "time")
    assert (paper.representation, paper.sampler, paper.prediction) == ("frames", "ddpm", "epsilon")
    assert (paper.learning_rate, paper.warmup_steps, paper.training_steps) == (2e-4, 500, 5000)
    assert make_generator("diffusion", threads=2, device="cpu").generator.generator._threads == 2


@pytest.mark.parametrize(
    ("choice", "named"),
    [
        ("difusion", "known are auto, diffusion, diffusion-paper"),
        ("interpolation,timing=late", "late"),
        ("auto,symmetry=yes", "symmetry must be use or none"),
        ("interpolation,speed=3", "speed"),
        ("diffusion,training_steps=-1", "training_steps"),
        ("auto,timing=align", "auto chooses its timing itself"),
    ],
)
def test_a_choice_that_cannot_be_made_is_named(choice, named):
    with pytest.raises(ConfigurationError, match=named):
        make_generator(choice)


def test_help_says_every_name_and_how_to_time_it():
    for word in (*GENERATORS.members, "timing=align"):
        assert word in GENERATORS.help


@pytest.mark.parametrize("timing", ["none", "start"])
def test_ones_own_is_loaded_where_it_is_registered(timing, throws, tmp_path, monkeypatch):
    demos = throws(3, 60)
    generator = make_generator(f"own,timing={timing}").fit(demos, seed=0)
    generator.save(tmp_path)
    loaded = load_generator(tmp_path)
    np.testing.assert_array_equal(
        loaded.generate(demos.outcomes_seen), generator.generate(demos.outcomes_seen)
    )
    monkeypatch.setitem(GENERATORS.members, "own", GENERATORS.members["interpolation"])
    with pytest.raises(FileFormatError, match="of a own generator, not of interpolation"):
        load_generator(tmp_path)
    monkeypatch.delitem(GENERATORS.members, "own")
    with pytest.raises(FileFormatError, match=r"no generator 'own'.*--plugins"):
        load_generator(tmp_path)


def test_another_device_is_refused_by_what_is_no_network(throws, tmp_path):
    SmoothInterpolation().fit(throws(3, 20), seed=0).save(tmp_path)
    with pytest.raises(ConfigurationError, match="CPU only"):
        load_generator(tmp_path, device="cuda")


@pytest.mark.slow
def test_names_are_read_without_torch_or_scipy():
    code = (
        "import sys, prior_reinforce.generators; "
        "print([m for m in ('torch', 'scipy', 'safetensors') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("choice", ["interpolation", "interpolation,timing=start"])
def test_what_computes_on_the_cpu_refuses_another_device(choice):
    with pytest.raises(ConfigurationError, match="computes on the CPU"):
        make_generator(choice, device="cuda")
