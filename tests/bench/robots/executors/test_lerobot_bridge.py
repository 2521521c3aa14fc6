"""LeRobot's side of the bridge, with LeRobot: what it refuses before anything moves."""

import pytest

from prior_reinforce.errors import ConfigurationError
from tests.bench.robots.executors.test_lerobot import serve, so101  # noqa: F401

pytestmark = pytest.mark.slow


def test_a_port_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match="Could not connect on port"):
        so101(tmp_path)


def test_an_arm_that_is_calibrated_otherwise_than_its_file_says_is_refused(serve, tmp_path):  # noqa: F811
    arm = serve()
    arm.servos[2].write_word(9, 700)
    with pytest.raises(ConfigurationError, match="is not calibrated, or not as its file says"):
        so101(tmp_path)
