"""Every perception of the registry keeps the contract."""

from functools import partial

import pytest

from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.testing import PerceptionContract

PICTURES = ("camera", "vlm")
"""What reads pictures needs a table to look at, and a model to ask."""


class TestPerceptions(PerceptionContract):
    @pytest.fixture(autouse=True, params=[n for n in PERCEPTIONS.members if n not in PICTURES])
    def choose(self, request):
        self.make = partial(make_perception, request.param)
