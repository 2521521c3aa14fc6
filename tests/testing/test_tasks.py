"""Every task of the registry keeps the contract."""

import pytest

from prior_reinforce.simulation.tasks import TASKS, make_task
from prior_reinforce.testing import TaskContract
from tests.testing.members import members


class TestTasks(TaskContract):
    @pytest.fixture(scope="class", params=members(TASKS))
    @classmethod
    def task(cls, request):
        return make_task(request.param)

    def test_a_task_knows_its_name(self, task, request):
        assert task.name == request.node.callspec.params["task"]
