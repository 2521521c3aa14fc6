"""How costs grow with a long day at the arm, before and after, on one page.

    OMP_NUM_THREADS=1 python benchmarks/growth.py [--before 169c3a7] [--quick] [--only trials ...]

Processor time against the number of events in a journal (`status`), of trials (one command `ask`;
one reading of the default adapter in one process), of goals (`report` again after one more trial),
of demonstrations (`fit` of `auto`) and of frames (one plan of `diffusion`). "Before" is another
commit, checked out by git into a temporary folder. Each number is taken in a process of its own,
before and after in turn, so that a change of the machine's speed meets both: trust the ratios. The
exponent is the slope of log time against log size, over all sizes. Written to
`benchmarks/growth.md`.
"""

from __future__ import annotations

import argparse
import compileall
import io
import os
import resource
import statistics
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
PAGE = Path(__file__).with_suffix(".md")
REST = (10 - 15 * (t := np.linspace(0, 1, 140)) + 6 * t**2) * t**3


def plans_of(outcomes: np.ndarray, frames: int, joints: int, seed: int = 0) -> np.ndarray:
    """Swings that depend on where they lead, each with its own start, tempo and a hand's noise."""
    rng = np.random.default_rng(seed)
    n, clock = len(outcomes), np.linspace(-0.1, 1.1, frames)
    tempo, start = rng.uniform(0.9, 1.1, (n, 1)), rng.uniform(-0.05, 0.05, (n, 1))
    swing = np.interp((clock - start) * tempo, np.linspace(0, 1, len(REST)), REST)
    reach = outcomes @ rng.normal(size=(outcomes.shape[1], joints)) + rng.normal(size=joints)
    return reach[:, None] * swing[..., None] + rng.normal(scale=1e-3, size=(n, frames, joints))


def demonstrations(n: int = 6, frames: int = 140, joints: int = 7) -> Any:
    import prior_reinforce as pr  # public names, which other commits have as well

    outcomes = np.random.default_rng(1).uniform([0.7, -0.3], [1.1, 0.3], (n, 2))
    names = tuple(f"joint{i + 1}" for i in range(joints))
    form = pr.PlanFormat(names, ("rad",) * joints, 2.8 / frames)
    return pr.Demonstrations(plans_of(outcomes, frames, joints), outcomes, form)


def command(*words: object) -> float:
    """Processor time of one command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    program = [sys.executable, "-m", "prior_reinforce.cli", *map(str, words)]
    subprocess.run(program, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def processor(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def day(folder: Path, trials: int, adapter: str, per_goal: int = 5, joints: int = 2) -> Any:
    """A workspace after so many told trials, each goal's last one a hit; it is still open."""
    import prior_reinforce as pr

    shown, rng = demonstrations(frames=24, joints=joints), np.random.default_rng(2)
    form = shown.format
    workspace = pr.Workspace.create(folder, robot="none", action_names=form.names, dt=form.dt)
    workspace.import_demonstrations(shown, "made up")
    workspace.learn("interpolation")
    for number in range(trials):
        at = number % per_goal
        if at == 0:
            workspace.set_goal(rng.uniform([0.75, -0.25], [1.05, 0.25]), adapter=adapter)
            session = workspace.session()
        trial = session.ask()
        off = rng.normal(0, 0.03 / (1 + at), 2) if at < per_goal - 1 else [0.003, 0.002]
        session.tell(trial.number, off)
    return workspace


