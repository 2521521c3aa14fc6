"""First paint of the console's page with a long journal, and how soon all tabs hear of an event.

    python benchmarks/console.py [--trials 500] [--tabs 5] [--events 20]

Needs Chromium (`apt-get install chromium`) and the development extras. Printed: milliseconds from
the request to the browser's first contentful paint and to the whole history on the page, median of
five loads; and from the moment at which another program's event is durable to the moment at which
the last tab shows it, median and worst.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

CHROMIUM = "/usr/bin/chromium"


def make_workspace(folder: Path, trials: int) -> None:
    """A workspace of made-up planar throws, and so many told trials."""
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.2], [1.0, 0.2]])
    swing = (1 - np.cos(np.linspace(0, np.pi, 24))) / 2
    plans = outcomes[:, None, :] * swing[None, :, None]
    form = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.02)
    made = Workspace.create(folder, robot="none", action_names=form.names, dt=form.dt)
    rng = np.random.default_rng(0)
    with made as workspace:
        workspace.import_demonstrations(Demonstrations(plans, outcomes, form), "made up")
        workspace.learn("interpolation")
        session = workspace.session()
        for number in range(trials):
            if number % 5 == 0:
                place = rng.uniform([0.8, -0.2], [1.0, 0.2])
                workspace.set_goal(place, adapter="proportional")
            trial = session.ask()
            session.tell(trial.number, rng.normal(0, 0.03, 2), hit=False)


def serve(folder: Path) -> tuple[subprocess.Popen[bytes], str]:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    program = [sys.executable, "-m", "prior_reinforce.cli", "console", str(folder)]
    served = subprocess.Popen([*program, "--port", str(port)], stdout=subprocess.PIPE)
    assert served.stdout is not None
    link = served.stdout.readline().decode().rsplit(" ", 1)[1].strip()
    return served, link


def load(page: Page, link: str) -> tuple[float, float]:
    """Milliseconds to the first paint, and to the history."""
    page.goto("about:blank")
    page.goto(link)
    page.wait_for_selector("#history li")
    whole = float(page.evaluate("performance.now()"))
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    return float(paint), whole


def latency(workspace: Workspace, pages: list[Page]) -> float:
    """Milliseconds from a durable event to the last tab that shows it."""
    seen = workspace.events[-1].id
    for page in pages:
        page.evaluate(
            """id => { window.shown = new Promise((done) => {
              const look = () => S.id > id ? done(Date.now()) : setTimeout(look, 1);
              look(); }); }""",
            seen,
        )
    workspace.set_goal([0.9, 0.0], adapter="proportional")
    durable = time.time() * 1000
    return float(max(page.evaluate("window.shown") for page in pages)) - durable


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--trials", type=int, default=500)
    parser.add_argument("--tabs", type=int, default=5)
    parser.add_argument("--events", type=int, default=20)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        place = Path(folder) / "w"
        make_workspace(place, arguments.trials)
        served, link = serve(place)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            pages = [browser.new_context().new_page() for _ in range(arguments.tabs)]
            loads = np.array([load(pages[0], link) for _ in range(5)])
            paint, whole = np.median(loads, axis=0)
            print(
                f"{arguments.trials} trials: first paint {paint:.0f} ms, all of it {whole:.0f} ms"
            )
            for page in pages:
                load(page, link)
            with Workspace(place) as workspace:
                times = np.array([latency(workspace, pages) for _ in range(arguments.events)])
            print(
                f"{arguments.tabs} tabs: an event is shown after {np.median(times):.0f} ms, "
                f"worst {times.max():.0f} ms"
            )
        finally:
            browser.close()
            served.terminate()
            served.wait()


if __name__ == "__main__":
    main()
