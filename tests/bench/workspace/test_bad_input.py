"""Generated bad input: an error of ours, in one line, and a journal that has not changed."""

import contextlib
import io
import re
import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prior_reinforce.bench.workspace.manifest import parse_manifest
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.cli import main
from prior_reinforce.errors import PriorReinforceError
from tests.bench.workspace.planar import demonstrations, manifest

many = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
REMEDY = re.compile(
    r"give|say|write|mend|make|must|restore|tell|ask|call|void|see|run:|choose|add|put|needs|known"
    r"|copy|unknown; |missing|expected|valid|looks like|wait|drop|correct|measure|help",
    re.IGNORECASE,
)
numbers = st.floats(width=32).map(str)
words = st.one_of(
    numbers,
    st.sampled_from(["5cm", "long", "left,", "-3", "0.02", "hit", "--hit", "--error", "--outcome"]),
    st.text(max_size=8).filter(lambda text: "\0" not in text),
)


@pytest.fixture(scope="module")
def asked(learned_folder, tmp_path_factory):
    """A workspace with one open trial."""
    folder = tmp_path_factory.mktemp("asked") / "planar"
    shutil.copytree(learned_folder, folder)
    workspace = Workspace(folder)
    workspace.set_goal([0.9, 0.05])
    workspace.session().ask()
    workspace.close()
    return folder


def state(folder):
    workspace = Workspace(folder)
    events = workspace.events
    workspace.close()
    return events


def fails_well(folder, *args):
    """Run a command; if it fails, it must say why and leave the journal. Returns its status."""
    before = state(folder)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(args)
        except SystemExit as end:  # how tyro ends where it cannot parse
            status = end.code
    assert status in (0, 2)
    if status == 2:
        assert REMEDY.search(err.getvalue()), err.getvalue()
        assert "Traceback" not in err.getvalue()
        assert state(folder) == before
    return status


@given(st.lists(words, max_size=4), st.sampled_from(["--error", "--outcome"]), st.integers(-1, 3))
@many
def test_tells(asked, tmp_path, said, flag, number):
    folder = tmp_path / "copy"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(asked, folder)
    fails_well(folder, "tell", str(folder), str(number), flag, *said)


@given(st.lists(words, max_size=3))
@many
@pytest.mark.filterwarnings("ignore:goal")
def test_goals_while_a_trial_is_open(asked, goal):
    assert fails_well(asked, "goal", str(asked), *goal) == 2 or "--help" in goal


@given(st.lists(numbers, min_size=1, max_size=3))
@many
@pytest.mark.filterwarnings("ignore:goal")
def test_goals(learned_folder, tmp_path, goal):
    folder = tmp_path / "copy"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(learned_folder, folder)
    good = len(goal) == 2 and all(abs(float(number)) <= 5 for number in goal)
    assert fails_well(folder, "goal", str(folder), *goal) == (0 if good else 2)


@given(st.data())
@many
def test_manifests(tmp_path, data):
    text = manifest()
    if data.draw(st.booleans()):
        lines = text.splitlines()
        at = data.draw(st.integers(0, len(lines) - 1))
        value = data.draw(st.one_of(numbers, st.text(max_size=10), st.just("[1, 2]")))
        key = lines[at].split("=")[0] if "=" in lines[at] else data.draw(st.text(max_size=6))
        lines[at] = f"{key}= {value}"
        text = "\n".join(lines)
    else:
        start = data.draw(st.integers(0, len(text)))
        text = text[:start] + data.draw(st.text(max_size=5)) + text[start + 3 :]
    message = None
    try:
        parse_manifest(text, tmp_path / "workspace.toml")
    except PriorReinforceError as error:
        message = str(error)
    assert message is None or (str(tmp_path) in message and REMEDY.search(message)), message


@given(st.data())
@many
def test_damaged_files(asked, tmp_path, data):
    """Truncated and bit-flipped: never a traceback, never another journal."""
    folder = tmp_path / "copy"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(asked, folder)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = data.draw(st.sampled_from(files))
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content[at] ^= 1 << data.draw(st.integers(0, 7))
    else:
        del content[at:]
    path.chmod(0o644)
    path.write_bytes(content)
    command = data.draw(st.sampled_from(["status", "ask", "log"] * 3 + ["report"]))
    err = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
        status = main([command, str(folder)])
    assert status in (0, 2)
    if status == 2:
        assert REMEDY.search(err.getvalue()), err.getvalue()
        assert path.read_bytes() == content


@given(st.lists(st.lists(st.one_of(numbers, st.text(max_size=6)), max_size=4), max_size=6))
@many
def test_outcomes(learned_folder, recorded, tmp_path, rows):
    folder = tmp_path / "copy"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(learned_folder, folder)
    table = tmp_path / "outcomes.csv"
    text = "\n".join(["episode,x,y", *(",".join(row) for row in rows)])
    table.write_text(text, encoding="utf-8", newline="")
    assert fails_well(folder, "import", str(folder), str(recorded), "--outcomes", str(table)) == 2


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Four recordings without outcomes."""
    folder = tmp_path_factory.mktemp("recorded")
    for i, plan in enumerate(demonstrations().plans):
        np.savez(folder / f"throw_{i}.npz", q=plan, dt=0.02, joint_names=["joint1", "joint2"])
    return folder
