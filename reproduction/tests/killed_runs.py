"""Runs that are killed at random moments, with all their workers, and then left to end.

python reproduction/tests/killed_runs.py FOLDER SEED
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from quick_units import real_units, results

from prior_reinforce.registry import PLUGINS
from reproduction.units import Workers, run_units

WRITING = 0.02
"""Seconds that every write takes at least, so that a kill within one does not depend on luck."""
KILLS = 4
MOST_KILLS = 20
"""Where none of them came within a write: a busy machine wakes this program too late."""
WORKERS = (1, 1, 1, 2)  # A new worker takes seconds to start, so most runs do without.


def start(folder: Path, workers: int) -> int:
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            durable = os.fsync
            os.fsync = lambda file: (durable(file), time.sleep(WRITING))
            os.setsid()  # the run's workers belong to its group
            run_units(real_units(), folder, Workers(workers), lambda *_: None)
            status = 0
        finally:
            os._exit(status)
    return pid


def wait_for_a_write(folder: Path, pid: int) -> None:
    """Return within a write, or when the run has ended."""
    known = set(folder.glob("*/.unfinished-*"))
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if set(folder.glob("*/.unfinished-*")) - known:
            return
        time.sleep(WRITING / 10)  # not a core of its own


def main(folder: Path, seed: int) -> None:
    # Loaded once: runs that load torch and MuJoCo themselves are mostly killed while they do.
    import joblib  # noqa: F401
    import mujoco.rollout  # noqa: F401
    import scipy.interpolate
    import scipy.optimize
    import scipy.spatial  # noqa: F401
    import torch._dynamo  # noqa: F401  # an optimizer does

    os.environ[PLUGINS] = "quick_units"  # for the workers
    reference = folder / "reference"
    started = time.monotonic()
    assert os.waitpid(start(reference, 1), 0)[1] == 0
    whole = time.monotonic() - started
    wanted = results(reference)
    rng = np.random.default_rng(seed)
    kills = runs = unfinished = 0
    while kills < KILLS or (not unfinished and kills < MOST_KILLS):
        killed = folder / f"killed{runs}"
        runs += 1
        while True:
            pid = start(killed, WORKERS[kills % len(WORKERS)])
            if kills % 4 == 0:
                time.sleep(rng.uniform(0.0, 0.5 * whole))
            else:
                wait_for_a_write(killed, pid)
                time.sleep(rng.uniform(0.0, WRITING / 2))
            done, status = os.waitpid(pid, os.WNOHANG)
            if done:
                assert status == 0
                break
            os.killpg(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            kills += 1
            there = results(killed)
            whole_ones = {name: data for name, data in there.items() if ".unfinished" not in name}
            unfinished += len(there) - len(whole_ones)
            assert whole_ones.items() <= wanted.items(), "a file is not as it should be"
            if kills >= KILLS:
                assert os.waitpid(start(killed, 1), 0)[1] == 0
                break
        assert results(killed) == wanted
    assert unfinished, "no kill came while a file was written"


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
