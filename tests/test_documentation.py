"""The documentation's own code, as it stands: guides, extension, API pages, notebook."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import prior_reinforce as pr
import prior_reinforce.testing

REPOSITORY = Path(__file__).parents[1]
DOCS = REPOSITORY / "docs"


def blocks(name, info):
    """Code blocks of a page whose opening line matches, in order."""
    text = (DOCS / name).read_text()
    return re.findall(rf"^```{info}\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)


def run(*command, cwd):
    environment = os.environ | {
        # `python` and `prior-reinforce` are those that this test runs in.
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    done = subprocess.run(
        command, cwd=cwd, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", ["demonstrations.md", "robots.md"])
def test_the_examples_of_the_guides_run(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    namespace = {}
    code = blocks(name, "python")
    assert code
    for block in code:
        exec(compile(block, name, "exec"), namespace)
    printed = capsys.readouterr().out
    for shown in blocks(name, "text"):
        if shown.startswith("plan "):
            assert all(line in printed for line in shown.splitlines() if line.strip() != "...")


@pytest.mark.slow
def test_members_written_as_the_guide_says_keep_their_contracts_and_reach_goals(tmp_path):
    files = re.findall(
        r'^```python title="(.*?)"\n(.*?)^```$',
        (DOCS / "extending.md").read_text(),
        flags=re.DOTALL | re.MULTILINE,
    )
    assert [name for name, _ in files] == [
        "drift.py", "affine.py", "tape.py", "puck.py", "compare.py", "test_mine.py",
    ]  # fmt: skip
    for name, code in files:
        (tmp_path / name).write_text(code)
    commands = blocks("extending.md", "sh")
    assert len(commands) == 2
    for command in commands:
        run("bash", "-e", "-o", "pipefail", "-c", command, cwd=tmp_path)
    shares = run(sys.executable, "compare.py", cwd=tmp_path)
    assert shares.strip(" []\n").endswith("1.")  # every goal is reached in the end


def test_files_that_docs_and_docstrings_name_are_there():
    named = re.compile(r"\b(?:benchmarks|docs|examples|results|tests)/[\w./-]+\.(?:py|md|ipynb)\b")
    pages = [*REPOSITORY.glob("*.md"), *DOCS.rglob("*.md"), *REPOSITORY.glob("benchmarks/*.md")]
    modules = [*REPOSITORY.glob("src/**/*.py"), *REPOSITORY.glob("examples/*.py")]
    missing = {
        f"{path.relative_to(REPOSITORY)}: {name}"
        for path in pages + modules
        for name in named.findall(path.read_text())
        if not (REPOSITORY / name).exists()
    }
    assert (
        missing - {"CONTRIBUTING.md: tests/adapters/test_drift.py"} == set()
    )  # the reader writes it


def test_every_exported_name_is_in_the_reference_once():
    shown = [
        name
        for page in (DOCS / "api").glob("*.md")
        for name in re.findall(r"^::: prior_reinforce\.(\S+)$", page.read_text(), re.MULTILINE)
    ]
    exported = {*pr.__all__} - {"__version__"}
    exported |= {f"testing.{name}" for name in prior_reinforce.testing.__all__}
    assert sorted(shown) == sorted(exported)


@pytest.mark.slow
def test_the_notebook_runs_from_top_to_bottom():
    run(sys.executable, "-m", "pytest", "-q", "--nbmake", "docs/first-goal.ipynb", cwd=REPOSITORY)