def events(n: int, folder: Path) -> float:
    day(folder / "w", n // 2, "proportional", per_goal=n).close()
    return command("status", folder / "w")


def asks(n: int, folder: Path) -> float:
    workspace = day(folder / "w", n, "bayes", per_goal=3)
    workspace.set_goal([0.9, 0.05], adapter="bayes")
    workspace.close()
    return command("ask", folder / "w")


def readings(n: int, _: Path) -> float:
    """One reading, a proposal and P(hit), the median of three, with n trials before."""
    import prior_reinforce as pr

    rng, adapter = np.random.default_rng(3), pr.make_adapter("bayes")
    adapter.start(demonstrations())
    taken = []
    for number in range(n + 3):
        if number % 3 == 0:
            goal = rng.uniform([0.75, -0.25], [1.05, 0.25])
        condition = goal + rng.normal(0, 0.02, 2)
        off = condition + np.array([0.03, -0.02]) + rng.normal(0, 0.01, 2) - goal
        reading = pr.Reading.by_eye(np.round(off, 2), hit=False)

        def one(condition: Any = condition, goal: Any = goal, reading: Any = reading) -> None:
            adapter.observe(condition, goal, reading)
            adapter.expect(adapter.propose(goal), goal, 0.015)

        if number < n:
            one()
        else:
            taken.append(processor(one))
    return statistics.median(taken)


def goals(n: int, folder: Path) -> float:
    with day(folder / "w", 5 * n, "proportional", joints=7) as workspace:
        workspace.report()
        workspace.set_goal([0.9, 0.05], adapter="proportional")
        session = workspace.session()
        session.tell(session.ask().number, [0.03, 0.0])
    return command("report", folder / "w")


def fits(n: int, _: Path) -> float:
    import scipy.interpolate
    import scipy.optimize  # noqa: F401

    import prior_reinforce as pr

    shown, generator = demonstrations(n), pr.make_generator("auto")
    return processor(lambda: generator.fit(shown, seed=0))


def frames(n: int, _: Path) -> float:
    import prior_reinforce as pr

    generator = pr.make_generator("diffusion,training_steps=1").fit(
        demonstrations(frames=n), seed=0
    )
    place = np.array([[0.9, 0.05]])
    generator.generate(place)
    return statistics.median(processor(lambda: generator.generate(place)) for _ in range(5))


CASES: dict[str, tuple[Callable[[int, Path], float], str, tuple[int, ...], tuple[int, ...]]] = {
    "events": (events, "`status`, events in the journal", (250, 1000, 4000), (100, 400)),
    "asks": (asks, "`ask`, trials before it", (6, 24, 96), (6, 24)),
    "trials": (readings, "one reading of `bayes`, trials before it", (10, 30, 100, 200), (10, 30)),
    "goals": (goals, "`report` again, goals of five trials", (2, 8, 32), (2, 4)),
    "demonstrations": (fits, "`fit` of `auto`, demonstrations", (6, 20, 60, 200), (6, 20)),
    "frames": (frames, "one plan of `diffusion`, frames", (140, 500, 1000, 2000), (140, 500)),
}
"""What is measured, what the page calls it, its sizes, and those of --quick."""


def measured(tree: Path, case: str, size: int, limit: float) -> float:
    """Seconds of processor time, in a process of its own; nan beyond the limit."""
    program = [sys.executable, __file__, "--case", case, str(size)]
    path = os.pathsep.join((str(tree / "src"), str(tree / "reproduction" / "src")))
    environment = os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
    run = [*program]
    try:
        out = subprocess.run(
            run, check=True, capture_output=True, text=True, env=environment, timeout=limit
        )
    except subprocess.TimeoutExpired:
        return float("nan")
    return float(out.stdout.split()[-1])


def exponent(sizes: np.ndarray, seconds: np.ndarray) -> str:
    known = np.isfinite(seconds)
    if known.sum() < 2:
        return "-"
    return f"{np.polyfit(np.log(sizes[known]), np.log(seconds[known]), 1)[0]:.1f}"


def said(seconds: float) -> str:
    if not np.isfinite(seconds):
        return "over the limit"
    return f"{seconds:.2g} s" if seconds >= 1 else f"{seconds * 1000:.3g} ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--before", default="169c3a7", help="commit that is compared with")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="small sizes, to try it")
    parser.add_argument("--only", nargs="+", choices=[*CASES], default=[*CASES])
    parser.add_argument("--limit", type=float, default=900, help="seconds for one measurement")
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        name, size = arguments.case
        with tempfile.TemporaryDirectory() as folder:
            print(CASES[name][0](int(size), Path(folder)))
        return
    lines = [
        f"Processor time before ({arguments.before}) and after, by `benchmarks/growth.py`; medians "
        f"of {arguments.repeats}, in turn, load {os.getloadavg()[0]:.1f} when it began. Over the "
        f"limit: longer than {arguments.limit:g} s, the making of that day included.\n",
        "| | size | before | after | before / after |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        archive = ["git", "-C", str(ROOT), "archive", arguments.before]
        content = subprocess.run(archive, check=True, capture_output=True).stdout
        with tarfile.open(fileobj=io.BytesIO(content)) as files:
            files.extractall(folder, filter="data")
        trees = (Path(folder), ROOT)
        for tree in trees:  # else the first start of one pays for it
            compileall.compile_dir(tree / "src", quiet=2)
        for case in arguments.only:
            _, title, full, quick = CASES[case]
            sizes = np.array(quick if arguments.quick else full)
            table = np.full((2, len(sizes)), np.nan)
            for i, size in enumerate(sizes):
                taken: list[list[float]] = [[], []]
                for _ in range(arguments.repeats):
                    for which, tree in enumerate(trees):
                        if not (taken[which] and np.isnan(taken[which][-1])):
                            taken[which].append(measured(tree, case, int(size), arguments.limit))
                table[:, i] = [statistics.median(each) for each in taken]
                ratio = table[0, i] / table[1, i]
                more = f"{ratio:.3g}" if np.isfinite(ratio) else "-"
                lines.append(
                    f"| {title} | {size:,} | {said(table[0, i])} | {said(table[1, i])} | {more} |"
                )
                print(lines[-1], flush=True)
            before, after = (exponent(sizes, row) for row in table)
            lines.append(f"| | exponent | {before} | {after} | |")
            print(lines[-1], flush=True)
    if not arguments.quick:
        PAGE.write_text("# How costs grow\n\n" + "\n".join(lines) + "\n", encoding="utf-8")
        print(f"wrote {PAGE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
