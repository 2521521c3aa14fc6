"""The documentation's own code, as it stands: guides, members, names and paths."""

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
@pytest.mark.parametrize("name", ["demonstrations.md", "robots.md", "symmetry.md"])
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
def test_members_of_the_guide_go_through_trials_on_the_command_line(tmp_path):
    text = (DOCS / "extending.md").read_text()
    files = re.findall(r'^```python title="(.*?)"\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    for name, code in files:
        (tmp_path / name).write_text(code)
    told = run("bash", "-e", "-o", "pipefail", "-c", blocks("extending.md", "sh")[0], cwd=tmp_path)
    assert len(re.findall(r"reached: N = 6 demonstrations \+ \d+ trial", told)) == 2


@pytest.mark.slow
def test_files_that_docs_and_docstrings_name_are_there():
    named = re.compile(
        r"(?<![\w/])(?:benchmarks|docs|examples|reproduction|results|tests)/[\w./-]+\.(?:py|md|ipynb)\b"
    )
    pages = [*REPOSITORY.glob("*.md"), *DOCS.rglob("*.md"), *REPOSITORY.glob("benchmarks/*.md")]
    pages += REPOSITORY.glob("reproduction/docs/*.md")
    modules = [*REPOSITORY.glob("src/**/*.py"), *REPOSITORY.glob("examples/*.py")]
    modules += REPOSITORY.glob("reproduction/src/**/*.py")
    missing = {
        f"{path.relative_to(REPOSITORY)}: {name}"
        for path in pages + modules
        for name in named.findall(path.read_text())
        if not (REPOSITORY / name).exists()
    }
    readers_own = {"CONTRIBUTING.md: tests/adapters/test_drift.py"}
    assert missing <= readers_own


def test_every_part_of_the_package_is_on_the_page_of_the_architecture():
    page = (DOCS / "architecture.md").read_text()
    package = Path(pr.__file__).parent
    parts = {p.name + "/" if p.is_dir() else p.name for p in package.iterdir()}
    parts |= {
        f"{wing}/{p.name}/" for wing in ("arm", "simulation") for p in (package / wing).glob("*/")
    }
    parts = {part for part in parts if "__" not in part} - {"py.typed"}
    table = re.search(r"^\| part \| job \|\n(.*?)\n\n", page, re.DOTALL | re.MULTILINE)[1]
    rows = [line.split("|")[1] for line in table.splitlines()]
    assert {name for row in rows for name in re.findall(r"`(.+?)`", row)} == parts
    files = re.findall(r"`([\w/]+(?:\.py|/))`", page)
    assert [name for name in files if not any(package.rglob(name))] == []


def test_every_exported_name_is_in_the_reference_once():
    shown = [
        name
        for page in (DOCS / "api").glob("*.md")
        for name in re.findall(r"^::: prior_reinforce\.(\S+)$", page.read_text(), re.MULTILINE)
    ]
    exported = {*pr.__all__} - {"__version__"}
    exported |= {f"testing.{name}" for name in prior_reinforce.testing.__all__}
    assert sorted(shown) == sorted(exported)
