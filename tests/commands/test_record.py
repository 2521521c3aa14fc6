"""Recording at an arm: by the clock, and by keys at a terminal."""

import errno
import re
import time
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest

from prior_reinforce.arm.executing.base import GuidedState
from prior_reinforce.arm.workspace.manifest import parse_manifest
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands.importing import Import
from prior_reinforce.commands.record import _Session
from tests.arm.executing.toy_arm import name_arm
from tests.arm.workspace.planar import manifest
from tests.commands.at_terminal import Typed

BY_CLOCK = ("--takes", "4", "--seconds", "1", "--pause", "1")


@pytest.fixture
def folder(tmp_path, toy_plugin):
    """A workspace whose arm is thrown by a hand every two seconds."""
    folder = tmp_path / "planar"
    Workspace.create(folder, manifest()).close()
    name_arm(folder, tmp_path / "arm")
    return folder


def test_takes_by_the_clock_end_in_the_workspace(run, folder):
    status, _, refused = run("record", folder, *BY_CLOCK)
    assert status == 2
    assert "no outcomes for episodes take-1, take-2, take-3, take-4" in refused
    recorded = folder / "recordings/1"
    assert sorted(path.name for path in recorded.glob("*.png")) == [
        f"take-{i}.png" for i in range(1, 5)
    ]
    rows = ["episode,x_m,y_m", *(f"take-{i + 1},{0.8 + 0.1 * i},{0.1 * (i % 2)}" for i in range(4))]
    (recorded / "outcomes.csv").write_text("\n".join(rows))
    assert run("import", folder, recorded)[0] == 0
    with Workspace(folder) as workspace:
        plans = workspace.demonstrations.plans
    # Each take has the whole throw: 0.8 rad first, 0.1 rad farther every time.
    assert np.ptp(plans[:, :, 0], axis=1) == pytest.approx([0.8, 0.9, 1.0, 1.1], abs=2e-3)


def test_the_import_that_is_to_be_typed_next_names_the_recordings(run, folder, monkeypatch):
    def propose(command, workspace, source):
        print(command.as_typed("--smooth 5"))

    monkeypatch.setattr(Import, "read_into", propose)
    _, said, _ = run("record", folder, *BY_CLOCK, "--append")
    command = f"import {folder} {folder}/recordings/1 --format npz --units rad rad --append"
    assert f"prior-reinforce {command} --smooth 5\n" in said


def test_what_a_leader_told_the_arm_is_learned_and_the_lag_is_said(run, folder, tmp_path):
    name_arm(folder, tmp_path / "arm", led=True)
    _, said, _ = run("record", folder, *BY_CLOCK)
    assert "its commanded motion" in said
    assert "100 ms behind what it was told: lag = 0.100" in said
    with np.load(folder / "recordings/1/take-1.npz") as take:
        assert np.array_equal(take["q"], take["commanded"])
        assert not np.array_equal(take["q"], take["measured"])
    _, said, _ = run("record", folder, *BY_CLOCK, "--motion", "measured")
    assert "its measured motion" in said
    with np.load(folder / "recordings/2/take-1.npz") as take:
        assert np.array_equal(take["q"], take["measured"])


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ((), "without a terminal there are no keys"),
        (("--takes", "0"), "--takes and --seconds must be more than 0"),
        (("--takes", "2", "--seconds", "0"), "--takes and --seconds must be more than 0"),
    ],
)
def test_what_cannot_be_recorded_is_said_and_leaves_nothing(run, folder, flags, said):
    status, _, refused = run("record", folder, *flags)
    assert status == 2
    assert said in refused
    assert not (folder / "recordings").exists()


@pytest.mark.parametrize(
    ("guiding", "said"), [("let go", "its torque goes off"), ("led", "where its leader is")]
)
def test_an_arm_that_would_fall_or_move_waits_for_a_person(run, folder, tmp_path, guiding, said):
    name_arm(folder, tmp_path / "arm", guiding=guiding)
    _, _, refused = run("record", folder, *BY_CLOCK)
    assert said in refused
    assert not (folder / "recordings").exists()
    run("record", folder, *BY_CLOCK, "--yes")
    assert (folder / "recordings/1/take-4.npz").exists()


def test_a_person_who_holds_the_arm_says_so_at_the_terminal(folder, tmp_path):
    name_arm(folder, tmp_path / "arm", guiding="let go", seconds=0.005)
    for answer, then in (("no", "nothing was done"), ("yes", "q imports them")):
        typed = Typed("record", folder)
        typed.wait_for('type "yes" if so, or press Enter if not: ')
        typed.type(f"{answer}\n")
        typed.wait_for(then)
        typed.close()


