"""Kill -9 at random moments of a scripted session: nothing missing, nothing doubled.

python -m tests.attacks.sessions FOLDER SEED
"""

import os
import shutil
import signal
import sys
import time
from pathlib import Path

import numpy as np

from prior_reinforce.arm.workspace.workspace import Workspace
from tests.arm.workspace.planar import demonstrations, manifest
from tests.attacks.harness import program

TRIALS, KILLS = 12, 25


def attack(rng, here, asked):
    """Kill one session after another; see `main`."""
    return program("sessions", here, rng.randrange(2**32))


def script():
    """Each step appends exactly one event, so the number of events says where one stands."""
    rng = np.random.default_rng(0)
    steps = []
    for number in range(1, TRIALS + 1):
        if number % 5 == 1:
            goal = rng.uniform([0.82, -0.15], [0.98, 0.15]).tolist()
            carried = number > 10
            steps.append(lambda w, g=goal, c=carried: w.set_goal(g, carry_over=c))
        steps.append(lambda w: w.session().ask())
        error = rng.normal(0, 0.03, 2).round(3).tolist()
        if number % 7 == 0:
            steps.append(lambda w, n=number: w.session().void(n, "ball slipped"))
        else:
            steps.append(lambda w, n=number, e=error: w.session().tell(n, e))
        if number % 6 == 0:
            steps.append(lambda w, n=number - 1, e=error: w.session().amend(n, e))
    return steps


def go_on(folder):
    """Do what is left of the script."""
    workspace = Workspace(folder)
    steps = script()
    for step in steps[len(workspace.events) - 2 :]:  # imported and trained came before
        step(workspace)
    workspace.close()


def in_child(folder):
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            go_on(folder)
            status = 0
        finally:
            os._exit(status)
    return pid


def learn_in_child(folder):
    """Make the workspace in a child too: torch's threads do not survive a fork."""
    pid = os.fork()
    if pid == 0:
        workspace = Workspace.create(folder, manifest())
        workspace.import_demonstrations(demonstrations(), "made up")
        workspace.learn("diffusion,training_steps=3,sampling_steps=2")
        workspace.close()
        os._exit(0)
    assert os.waitpid(pid, 0)[1] == 0


def check(folder, told_before):
    """After a kill: no told trial missing, none doubled, no plan other than its hash."""
    workspace = Workspace(folder)
    told = sum(event.kind in {"told", "voided"} for event in workspace.events)
    assert told >= told_before, "a told trial is missing"
    session = workspace.session()
    trials = [trial for goal in session.goals for trial in session.state.trials_of(goal.number)]
    assert [trial.number for trial in trials] == list(range(1, len(trials) + 1))
    for trial in trials:
        workspace.plan(trial)
    workspace.close()
    return told


def said(folder):
    workspace = Workspace(folder)
    events = [entry.event for entry in workspace.events]
    workspace.close()
    return events


def main(folder, seed):
    # Loaded once: children that load torch themselves are mostly killed while they do.
    import prior_reinforce.adapters.bayesian
    import prior_reinforce.generators.network.denoiser
    import prior_reinforce.generators.network.diffusion
    import prior_reinforce.generators.network.training  # noqa: F401

    learned, reference, killed = folder / "learned", folder / "reference", folder / "killed"
    learn_in_child(learned)
    shutil.copytree(learned, reference)
    started = time.monotonic()
    assert os.waitpid(in_child(reference), 0)[1] == 0
    whole = time.monotonic() - started
    rng = np.random.default_rng(seed)
    kills = 0
    while kills < KILLS:
        if not killed.exists():
            shutil.copytree(learned, killed)
            told = 0
        pid = in_child(killed)
        time.sleep(rng.uniform(0.0, 0.1 * whole))
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            assert status == 0
            assert said(killed) == said(reference)
            shutil.rmtree(killed)
            continue
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        kills += 1
        told = check(killed, told)
    assert os.waitpid(in_child(killed), 0)[1] == 0
    assert said(killed) == said(reference)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
