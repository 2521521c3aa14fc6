import numpy as np
import pytest

from prior_reinforce.arm.console import imports as module
from prior_reinforce.arm.console.imports import Columns, Imports, Place, Take
from prior_reinforce.arm.console.verbs import SetGoal, Verbs
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    TrialStateError,
    UnclearUnitsError,
)
from tests.arm.workspace.planar import demonstrations, manifest, recordings


@pytest.fixture
def dropped(tmp_path):
    """A fresh workspace on which four recordings without outcomes were dropped."""
    Workspace.create(tmp_path / "w", manifest()).close()
    recordings(tmp_path / "recorded", outcomes=())
    verbs = Verbs(tmp_path / "w")
    imports = Imports(verbs)
    for path in sorted((tmp_path / "recorded").iterdir()):
        imports.drop(path.name, path.read_bytes())
    imports.verbs = verbs
    yield imports
    verbs.close()


def touch_all(imports):
    for i, place in enumerate(demonstrations().outcomes_seen.tolist()):
        found = imports.place(Place(episode=f"throw_{i}", outcome=place, sd=0.003))
    return found


def test_recordings_are_looked_through_touched_and_taken_in(dropped):
    found = dropped.look()
    assert (found.files, found.problem, found.questions) == (4, "", [])
    assert found.episodes == {f"throw_{i}": None for i in range(4)}
    assert "joint1" in found.text
    found = touch_all(dropped)
    assert [*found.episodes.values()] == demonstrations().outcomes_seen.tolist()
    state = dropped.take(Take(seen=dropped.verbs.state().id))
    assert state.step == "learn"
    taken = dropped.verbs.workspace.demonstrations
    np.testing.assert_allclose(taken.outcomes_seen, demonstrations().outcomes_seen)
    np.testing.assert_allclose(taken.outcome_noise, 0.003)
    assert (dropped.verbs.folder / "demonstrations.png").is_file()


def test_a_touch_is_on_disk_before_it_is_answered_and_can_be_corrected(dropped):
    dropped.place(Place(episode="throw_1", outcome=[0.7, 0.1]))
    again = Imports(dropped.verbs).look()
    assert [*again.episodes.values()] == [None, [0.7, 0.1], None, None]
    corrected = dropped.place(Place(episode="throw_1", outcome=[0.8, 0.2]))
    assert corrected.episodes["throw_1"] == [0.8, 0.2]
    forgotten = dropped.place(Place(episode="throw_1", outcome=None))
    assert forgotten.episodes["throw_1"] is None


def test_a_picture_that_fails_takes_nothing_back(dropped):
    touch_all(dropped)
    (dropped.verbs.folder / "demonstrations.png").mkdir()
    heard = []
    dropped.verbs.publish = heard.append
    assert dropped.take(Take(seen=0)).step == "learn"
    assert any("there is no picture" in message.get("error", "") for message in heard)
    assert dropped.verbs.workspace.demonstrations.n == 4


def test_recordings_without_an_outcome_are_left_out(dropped):
    for i in (0, 3):
        place = demonstrations().outcomes_seen[i].tolist()
        dropped.place(Place(episode=f"throw_{i}", outcome=place))
    dropped.take(Take(seen=0))
    assert dropped.verbs.workspace.demonstrations.n == 2


def test_a_table_that_was_dropped_beside_them_serves(tmp_path):
    Workspace.create(tmp_path / "w", manifest()).close()
    recordings(tmp_path / "recorded")
    verbs = Verbs(tmp_path / "w")
    imports = Imports(verbs)
    for path in (tmp_path / "recorded").iterdir():
        imports.drop(f"recorded/{path.name}", path.read_bytes())
    assert [*imports.look().episodes.values()] == demonstrations().outcomes_seen.tolist()
    assert imports.take(Take(seen=0)).step == "learn"
    verbs.close()


def test_a_workspace_without_columns_takes_those_that_were_recorded(tmp_path):
    recordings(tmp_path / "recorded")
    verbs = Verbs(Workspace.create(tmp_path / "w", robot="none").folder)
    imports = Imports(verbs)
    for path in (tmp_path / "recorded").iterdir():
        imports.drop(path.name, path.read_bytes())
    assert imports.take(Take(seen=0)).step == "learn"
    assert verbs.workspace.manifest.format.names == ("joint1", "joint2")
    verbs.close()


def test_guesses_are_for_a_person_to_confirm(tmp_path):
    Workspace.create(tmp_path / "w", manifest()).close()
    recordings(tmp_path / "recorded")
    table = (tmp_path / "recorded" / "outcomes.csv").read_text().splitlines()
    cells = [line.split(",") for line in table[1:]]
    scaled = [f"{i},{100 * float(x):g},{100 * float(y):g}" for i, x, y in cells]
    (tmp_path / "recorded" / "outcomes.csv").write_text("\n".join([table[0], *scaled]))
    verbs = Verbs(tmp_path / "w")
    imports = Imports(verbs)
    for path in (tmp_path / "recorded").iterdir():
        imports.drop(path.name, path.read_bytes())
    (question,) = imports.look().questions
    assert "looks like cm" in question
    with pytest.raises(UnclearUnitsError, match="looks like cm"):
        imports.take(Take(seen=0))
    imports.take(Take(seen=0, confirmed=True))
    np.testing.assert_allclose(
        verbs.workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen
    )
    verbs.close()


