"""What registers itself with the package keeps the package's contracts."""

from functools import partial

import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import GENERATORS, Timed, make_generator
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.testing import (
    TINY,
    AdapterContract,
    GeneratorContract,
    TaskContract,
    tiny_networks,
)
from reproduction.zoo import MEMBERS

OURS = {
    "diffusion-ways": {**TINY["diffusion"], "mixtures": 2},
    "regression": {"network": TINY["diffusion-paper"]["network"], "training_steps": 8},
}
CHOICES = ("diffusion-ways", "regression", "dmp", "dmp,segmented=false", "nearest")


class TestGenerators(GeneratorContract):
    @pytest.fixture(autouse=True, params=CHOICES)
    def choose(self, request):
        self.make = partial(make_generator, request.param)
        with tiny_networks(OURS):
            yield


class TestAdapters(AdapterContract):
    @pytest.fixture(autouse=True, params=["offset", "broyden"])
    def choose(self, request):
        self.make = partial(make_adapter, request.param)


class TestTasks(TaskContract):
    @pytest.fixture(scope="class", params=MEMBERS)
    @classmethod
    def task(cls, request):
        return make_task(request.param)

    @pytest.fixture(scope="class")
    @classmethod
    def plans(cls, task):
        kind = task.demonstration_sets[0].partition("-")[0]
        return task.demonstrations(f"{kind}-3-0").plans


@pytest.mark.parametrize("name", ["diffusion-ways", "regression", "dmp", "nearest"])
def test_a_generator_is_chosen_by_the_name_of_its_class(name):
    generator = make_generator(name)
    assert GENERATORS.resolve(name).name == GENERATORS.name_of(generator) == name
    assert isinstance(generator, Timed) == (name in OURS)  # networks are timed by default


def test_settings_of_a_choice():
    assert make_generator("dmp,segmented=false").config.segmented is False
    assert make_generator("regression", threads=2).generator._threads == 2
    assert make_generator("nearest,timing=start,neighbours=2").generator.config.neighbours == 2
    assert ADAPTERS.name_of(make_adapter("broyden,gain=0.5")) == "broyden"


def test_what_computes_on_the_cpu_refuses_another_device():
    with pytest.raises(ConfigurationError, match="computes on the CPU"):
        make_generator("dmp", device="cuda")
