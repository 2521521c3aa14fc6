"""Contract suites for members of your own, and what their tests need. Needs pytest.

Inherit a suite in a test file of yours, and pytest runs all of its tests on your class:

    class TestRidge(AdapterContract):
        make = staticmethod(RidgeAdapter)

Our own members pass the same suites.
"""

import pytest

# The suites' asserts say what they compared, as those of a test file do.
pytest.register_assert_rewrite(
    *(
        f"{__name__}.{suite}"
        for suite in ("adapters", "executors", "generators", "perception", "tasks")
    )
)

from prior_reinforce.testing.adapters import AdapterContract  # noqa: E402
from prior_reinforce.testing.executors import ExecutorContract  # noqa: E402
from prior_reinforce.testing.generators import GeneratorContract  # noqa: E402
from prior_reinforce.testing.perception import PerceptionContract  # noqa: E402
from prior_reinforce.testing.synthetic import synthetic_demonstrations  # noqa: E402
from prior_reinforce.testing.tasks import TaskContract  # noqa: E402
from prior_reinforce.testing.tiny import TINY, tiny_networks  # noqa: E402

__all__ = [
    "TINY",
    "AdapterContract",
    "ExecutorContract",
    "GeneratorContract",
    "PerceptionContract",
    "TaskContract",
    "synthetic_demonstrations",
    "tiny_networks",
]
