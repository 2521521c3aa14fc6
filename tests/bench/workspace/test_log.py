"""What a workspace's journal says beside its trials: demonstrations and trainings."""

import pytest

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.plans.motions import Demonstrations
from tests.bench.workspace.planar import ask, demonstrations


def test_demonstrations_that_changed_ask_for_learning_anew(workspace):
    other = demonstrations()
    changed = Demonstrations(other.plans * 1.01, other.outcomes_seen, other.format)
    workspace.import_demonstrations(changed, "again")
    with pytest.raises(WorkspaceError, match="other demonstrations"):
        ask(workspace)
