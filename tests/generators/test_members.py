"""Generators by name: what a choice makes, and what is loaded again."""

import subprocess
import sys

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import GENERATORS, load_generator, make_generator
from prior_reinforce.generators.auto import Auto
from prior_reinforce.generators.base import Wrapper
from prior_reinforce.generators.config import DiffusionConfig
from prior_reinforce.generators.corrected import Corrected
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.interpolation import NearestNeighbours
from prior_reinforce.generators.timed import Timed


class Own(NearestNeighbours):
    """One's own."""

    name = "own"


OWN = f"{__name__}:Own"


@pytest.mark.parametrize("name", GENERATORS.members)
def test_a_name_is_that_of_its_class(name):
    kind = GENERATORS.resolve(name)
    assert kind.name == {"diffusion-paper": "diffusion", "diffusion-ways": "diffusion"}.get(
        name, name
    )


@pytest.mark.parametrize(
    ("choice", "timing"),
    [
        ("diffusion", "auto"),
        ("regression", "auto"),
        ("auto", None),
        ("diffusion-ways", "auto"),
        ("diffusion-paper", None),
        ("dmp", None),
        ("nearest", None),
        ("interpolation", "auto"),
        ("diffusion,timing=none", None),
        ("regression,timing=align", "align"),
        ("nearest,timing=start,neighbours=2", "start"),
        (f"{OWN},timing=align,neighbours=2", "align"),
    ],
)
def test_timing_of_a_choice(choice, timing):
    generator = make_generator(choice)
    assert (generator.timing if isinstance(generator, Timed) else None) == timing
    inner = generator
    while isinstance(inner, Wrapper) and not isinstance(inner, Auto):
        inner = inner.generator
    assert GENERATORS.name_of(generator) == GENERATORS.name_of(inner)
    if "neighbours" in choice:
        assert inner.config.neighbours == 2


def test_settings_of_a_choice():
    config = make_generator("diffusion,training_steps=7,sampler=ddpm,timing=none").config
    assert config == DiffusionConfig(training_steps=7, sampler="ddpm")
    assert make_generator("dmp,segmented=false").config.segmented is False
    # What is called diffusion is a network alone: a correction has to be asked for.
    assert isinstance(make_generator("diffusion").generator, DiffusionGenerator)
    assert isinstance(make_generator("diffusion,correction=spline").generator, Corrected)
    paper = make_generator("diffusion-paper").config
    assert paper == DiffusionConfig.paper()
    assert (paper.network.widths, paper.coordinates) == ((256, 512, 1024), "time")
    assert (paper.representation, paper.sampler, paper.prediction) == ("frames", "ddpm", "epsilon")
    assert (paper.learning_rate, paper.warmup_steps, paper.training_steps) == (2e-4, 500, 5000)
    assert make_generator("regression", threads=2, device="cpu").generator._threads == 2


@pytest.mark.parametrize(
    ("choice", "named"),
    [
        ("difusion", "known are auto, diffusion, diffusion-ways"),
        ("nearest,timing=late", "late"),
        ("nearest,correction=perhaps", "correction must be spline or none"),
        ("nearest,speed=3", "speed"),
        ("diffusion,training_steps=-1", "training_steps"),
        ("prior_reinforce.lab.tasks:make_task", "must derive from"),
    ],
)
def test_a_choice_that_cannot_be_made_is_named(choice, named):
    with pytest.raises(ConfigurationError, match=named):
        make_generator(choice)


def test_help_says_every_name_and_how_to_time_it():
    for word in (*GENERATORS.members, "timing=align", "module:Class"):
        assert word in GENERATORS.help


@pytest.mark.parametrize("timing", ["none", "start"])
def test_ones_own_is_loaded_by_its_name_alone(timing, throws, tmp_path):
    demos = throws(3, 60)
    generator = make_generator(f"{OWN},timing={timing}").fit(demos, seed=0)
    generator.save(tmp_path)
    with pytest.raises(FileFormatError, match="module:Class"):
        load_generator(tmp_path)
    with pytest.raises(FileFormatError, match="own generator, not of nearest"):
        load_generator(tmp_path, own="nearest")
    loaded = load_generator(tmp_path, own=OWN)
    np.testing.assert_array_equal(
        loaded.generate(demos.outcomes_seen), generator.generate(demos.outcomes_seen)
    )


def test_another_device_is_refused_by_what_is_no_network(throws, tmp_path):
    NearestNeighbours().fit(throws(3, 20), seed=0).save(tmp_path)
    with pytest.raises(ConfigurationError, match="CPU only"):
        load_generator(tmp_path, device="cuda")


def test_names_are_read_without_torch_or_scipy():
    code = (
        "import sys, prior_reinforce.generators; "
        "print([m for m in ('torch', 'scipy', 'safetensors') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("choice", ["nearest", "interpolation,timing=start", "dmp"])
def test_what_computes_on_the_cpu_refuses_another_device(choice):
    with pytest.raises(ConfigurationError, match="computes on the CPU"):
        make_generator(choice, device="cuda")
