"""A packed workspace opens elsewhere as it was; what was changed or made to harm does not."""

import json
import shutil
import zipfile

import numpy as np
import pytest

from prior_reinforce.bench.workspace.packing import pack, unpack
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, PriorReinforceError, WorkspaceError
from prior_reinforce.files import sha256
from tests.bench.workspace.planar import ask, tell


@pytest.fixture
def packed(workspace, tmp_path):
    """Two trials, one told; secrets where people keep them."""
    ask(workspace)
    tell(workspace, 1, "5cm long")
    ask(workspace)
    for name in (".env", "report/token.txt", "executions/trial-001-0/out.txt", "models/.key"):
        path = workspace.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("sk-secret")
    manifest = workspace.folder / "workspace.toml"
    manifest.write_text(manifest.read_text() + '\n[arm]\nexecutor = "my:Arm"\npassword = "sk-x"\n')
    pack(workspace, tmp_path / "hoop.zip")
    return tmp_path / "hoop.zip"


def contents(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewritten(path, changes, kind=zipfile.ZIP_STORED, honest=True):
    """The archive with other contents, its list of hashes made to fit them."""
    files = {**contents(path), **changes}
    files = {name: content for name, content in files.items() if content is not None}
    if honest:
        about = json.loads(files["pack.json"])
        about["files"] = {n: sha256(c) for n, c in files.items() if n != "pack.json"}
        files["pack.json"] = json.dumps(about).encode()
    with zipfile.ZipFile(path, "w", kind) as archive:
        for name, content in files.items():
            archive.writestr(name, content)


def test_it_opens_elsewhere_as_it_was(packed, workspace, tmp_path):
    unpack(packed, tmp_path / "there")
    with Workspace(tmp_path / "there") as there:
        assert [e.event for e in there.events] == [e.event for e in workspace.events]
        assert [e.time for e in there.events] == [e.time for e in workspace.events]
        waiting = ask(there)
        np.testing.assert_array_equal(waiting.plan, ask(workspace).plan)
        tell(there, 2, "2cm left")
        tell(workspace, 2, "2cm left")
        np.testing.assert_allclose(ask(there).condition, ask(workspace).condition)


def test_nothing_of_this_machine_goes_in(packed):
    said = contents(packed)
    assert not [name for name, content in said.items() if b"sk-" in content]
    assert {name.partition("/")[0] for name in said} == {
        *("pack.json", "workspace.toml", "journal.jsonl", "demonstrations", "models", "plans")
    }
    about = json.loads(said["pack.json"])
    assert about["program"]
    assert about["files"]["workspace.toml"] == sha256(said["workspace.toml"])


def test_what_was_changed_is_refused(packed, tmp_path):
    """Whatever byte is another one: refused, or (in the zip's own dates) it changes nothing."""
    whole, rng = packed.read_bytes(), np.random.default_rng(0)
    unpack(packed, tmp_path / "good")
    good = {p.name: p.read_bytes() for p in (tmp_path / "good").rglob("*.npz")}
    refused = 0
    for place in rng.choice(len(whole), 150, replace=False):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << rng.integers(8)
        packed.write_bytes(damaged)
        try:
            unpack(packed, tmp_path / "bad")
        except PriorReinforceError:
            refused += 1
            assert not (tmp_path / "bad").exists()
        else:
            assert {p.name: p.read_bytes() for p in (tmp_path / "bad").rglob("*.npz")} == good
            shutil.rmtree(tmp_path / "bad")
    assert refused > 100
    for end in (0, 10, len(whole) // 2, len(whole) - 1):
        packed.write_bytes(whole[:end])
        with pytest.raises(FileFormatError, match="cannot be unpacked"):
            unpack(packed, tmp_path / "bad")


@pytest.mark.parametrize(
    "name",
    [
        *("../evil", "/etc/evil", "models/../../evil", "plans\\..\\evil", "models/a/b/c"),
        *("demonstrations/../x.npz", ".env", "executions/x/run.py", "models/0123456789abcdef/.sh"),
        *("plans/trial-001-01234567.npz\n", "journal.sqlite", "C:evil"),
    ],
)
def test_no_file_goes_where_none_belongs(packed, tmp_path, name):
    rewritten(packed, {name: b"evil"})
    with pytest.raises(FileFormatError, match=r"no file of a workspace|cannot be unpacked"):
        unpack(packed, tmp_path / "deep" / "bad")
    assert not list(tmp_path.rglob("*evil*"))
    assert not (tmp_path / "deep" / "bad").exists()


def test_no_link_is_made(packed, tmp_path):
    (name,) = (n for n in contents(packed) if n.startswith("demonstrations/"))
    link = zipfile.ZipInfo(name)
    link.external_attr = 0o120777 << 16
    files = contents(packed) | {name: b"/etc/passwd"}
    about = json.loads(files.pop("pack.json"))
    about["files"][name] = sha256(b"/etc/passwd")
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("pack.json", json.dumps(about))
        for each, content in files.items():
            archive.writestr(link if each == name else each, content)
    with pytest.raises(FileFormatError, match="cannot be unpacked"):
        unpack(packed, tmp_path / "bad")
    assert not (tmp_path / "bad").exists()


def test_no_bomb_goes_off(packed, tmp_path):
    rewritten(packed, {"plans/trial-009-01234567.npz": bytes(10**7)}, zipfile.ZIP_DEFLATED)
    assert packed.stat().st_size < 10**6
    with pytest.raises(FileFormatError, match="compressed"):
        unpack(packed, tmp_path / "bad")


def test_files_that_share_their_bytes_are_refused(packed, tmp_path):
    """A zip may list one stretch of bytes under many names: small, and large when unpacked."""
    with zipfile.ZipFile(packed, "a") as archive:
        largest = max(archive.infolist(), key=lambda info: info.file_size)
        archive.filelist += [largest] * 50
        archive._didModify = True
    with pytest.raises(FileFormatError, match=r"twice|than its size|cannot be unpacked"):
        unpack(packed, tmp_path / "bad")


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("journal.jsonl", lambda old: old.replace(b"0.05", b"0.06"), "not what was written"),
        ("journal.jsonl", lambda old: old.split(b"\n", 1)[1], "not what was written"),
        ("journal.jsonl", lambda old: None, "other files than it says"),
        ("journal.jsonl", lambda old: b"", "missing or empty"),
        ("workspace.toml", lambda old: b"[task", "cannot be unpacked"),
        ("workspace.toml", lambda old: old + b"[arm]\nexecutor='x:Y'\n", "names an"),
        ("workspace.toml", lambda old: b"arm.executor='x:Y'\n" + old, "as a section"),
        ("workspace.toml", lambda old: b"a=" + b"[" * 10**5, "cannot be unpacked"),
        ("pack.json", lambda old: old.replace(b'"journal": ', b'"journal": 9'), "use that version"),
        ("pack.json", lambda old: b"[" * 10**5, "cannot be unpacked"),
        ("pack.json", lambda old: None, "no pack.json"),
    ],
)
def test_what_was_made_to_look_right_is_refused(packed, tmp_path, name, change, said):
    rewritten(packed, {name: change(contents(packed)[name])}, honest=name != "pack.json")
    with pytest.raises(FileFormatError, match=said):
        unpack(packed, tmp_path / "bad")
    assert not (tmp_path / "bad").exists()


def test_nothing_is_written_over(packed, workspace, tmp_path):
    with pytest.raises(FileFormatError, match="is there already"):
        pack(workspace, packed)
    with pytest.raises(WorkspaceError, match="exists"):
        unpack(packed, workspace.folder)
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(WorkspaceError, match="exists"):
        unpack(packed, tmp_path / "link")


def test_on_the_command_line(run, folder, tmp_path, monkeypatch):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    monkeypatch.chdir(tmp_path / folder)
    status, out, _ = run("pack", "../hoop.zip")
    assert (status, out) == (
        0,
        f"packed: ../hoop.zip  sha256 {sha256((tmp_path / 'hoop.zip').read_bytes())}\n",
    )
    monkeypatch.chdir(tmp_path)
    status, said, _ = run("unpack", "hoop.zip", "there")
    assert status == 0
    assert out.split()[-1] in said
    assert "trial 1 waits: was it executed where this was packed?" in said
    assert "next            prior-reinforce tell there 1" in said
    assert run("unpack", "hoop.zip", "there")[0] == run("unpack", "gone.zip", "x")[0] == 2
    assert run("pack", "there")[0] == 2
