"""Files that events name: what was damaged on the disk is never handed out."""

import shutil

import pytest

from prior_reinforce.errors import FileFormatError
from tests.workspace.planar import ask, tell, void


def test_a_damaged_plan_or_model_is_never_handed_out(workspace):
    trial = ask(workspace)
    path = workspace.plan_path(trial)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.chmod(0o644)
    path.write_bytes(content)
    with pytest.raises(FileFormatError):
        ask(workspace)
    void(workspace, 1, "damaged")
    weights = next((workspace.folder / "models").glob("*/model.safetensors"))
    weights.write_bytes(weights.read_bytes()[:-1] + b"x")
    with pytest.raises(FileFormatError, match="not the one that was learned"):
        ask(workspace)


def test_a_reading_can_be_told_where_the_model_is_gone(workspace):
    number = ask(workspace).number
    shutil.rmtree(workspace.folder / "models")
    assert tell(workspace, number, [0.0, 0.0]).hit
    with pytest.raises(FileFormatError, match="prior-reinforce learn"):
        ask(workspace)


def test_learning_again_mends_a_damaged_model(workspace):
    (model,) = (workspace.folder / "models").iterdir()
    weights = model / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"x")
    assert workspace.learn("interpolation").model == model.name
    assert ask(workspace).number == 1
    assert [path.name for path in (workspace.folder / "models").iterdir()] == [model.name]
