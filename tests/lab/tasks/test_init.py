import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.lab.tasks import make_task


def test_a_choice_sets_the_hardware():
    assert make_task("basketball-v1,hardware=v3").name == "basketball-v3"


@pytest.mark.parametrize("name", ["darts", "basketball"])
def test_an_unknown_task_is_named(name):
    with pytest.raises(ConfigurationError, match=f"no task '{name}'; known are basketball-v1, "):
        make_task(name)
