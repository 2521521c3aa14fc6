"""The FR3's executor: its settings here, its motions on the simulated arm."""

import pytest

from prior_reinforce.bench.robots.executors.fr3 import FR3, FR3Config
from prior_reinforce.errors import ConfigurationError


@pytest.mark.parametrize(
    "options", [{"host": 5}, {"host": "a", "contact": (20.0, 0.0)}, {"host": "a", "firmware": "4"}]
)
def test_settings_are_checked(options):
    with pytest.raises(ConfigurationError):
        FR3Config(**options)


def test_a_robot_that_does_not_answer_is_named_with_the_remedy():
    with pytest.raises(ConfigurationError, match=r"cannot reach the robot at 127\.0\.99\.9.*FCI"):
        FR3(FR3Config("127.0.99.9"))
