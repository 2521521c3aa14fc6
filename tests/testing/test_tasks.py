"""Every task of the registry keeps the contract."""

import pytest

from prior_reinforce.lab.tasks import TASKS, make_task
from prior_reinforce.testing import TaskContract


class TestTasks(TaskContract):
    @pytest.fixture(scope="class", params=TASKS.members)
    @classmethod
    def task(cls, request):
        return make_task(request.param)

    def test_a_task_knows_its_name(self, task, request):
        assert task.name == request.node.callspec.params["task"]
