"""Every adapter of the registry keeps the contract."""

from functools import partial

import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.testing import AdapterContract


class TestAdapters(AdapterContract):
    @pytest.fixture(autouse=True, params=ADAPTERS.members)
    def choose(self, request):
        self.make = partial(make_adapter, request.param)
