"""Kill -9 at random moments of a scripted session; `power_cut.py` is the session."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

KILLS = 25


@pytest.mark.slow
def test_a_session_survives_being_killed_at_any_moment(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.attacks.power_cut", tmp_path, str(KILLS)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert f"{KILLS} kills" in done.stdout
