"""Files that events name: what was damaged on the disk is never handed out."""

import shutil
from dataclasses import replace

import pytest

from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.plans.motions import Demonstrations, Plan
from tests.arm.workspace.planar import (
    FORMAT,
    ask,
    demonstrations,
    manifest,
    reopened,
    tell,
    void,
)


def test_a_damaged_plan_or_model_is_never_handed_out(workspace):
    trial = ask(workspace)
    path = workspace.plan_file(trial).path
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


@pytest.mark.slow
def test_learning_again_mends_a_damaged_model(workspace):
    (model,) = (workspace.folder / "models").iterdir()
    weights = model / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"x")
    assert workspace.learn("interpolation").model == model.name
    assert ask(workspace).number == 1
    assert [path.name for path in (workspace.folder / "models").iterdir()] == [model.name]


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["a folder in it", "a file instead"])
def test_learning_again_mends_whatever_stands_in_the_models_place(workspace, damage):
    (model,) = (workspace.folder / "models").iterdir()
    if damage == "a folder in it":
        (model / "notes").mkdir()
    else:
        shutil.rmtree(model)
        model.write_text("not a folder")
    with pytest.raises(FileFormatError, match="prior-reinforce learn"):
        ask(workspace)
    workspace.learn("interpolation")
    assert ask(workspace).number == 1


@pytest.mark.slow
def test_importing_again_mends_damaged_demonstrations(workspace):
    """Though trials were made with them."""
    tell(workspace, ask(workspace).number, [0.05, 0.0])
    (path,) = (workspace.folder / "demonstrations").iterdir()
    path.write_bytes(path.read_bytes()[:-100])
    again = reopened(workspace)
    with pytest.raises(FileFormatError):
        ask(again)
    again.import_demonstrations(demonstrations(), "made up")
    assert ask(again).number == 2
    again.close()


@pytest.mark.slow
def test_what_a_crash_left_blocks_nothing(workspace):
    """A plan's file that no event names, with the same motion at another tempo, or half of it."""
    number = ask(workspace).number
    first = workspace.state.trial(1)
    void(workspace, number, "")
    frames = workspace.plan(first).actions
    left = workspace.plan_file(first).path.name.replace("trial-001", "trial-002")
    write_plan(Plan(frames, replace(FORMAT, dt=0.04)), workspace.folder / "plans" / left)
    trial = ask(workspace)
    assert workspace.plan_file(trial).path.name == left
    assert workspace.plan(trial).format.dt == 0.02


def test_a_plan_that_an_event_names_is_never_replaced(workspace):
    trial = ask(workspace)
    path = workspace.plan_file(trial).path
    other = Plan(workspace.plan(trial).actions, replace(FORMAT, dt=0.04))
    with pytest.raises(FileFormatError, match="never overwritten"):
        workspace.store.save_plan(other, 1, {path.name})


@pytest.mark.slow
@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize("part", ["demonstrations", "models", "plans"])
def test_a_journal_that_is_gone_is_no_new_workspace(workspace, empty, part):
    ask(workspace)
    workspace.close()
    journal = workspace.folder / "journal.sqlite"
    journal.unlink()
    if empty:
        journal.touch()
    for other in {"demonstrations", "models", "plans"} - {part}:
        shutil.rmtree(workspace.folder / other)
    with pytest.raises(WorkspaceError, match=r"missing or empty.*restore the journal"):
        Workspace(workspace.folder)
    assert journal.exists() == empty


def test_a_journal_without_events_beside_models_is_no_new_workspace(workspace, tmp_path):
    workspace.close()
    Workspace.create(tmp_path / "new", manifest()).close()
    shutil.copy(tmp_path / "new" / "journal.sqlite", workspace.folder / "journal.sqlite")
    with pytest.raises(WorkspaceError, match=r"missing or empty.*restore the journal"):
        Workspace(workspace.folder)


def test_an_import_that_was_killed_before_its_event_can_be_repeated(tmp_path):
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.store.save_demonstrations(demonstrations())
    with Workspace(tmp_path / "planar") as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")


@pytest.mark.slow
def test_the_same_motions_at_another_tempo_need_another_model(tmp_path):
    """They have a file of their own, and the model of the first is not current."""
    demos = demonstrations()
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.import_demonstrations(demos, "made up")
        workspace.learn("interpolation")
    path = tmp_path / "planar" / "workspace.toml"
    path.write_text(path.read_text().replace("dt = 0.02", "dt = 0.016"))
    quick = Demonstrations(demos.plans, demos.outcomes_seen, replace(FORMAT, dt=0.016))
    with Workspace(tmp_path / "planar") as workspace:
        workspace.import_demonstrations(quick, "a copy")
        assert len(list((workspace.folder / "demonstrations").iterdir())) == 2
        workspace.set_goal([0.9, 0.05])
        with pytest.raises(WorkspaceError, match="prior-reinforce learn"):
            ask(workspace)
