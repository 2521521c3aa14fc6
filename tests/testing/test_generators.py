"""Every generator of the registry keeps the contract, with its motion's start learned or not."""

from functools import partial

import pytest

from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.testing import GeneratorContract, tiny_networks

VARIANTS = ("diffusion,timing=none", "dmp,segmented=false", "interpolation,timing=start")


class TestGenerators(GeneratorContract):
    @pytest.fixture(autouse=True, params=[*GENERATORS.members, *VARIANTS])
    def choose(self, request):
        self.make = partial(make_generator, request.param)
        with tiny_networks():
            yield