def test_no_take_is_recorded_over_one_that_was_given_its_name(tmp_path):
    shown = parse_manifest(manifest(), tmp_path / "workspace.toml")
    terminal = SimpleNamespace(line=lambda question: "take-2")
    session = _Session(shown, tmp_path, [0, 1], None, terminal, asks=False)
    for size in (1.0, 2.0):
        session.toggle()
        for i in range(12):
            session.add(GuidedState(i / 100, *2 * [np.array([size * i, 0.0])]))
        session.toggle()
        if size == 1.0:
            session.name_last()
    assert [*session.taken] == ["take-2", "take-3"]
    for name, size in (("take-2", 1.0), ("take-3", 2.0)):
        with np.load(tmp_path / f"{name}.npz") as take:
            assert take["q"][-1, 0] == 11 * size


def test_an_arm_that_is_unplugged_keeps_what_was_recorded(run, folder, tmp_path):
    name_arm(folder, tmp_path / "arm", kind="unplugged")
    _, _, refused = run("record", folder, *BY_CLOCK[:3], "0.2", "--pause", "0.1")
    assert "does not answer any more" in refused
    command = f"import {folder} {folder}/recordings/1 --format npz --units rad rad\n"
    assert f"take-1; next: prior-reinforce {command}" in refused
    assert (folder / "recordings/1/take-1.npz").is_file()


def test_takes_are_cut_dropped_named_and_placed_by_keys(folder, tmp_path):
    name_arm(folder, tmp_path / "arm", seconds=0.005)
    typed = Typed("record", folder)
    typed.wait_for("q imports them")
    for place, key in (("80cm 10cm", "d"), ("90cm 5cm", "n")):
        typed.type(" ")
        typed.wait_for("take-")
        time.sleep(0.3)  # a take has ten states at least
        typed.type("\n")
        typed.wait_for("where did it land")
        typed.type("there\n")
        typed.wait_for("where did it land")
        typed.type(f"{place}\n")
        typed.type(key)
    typed.wait_for("another name for take-2: ")
    typed.type("good\n")
    typed.type("q")
    with suppress(AssertionError):
        typed.wait_for("nothing that it says", 30.0)
    typed.close()
    recorded = folder / "recordings/1"
    assert sorted(path.name for path in recorded.iterdir()) == [
        "good.npz",
        "good.png",
        "outcomes.csv",
    ]
    assert re.search(r"^good,0\.9,0\.05,", (recorded / "outcomes.csv").read_text(), re.MULTILINE)


@pytest.fixture
def session(tmp_path):
    """Takes of a hand, without an arm; what is answered is `named`."""
    shown = parse_manifest(manifest(), tmp_path / "workspace.toml")
    terminal = SimpleNamespace(line=lambda question: session.named)
    session = _Session(shown, tmp_path, [0, 1], None, terminal, asks=False)
    session.named = ""
    return session


def take(session):
    session.toggle()
    for i in range(12):
        session.add(GuidedState(i / 100, *2 * [np.array([i, 0.0])]))
    session.toggle()


def test_a_take_is_kept_without_a_picture_where_none_can_be_written(
    session, tmp_path, monkeypatch, capsys
):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("prior_reinforce.report.style.save_figure", full)
    take(session)
    assert "no picture: " in capsys.readouterr().out
    assert (tmp_path / "take-1.npz").is_file()
    session.named = "good"
    session.name_last()
    assert (tmp_path / "good.npz").is_file()
    take(session)
    assert [*session.taken] == ["good", "take-2"]


@pytest.mark.parametrize(
    ("named", "why"),
    [
        ("a/b", "is no name"),
        (".a", "is no name"),
        (300 * "a", "is no name"),
        ("take-1", "is a take-1"),
    ],
)
def test_a_name_that_cannot_be_given_is_refused_with_its_reason(session, capsys, named, why):
    take(session)
    session.named = named
    session.name_last()
    assert re.search(f"it stays take-1: .*{why}", capsys.readouterr().out)


def test_takes_before_an_interruption_are_named_with_their_import(run, folder, monkeypatch):
    def interrupt(command, workspace, source):
        raise KeyboardInterrupt

    monkeypatch.setattr(Import, "read_into", interrupt)
    status, _, err = run("record", folder, *BY_CLOCK, "--append")
    assert status == 130
    command = f"import {folder} {folder}/recordings/1 --format npz --units rad rad --append\n"
    assert f"take-4; next: prior-reinforce {command}" in err
