"""How much slower training gets beside other work: as many busy processes as there are cores.

    python benchmarks/training_beside_load.py [--steps 100] [--threads 1 2] [--repeats 3]

Trains the default diffusion model in a process of its own, quiet and loaded in turn, for each
number of threads, with threads that sleep while they wait (ours) and, for comparison, that spin.
Prints the medians and their ratio. `learn` must not take more than three times its quiet time.
"""

from __future__ import annotations

import argparse
import itertools
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import joblib

_TRAIN = """
import sys, time
from prior_reinforce.generators import DiffusionConfig, DiffusionGenerator, Timed
from prior_reinforce.simulation.tasks import make_task
import prior_reinforce.generators.network.denoiser
demos = make_task("basketball-v1").demonstrations("A")
config = DiffusionConfig(training_steps=int(sys.argv[1]))
began = time.monotonic()
Timed(DiffusionGenerator(config, threads=int(sys.argv[2]))).fit(demos, seed=0)
print(time.monotonic() - began)
"""


@contextmanager
def busy(n: int) -> Iterator[None]:
    """Keep n processes computing meanwhile."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(n)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def seconds(steps: int, threads: int, wait: str) -> float:
    """Time one training in a process of its own."""
    command = [sys.executable, "-c", _TRAIN, str(steps), str(threads)]
    environment = {**os.environ, "OMP_WAIT_POLICY": wait, "MUJOCO_GL": "disabled"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()

    cores = joblib.cpu_count()
    print(f"{cores} cores, load before {os.getloadavg()[0]:.1f}; {options.steps} steps, in [s]")
    print("threads  waiting  quiet  loaded  ratio")
    for threads, wait in itertools.product(options.threads, ("PASSIVE", "ACTIVE")):
        if threads == 1 and wait == "ACTIVE":
            continue  # one thread waits for nobody
        quiet, loaded = [], []
        for _ in range(options.repeats):
            quiet.append(seconds(options.steps, threads, wait))
            with busy(cores):
                loaded.append(seconds(options.steps, threads, wait))
        a, b = statistics.median(quiet), statistics.median(loaded)
        how = "sleeps" if wait == "PASSIVE" else "spins"
        print(f"{threads:7d}  {how:7s}  {a:5.1f}  {b:6.1f}  {b / a:5.2f}", flush=True)


if __name__ == "__main__":
    main()
