"""The examples of the two guides run as they stand, top to bottom, in an empty folder."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["demonstrations.md", "robots.md"])
def test_the_examples_run(name, tmp_path, monkeypatch, capsys):
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / name).read_text(), flags=re.DOTALL)
    assert blocks
    monkeypatch.chdir(tmp_path)
    namespace = {}
    for block in blocks:
        exec(compile(block, name, "exec"), namespace)
    printed = capsys.readouterr().out
    for shown in re.findall(r"```text\n(.*?)```", (DOCS / name).read_text(), flags=re.DOTALL):
        if shown.startswith("plan "):
            assert all(line in printed for line in shown.splitlines() if line.strip() != "...")
