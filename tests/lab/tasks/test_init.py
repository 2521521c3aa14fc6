import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.lab.tasks import TASKS, make_task


def test_a_choice_sets_the_hardware():
    for name in ("basketball-v1", "basketball-v2", "basketball-v3"):
        task = make_task(name)
        assert task.name == name
        assert TASKS.name_of(task) == name


@pytest.mark.parametrize("name", ["darts", "basketball"])
def test_an_unknown_task_is_named(name):
    with pytest.raises(ConfigurationError, match=f"no task '{name}'; known are basketball-v1, "):
        make_task(name)
