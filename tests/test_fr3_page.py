"""The FR3's page as a reader runs it: from an empty folder to a hit, through libfranka's client."""

import re
import shlex

import numpy as np
import pytest

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.plans.interpolation import interpolate
from prior_reinforce.simulation.tasks import make_task
from simulators import served
from simulators.__main__ import main as simulate_arm
from simulators.stepped import SteppedTask
from tests.test_documentation import blocks

MOST_TRIALS = 4


@pytest.mark.slow
def test_the_sequence_of_the_page_ends_in_a_hit(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    prepare, simulate, throw = blocks("fr3.md", "sh")
    (serve,) = simulate.splitlines()
    ask, tell = (shlex.split(line, comments=True)[1:] for line in throw.splitlines())
    with served.fr3(*shlex.split(serve)[4:]) as robot:
        for line in prepare.replace("127.0.77.1", robot.host).splitlines():
            words = shlex.split(line, comments=True)
            if words[:3] == ["python", "-m", "simulators"]:
                assert simulate_arm(words[3:]) == 0
            elif words[0] != "pip":
                status, _, err = run(*words[1:])
                assert status == 0, err
        task = make_task("basketball-fr3")
        for number in range(1, MOST_TRIALS + 1):
            status, _, err = run(*ask, "--yes")
            assert status == 0, err
            said = robot.said()
            with Workspace("hoop") as workspace:
                plan = workspace.plan(workspace.state.trial(number)).actions
                assert workspace.state.executions[number].tracking_max["rad"] < 0.005
            landed = np.array(re.findall(r"(-?[\d.]+) m\b", said), float)
            # Without libfranka: the same set points, in the physics that the arm steps. Where the
            # ball leaves the spoon, 1e-5 rad may be 0.8 mm, as between that and `task.rollout`.
            alone = SteppedTask(task, plan[0])
            alone.begin()
            for target in interpolate(plan, task.format.dt, hold_after=task.lead_out).q:
                alone.step(target)
            assert landed == pytest.approx(alone.end().outcome, abs=1e-4)
            seen = re.search(r"by eye, of --goal: (.*)", said)[1]
            if hit := seen.endswith(", a hit"):
                assert run("tell", "hoop", number, "--hit")[0] == 0
                break
            assert run(*tell[:2], number, "--error", seen)[0] == 0
        assert hit
        assert f"reached in {number} trial" in run("status", "hoop")[1]
