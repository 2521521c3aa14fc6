"""Every perception of the registry keeps the contract."""

from functools import cache, partial

import numpy as np
import pytest

from prior_reinforce.environment import KeyFrame, Rollout, SeenObject, TableScene
from prior_reinforce.errors import PerceptionFailedError
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.perception.exact import Exact
from prior_reinforce.testing import PerceptionContract
from tests.perception.slanted_table import RIM_HEIGHT, slanted_table
from tests.testing.members import members

PICTURES = ("camera", "vlm")
"""They need a table to look at; `perception/test_vlm.py` asks a model."""
SELF_CONTAINED = [name for name in members(PERCEPTIONS) if name not in PICTURES]


_table = cache(slanted_table)


class TestPerceptions(PerceptionContract):
    @pytest.fixture(autouse=True, params=SELF_CONTAINED)
    def choose(self, request):
        self.make = partial(make_perception, request.param)


class TestCamera(PerceptionContract):
    dims = (2,)
    scene = TableScene(
        SeenObject("the orange ball", 0.06), SeenObject("the red hoop", 0.10), RIM_HEIGHT
    )

    def make(self):
        return make_perception("camera", scene=self.scene)

    def rollout(self, outcome, *, valid=True):
        state = np.array([*outcome, RIM_HEIGHT, 1.0, 0.0, 0.0, 0.0])
        return Rollout(outcome, valid, KeyFrame(_table(), state, time=1.0))


class Failing(Exact):
    """Gives up at so many of eight seeds."""

    def __init__(self, often):
        self.often = often

    def perceive(self, rollout, goal, rng):
        if rng.random() < self.often:
            raise PerceptionFailedError("not seen; look yourself")
        return super().perceive(rollout, goal, rng)


class TestNowAndThen(PerceptionContract):
    make = staticmethod(partial(Failing, 0.25))


def test_one_that_mostly_gives_up_does_not_pass():
    contract = PerceptionContract()
    contract.make = partial(Failing, 0.9)
    with pytest.raises(AssertionError):
        contract.test_a_large_error_is_seen_on_its_own_side()
