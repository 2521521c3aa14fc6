"""How long small commands take, beside `python -c "import numpy, scipy"` in the same run.

    python benchmarks/start_up.py

Each command is a process of its own on a small workspace; commands take turns, so that a change of
the machine's speed meets all of them. Ratios of medians.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import prior_reinforce as pr

CLI = (sys.executable, "-m", "prior_reinforce.cli")
BASE = (sys.executable, "-c", "import numpy, scipy")


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
    """Seconds that a process takes."""
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    repeats = parser.parse_args().repeats
    taken: dict[str, list[float]] = {"import": [], "goal": [], "ask": [], "status": [], "tell": []}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "planar"
        make_workspace(folder)
        for number in range(1, repeats + 1):
            taken["import"].append(timed(*BASE))
            taken["goal"].append(timed(*CLI, "goal", str(folder), "0.9", "0.05"))
            taken["ask"].append(timed(*CLI, "ask", str(folder)))
            taken["status"].append(timed(*CLI, "status", str(folder)))
            taken["tell"].append(
                timed(*CLI, "tell", str(folder), str(number), "--error", "5cm long")
            )
    base = statistics.median(taken["import"])
    print(f"import numpy, scipy: {base * 1000:.0f} ms (median of {repeats})")
    for name, seconds in list(taken.items())[1:]:
        median = statistics.median(seconds)
        print(f"{name:7} {median * 1000:5.0f} ms, {median / base:.1f} times the import")


if __name__ == "__main__":
    main()
