"""Runs that are killed at random moments, with all their workers, and then left to end.

    python tests/lab/experiments/killed_runs.py FOLDER KILLS

A program of its own, because a process that has used threads cannot be forked.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from quick_units import real_units

from prior_reinforce.lab.experiments.units import Workers, run_units

WRITING = 0.02
"""Seconds that every write takes at least, so that a kill within one does not depend on luck."""
WORKERS = (1, 1, 1, 2)  # A new worker takes seconds to start, so most runs do without.


def printed_by(program, *args):
    """What a program of its own prints; these fork, or leave Ray around."""
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, here / program, *map(str, args)],
        capture_output=True,
        text=True,
        env=os.environ
        | {"OMP_NUM_THREADS": "1", "RAY_USAGE_STATS_ENABLED": "0", "PYTHONPATH": path},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


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


def results(folder: Path) -> dict[str, bytes]:
    """Every file, the unfinished ones too."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def wait_for_a_write(folder: Path, pid: int) -> None:
    """Return within a write, or when the run has ended."""
    known = set(folder.glob("*/.unfinished-*"))
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if set(folder.glob("*/.unfinished-*")) - known:
            return
        time.sleep(WRITING / 10)  # not a core of its own


def main(folder: Path, n_kills: int) -> None:
    reference = folder / "reference"
    started = time.monotonic()
    assert os.waitpid(start(reference, 1), 0)[1] == 0
    whole = time.monotonic() - started
    wanted = results(reference)
    rng = np.random.default_rng(1)
    kills = runs = unfinished = 0
    while kills < n_kills:
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
            if kills >= n_kills:
                assert os.waitpid(start(killed, 1), 0)[1] == 0
                break
        assert results(killed) == wanted
    print(f"{kills} kills in {runs} runs of {len(wanted)} files, {unfinished} unfinished ones left")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
