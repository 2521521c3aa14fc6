"""A small workspace that learns in a second."""

import pytest
from planar import SMALL, demonstrations, manifest

from prior_reinforce.generators import DiffusionGenerator
from prior_reinforce.workspace.learning import learn
from prior_reinforce.workspace.workspace import Workspace


@pytest.fixture(scope="session")
def learned_folder(tmp_path_factory):
    """A workspace with a model and no goal; copy it, never change it."""
    folder = tmp_path_factory.mktemp("learned") / "planar"
    workspace = Workspace.create(folder, manifest())
    workspace.import_demonstrations(demonstrations(), "made up")
    learn(workspace, DiffusionGenerator(SMALL), seed=0)
    workspace.close()
    return folder
