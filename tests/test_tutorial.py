"""The code blocks of the tutorial and of the Python page, as they stand, in a fresh folder."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(python|bash)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_a_new_user_reaches_a_goal_by_following_the_tutorial(tmp_path):
    shutil.copytree(REPOSITORY / "examples", tmp_path / "examples")
    environment = os.environ | {
        # `python` and `prior-reinforce` are those that this test runs in.
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    shells = {"python": [sys.executable, "-c"], "bash": ["bash", "-e", "-o", "pipefail", "-c"]}
    blocks = BLOCK.findall((REPOSITORY / "docs" / "tutorial.md").read_text())
    assert len(blocks) == 9
    said = ""
    for language, code in blocks:
        done = subprocess.run(
            [*shells[language], code],
            cwd=tmp_path,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{code}\n{said}{done.stdout}{done.stderr}"
        said += done.stdout
    assert re.search(r"the ball came down \d", said), said  # a miss, or the loop shows nothing
    assert re.search(r"reached in \d+ trials? \(N = 1 demonstration \+ \d+ trials? = ", said), said
    page = (tmp_path / "hoop" / "report" / "report.html").read_text()
    assert "ball slipped" in page


@pytest.mark.slow
def test_the_afternoon_from_python_runs_as_it_stands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (REPOSITORY / "docs" / "python.md").read_text()
    said = {}
    exec("".join(code for _, code in BLOCK.findall(page)), said)
    assert said["status"].goals[0].reached_after >= 1
    assert said["page"].is_file()
    assert {path.name for path in tmp_path.iterdir()} == {*("recordings", "hoop", "plan.csv")}
