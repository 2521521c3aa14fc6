"""Every generator of the registry keeps the contract, with its motion's start learned or not."""

from functools import partial

import pytest

from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.testing import GeneratorContract, tiny_networks
from tests.testing.members import members

VARIANTS = ("diffusion,timing=none", "interpolation,timing=start")


class TestGenerators(GeneratorContract):
    @pytest.fixture(autouse=True, params=[*members(GENERATORS), *VARIANTS])
    def choose(self, request):
        self.make = partial(make_generator, request.param)
        with tiny_networks():
            yield


class Silent(SmoothInterpolation):
    """Says nothing while it learns."""

    def _fit(self, demonstrations, seed, progress):
        super()._fit(demonstrations, seed, lambda _: None)


def test_what_is_wrong_is_said_in_a_sentence():
    suite = GeneratorContract()
    suite.make = Silent
    with pytest.raises(AssertionError, match=r"_fit calls progress\(FitProgress\(...\)\)"):
        suite.test_progress_ends_with_all_steps_done()