@pytest.mark.parametrize(
    "name",
    [
        *("../journal.sqlite", "/etc/passwd", "a/../../b", ".hidden", "a//b", "", "a\\b", "a/.b"),
        *("a\x00b", "a/" * 7 + "b", "x" * 101, "nul\n"),
    ],
)
def test_no_name_leads_out_of_the_folder(dropped, name):
    with pytest.raises(FileFormatError, match="no name"):
        dropped.drop(name, b"x")
    assert dropped.look().files == 4


def test_a_link_is_not_followed(dropped, tmp_path):
    (tmp_path / "outside").mkdir()
    (dropped.verbs.folder / "recordings" / "sub").symlink_to(tmp_path / "outside")
    with pytest.raises(FileFormatError, match="link"):
        dropped.drop("sub/x.npz", b"x")
    assert not any((tmp_path / "outside").iterdir())


def test_more_than_the_disk_should_take_is_refused(dropped, monkeypatch):
    monkeypatch.setattr(module, "_LARGEST_ALL", 1000)
    with pytest.raises(FileFormatError, match="more than the page takes"):
        dropped.drop("large.npz", b"x" * 1001)


def test_what_cannot_be_read_is_said_and_can_be_forgotten(dropped):
    dropped.drop("throw_9.npz", b"no archive")
    assert "throw_9.npz" in dropped.look().problem
    assert dropped.discard().files == 0
    with pytest.raises(InvalidDemonstrationsError, match="drop some"):
        dropped.take(Take(seen=0))


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ({"episode": "throw_7", "outcome": [0.8, 0.0]}, InvalidDemonstrationsError),
        ({"episode": "throw_1", "outcome": [0.8]}, InvalidFeedbackError),
    ],
)
def test_a_place_is_of_a_recording_and_has_all_components(dropped, body, error):
    with pytest.raises(error):
        dropped.place(Place(**body))


def test_nothing_is_taken_in_while_a_trial_waits_or_by_a_stale_tab(dropped):
    touch_all(dropped)
    dropped.take(Take(seen=0))
    with pytest.raises(TrialStateError, match="demonstrations imported"):
        dropped.take(Take(seen=0))
    verbs = dropped.verbs
    verbs.workspace.learn("interpolation")
    verbs.goal(SetGoal(seen=verbs.state().id, goal=[0.9, 0.0]))
    verbs.workspace.session().ask()
    with pytest.raises(TrialStateError, match="waits to be told"):
        dropped.take(Take(seen=verbs.state().id))


def test_a_folder_that_is_a_link_out_is_not_walked(dropped, tmp_path, monkeypatch):
    dropped.discard()
    (tmp_path / "large").mkdir()
    (tmp_path / "large" / "x.npz").touch()
    (dropped.verbs.folder / "recordings").symlink_to(tmp_path / "large")
    monkeypatch.setattr(module.os, "walk", None)
    for call in (dropped.look, lambda: dropped.drop("x.npz", b"zip"), dropped.discard):
        with pytest.raises(FileFormatError, match="link out"):
            call()
    assert (tmp_path / "large" / "x.npz").read_bytes() == b""


def test_a_link_in_it_is_not_followed_and_a_file_may_vanish(dropped, tmp_path, monkeypatch):
    (tmp_path / "large").mkdir()
    for i in range(10):
        (tmp_path / "large" / f"{i}.npz").touch()
    (dropped.verbs.folder / "recordings" / "more").symlink_to(tmp_path / "large")
    there, walk = dropped.look().files, module.os.walk

    def walk_late(folder):
        found = [*walk(folder)]
        return [*found, (str(folder), [], ["gone.npz"])]

    monkeypatch.setattr(module.os, "walk", walk_late)
    assert there == 4
    assert dropped.drop("throw_9.npz", b"zip").files == 6


def test_columns_that_nobody_can_tell_apart_are_chosen(tmp_path):
    Workspace.create(tmp_path / "w", manifest()).close()
    recordings(tmp_path / "recorded", outcomes=())
    verbs = Verbs(tmp_path / "w")
    imports = Imports(verbs)
    for path in sorted((tmp_path / "recorded").iterdir()):
        with np.load(path) as arrays:
            renamed = {**arrays, "joint_names": np.array(["elbow", "shoulder"])}
        renamed["q"] = renamed["q"][:, ::-1]
        np.savez(path, **renamed)
        imports.drop(path.name, path.read_bytes())
    found = imports.look()
    assert (found.joints, found.recorded) == (["joint1", "joint2"], ["elbow", "shoulder"])
    for wrong in (["shoulder"], ["shoulder", "wrist"], ["elbow", "elbow"], []):
        with pytest.raises((InvalidDemonstrationsError, ConfigurationError)):
            imports.columns(Columns(names=wrong))
    found = imports.columns(Columns(names=["shoulder", "elbow"]))
    assert (found.problem, found.recorded, len(found.episodes)) == ("", [], 4)
    touch_all(imports)
    imports.take(Take(seen=0))
    np.testing.assert_allclose(
        verbs.workspace.demonstrations.plans[:, -1], demonstrations().plans[:, -1], atol=1e-9
    )
    verbs.close()
