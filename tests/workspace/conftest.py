"""A small workspace, learned from in an instant."""

import shutil

import pytest
from planar import demonstrations, manifest

from prior_reinforce.workspace.workspace import Workspace


@pytest.fixture(scope="session")
def learned_folder(tmp_path_factory):
    """A workspace with a model and no goal; copy it, never change it."""
    folder = tmp_path_factory.mktemp("learned") / "planar"
    with Workspace.create(folder, manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        workspace.learn("interpolation")
    return folder


@pytest.fixture
def workspace(learned_folder, tmp_path):
    """A copy of it, with a goal."""
    shutil.copytree(learned_folder, tmp_path / "planar")
    with Workspace(tmp_path / "planar") as workspace:
        workspace.set_goal([0.9, 0.05])
        yield workspace
