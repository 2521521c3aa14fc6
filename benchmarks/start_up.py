"""How much processor time small commands take, beside imports of numpy and scipy in the same run.

    python benchmarks/start_up.py

Each command is a process of its own on a small workspace; commands take turns, so that a change of
the machine's speed meets all of them. Ratios of medians of user and system time. SciPy loads its
parts when they are used: `import scipy` alone is next to nothing, and `ask` fits splines.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

import prior_reinforce as pr

CLI = (sys.executable, "-m", "prior_reinforce.cli")
BASES = {
    code: (sys.executable, "-c", code)
    for code in ("import numpy, scipy", "import numpy, scipy.interpolate")
}


def make_workspace(folder: Path) -> None:
    """Four planar throws, and a model of them."""
    flags = ["--action-names", "a", "b", "--dt", "0.02", "--robot", "none"]
    subprocess.run([*CLI, "new", str(folder), *flags], check=True, capture_output=True)
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.2], [1.0, 0.2]])
    swing = np.sin(np.linspace(0, np.pi / 2, 24)) ** 2
    plans = outcomes[:, None, :] * swing[None, :, None]
    workspace = pr.Workspace(folder)
    demonstrations = pr.Demonstrations(plans, outcomes, workspace.manifest.format)
    workspace.import_demonstrations(demonstrations, "made up")
    workspace.learn("interpolation")
    workspace.close()


def timed(*command: str) -> float:
    """Seconds of processor time that a process takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    repeats = parser.parse_args().repeats
    taken: dict[str, list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "planar"
        make_workspace(folder)
        for number in range(1, repeats + 1):
            commands = {
                "goal": ("0.9", "0.05"),
                "ask": (),
                "status": (),
                "tell": (str(number), "--error", "5cm long"),
            }
            for name, base in BASES.items():
                taken[name].append(timed(*base))
            for name, more in commands.items():
                taken[name].append(timed(*CLI, name, str(folder), *more))
    for name, seconds in taken.items():
        median = statistics.median(seconds)
        ratios = [f"{median / statistics.median(taken[base]):.1f} times {base}" for base in BASES]
        print(f"{name:32} {median * 1000:5.0f} ms, {', '.join(ratios)}")


if __name__ == "__main__":
    main()
