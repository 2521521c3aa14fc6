"""Units on a Ray cluster: a node may be lost, and no cluster is told at once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from quick_units import Roots

from prior_reinforce.errors import ConfigurationError
from reproduction.units import Workers, run_units


@pytest.mark.slow
def test_a_lost_node_of_a_ray_cluster_changes_nothing(tmp_path):
    pytest.importorskip("ray")
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, here / "ray_cluster.py", tmp_path],
        capture_output=True,
        text=True,
        env=os.environ
        | {"OMP_NUM_THREADS": "1", "RAY_USAGE_STATS_ENABLED": "0", "PYTHONPATH": path},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    text = done.stdout
    assert "1 of them twice" in text
    assert "'one that raises' failed: ArithmeticError: 0 is no divisor;" in text
    assert "'one that dies' failed: WorkerCrashedError" in text


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:99999"])
def test_a_cluster_that_does_not_answer_is_told_at_once(address, tmp_path):
    with pytest.raises(ConfigurationError, match=f"no Ray cluster answers at {address}: .*start"):
        run_units([Roots(0)], tmp_path, Workers(ray=address), lambda *_: None)
