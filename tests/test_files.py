"""Files: whole or not at all, however a write ends."""

import errno
import os
import subprocess
import sys

import numpy as np
import pytest

from prior_reinforce import files
from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.files import (
    as_cell,
    claim_folder,
    from_cell,
    in_place,
    open_npz,
    refuse_foreign,
    require_inside,
    sha256_of_folder,
    sweep,
    write,
    write_once,
)


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "result.json"
    write(path, "old")

    def interrupted():
        with in_place(path) as unfinished:
            unfinished.write_text("half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert contents(tmp_path) == {"result.json": b"old"}


def test_all_of_a_finished_folder_is_kept_before_it_has_its_name(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(os, "fsync", lambda handle: kept.append(os.fstat(handle).st_ino))
    with in_place(tmp_path / "model") as unfinished:
        (unfinished / "generator").mkdir(parents=True)
        (unfinished / "generator" / "weights").write_text("1")
    model = tmp_path / "model"
    parts = [model, model / "generator", model / "generator" / "weights", tmp_path]
    assert sorted(kept) == sorted(part.stat().st_ino for part in parts)


def test_the_slower_of_two_leaves_the_quickers_folder(tmp_path):
    with in_place(tmp_path / "model") as slow:
        with in_place(tmp_path / "model") as quick:
            quick.mkdir()
            (quick / "weights").write_text("quick")
        slow.mkdir()
        (slow / "weights").write_text("slow")
    assert contents(tmp_path) == {"model/weights": b"quick"}


@pytest.mark.skipif(os.name != "posix", reason="whether a process lives is known on POSIX only")
def test_only_leftovers_of_the_dead_are_swept(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    with in_place(tmp_path / "mine") as unfinished:
        unfinished.write_text("in the making")
        mine = unfinished.parent
        left = tmp_path / mine.name.replace(f"-{os.getpid()}-", f"-{dead.pid}-")
        elsewhere = tmp_path / ".unfinished-another.host-1-x"
        left.mkdir()
        elsewhere.mkdir()
        sweep(tmp_path)
        assert not left.exists()
        assert elsewhere.exists()
        assert unfinished.read_text() == "in the making"


def test_what_is_written_once_is_never_replaced(tmp_path):
    path = write_once(tmp_path / "plan", b"one")
    assert write_once(path, b"one") == path
    with pytest.raises(FileFormatError, match="never overwritten"):
        write_once(path, b"two")
    assert contents(tmp_path) == {"plan": b"one"}
    assert not path.stat().st_mode & 0o222


def test_a_file_written_once_respects_the_umask(tmp_path):
    before = os.umask(0o077)
    try:
        path = write_once(tmp_path / "plan", b"one")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o400


@pytest.mark.parametrize(
    ("code", "remedy"), [(errno.ENOSPC, "free some disk"), (errno.EROFS, "writable")]
)
def test_a_disk_that_refuses_leaves_nothing(tmp_path, monkeypatch, code, remedy):
    def refuse(descriptor):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(files.os, "fsync", refuse)
    with pytest.raises(WorkspaceError, match=f"{os.strerror(code)}.*{remedy}"):
        write_once(tmp_path / "plan", b"one")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_to_is_named_and_no_file_of_ours(tmp_path, monkeypatch):
    def refuse(dir, prefix):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(dir / prefix))

    monkeypatch.setattr(files.tempfile, "mkdtemp", refuse)
    with pytest.raises(WorkspaceError, match="make the folder writable") as refused:
        write(tmp_path / "plan", b"one")
    assert files._PREFIX not in str(refused.value)


def test_a_disk_without_links(tmp_path, monkeypatch):
    def refuse(source, target):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(files.os, "link", refuse)
    write_once(tmp_path / "plan", b"one")
    with pytest.raises(FileFormatError, match="never overwritten"):
        write_once(tmp_path / "plan", b"two")
    assert contents(tmp_path) == {"plan": b"one"}


def test_the_hash_of_a_folder_knows_names_and_contents_but_no_hidden_files(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "weights").write_text("1")
    same = sha256_of_folder(tmp_path / "a")
    (tmp_path / "b" / ".DS_Store").write_text("stray")
    assert sha256_of_folder(tmp_path / "b") == same
    (tmp_path / "b" / "weights").rename(tmp_path / "b" / "other")
    assert sha256_of_folder(tmp_path / "b") != same


def test_what_somebody_else_wrote_is_not_replaced(tmp_path):
    path = tmp_path / "table.json"
    refuse_foreign(path, "ours 1")
    path.write_text('{"kind": "ours 1"}')
    refuse_foreign(path, "ours 1")
    path.write_text("x,y,u,v")
    with pytest.raises(FileFormatError, match="choose another name"):
        refuse_foreign(path, "ours 1")
    path.unlink()
    path.symlink_to("nowhere")
    with pytest.raises(FileFormatError, match="choose another name"):
        refuse_foreign(path, "ours 1")


def test_a_folder_of_somebody_elses_files_is_not_written_to(tmp_path):
    for _ in range(2):  # what is ours once stays ours
        claim_folder(tmp_path / "new")
        write(tmp_path / "new" / "report.html", "page")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "report.html").write_text("<title>My thesis</title>")
    with pytest.raises(WorkspaceError, match="choose an empty or a new folder"):
        claim_folder(tmp_path / "thesis")
    assert contents(tmp_path / "thesis") == {"report.html": b"<title>My thesis</title>"}


def test_links_lead_nowhere_else(tmp_path):
    folder = tmp_path / "workspace"
    (folder / "models").mkdir(parents=True)
    (folder / "latest").symlink_to("models")
    for name in ("models", "latest", "latest/model", "not there"):
        assert require_inside(folder / name, folder) == folder / name
    (folder / "out").symlink_to(tmp_path)
    for name in ("out", "out/model", ".."):
        with pytest.raises(FileFormatError, match="is a link out of"):
            require_inside(folder / name, folder)
    (tmp_path / "linked").symlink_to(folder)
    assert require_inside(tmp_path / "linked" / "models", tmp_path / "linked")


def test_a_small_file_that_unpacks_to_a_flood_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_LARGEST_NPZ", 10_000)
    np.savez_compressed(tmp_path / "bomb.npz", q=np.zeros(10_000))
    assert (tmp_path / "bomb.npz").stat().st_size < 1_000
    with (
        pytest.raises(
            FileFormatError, match=r"unpacks to 8e\+04 bytes, at most .* are read\); copy it again"
        ),
        open_npz(tmp_path / "bomb.npz", "copy it again"),
    ):
        pass


@pytest.mark.parametrize("content", [b"", b"PK", b"not a zip file" * 100])
def test_arrays_that_are_none_are_named(tmp_path, content):
    (tmp_path / "q.npz").write_bytes(content)
    with (
        pytest.raises(FileFormatError, match=r"q\.npz cannot be read .*; copy it again"),
        open_npz(tmp_path / "q.npz", "copy it again"),
    ):
        pass


@pytest.mark.parametrize("text", ["=cmd|' -C calc'!A0", "+1", "-1", "@sum", "\tx", "\r", "", "'a"])
def test_no_cell_is_a_formula_and_each_reads_back(text):
    assert as_cell(text)[:1] not in set("=+-@\t\r")
    assert from_cell(as_cell(text)) == text
