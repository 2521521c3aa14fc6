"""A small workspace: planar throws, two joints, no robot limits."""

import numpy as np

from prior_reinforce.arm.workspace.execute import note_not_moved
from prior_reinforce.arm.workspace.template import TEMPLATE
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

FORMAT = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.02)


def demonstrations():
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.2], [1.0, 0.2]])
    phase = np.linspace(0.0, 1.0, 24)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    plans = outcomes[:, None, :] * swing[None, :, None]
    return Demonstrations(plans, outcomes, FORMAT)


def manifest(**changes):
    given = {
        "name": "planar",
        "names": '["joint1", "joint2"]',
        "units": '["rad", "rad"]',
        "dt": 0.02,
        "outcome_names": '["x", "y"]',
        "outcome_units": '["m", "m"]',
        "tolerance": 0.015,
        "robot": "none",
    }
    return TEMPLATE.format(**(given | changes))


def reopened(workspace):
    workspace.close()
    return Workspace(workspace.folder)


def ask(workspace, *, arm_did_not_move=False):
    if arm_did_not_move:
        note_not_moved(workspace)
    return workspace.session().ask()


def stage(workspace, number=1):
    state = workspace.state
    return state.stage(state.trial(number))


def describe(workspace):
    return workspace.status().text


def tell(workspace, number, error, **how):
    return workspace.session().tell(number, error, **how)


def amend(workspace, number, error, **how):
    return workspace.session().amend(number, error, **how)


def void(workspace, number, reason):
    return workspace.session().void(number, reason)


def trials(workspace):
    session = workspace.session()
    return [trial for goal in session.goals for trial in session.state.trials_of(goal.number)]


def recordings(folder, outcomes=range(4)):
    folder.mkdir()
    demos = demonstrations()
    for i, plan in enumerate(demos.plans):
        t = np.arange(len(plan)) * 0.02
        np.savez(folder / f"throw_{i}.npz", t=t, q=plan, joint_names=["joint1", "joint2"])
    rows = [f"{i},{x},{y}" for i, (x, y) in enumerate(demos.outcomes_seen) if i in outcomes]
    if rows:
        (folder / "outcomes.csv").write_text("\n".join(["episode,x,y", *rows]))


def trials_in(folder):
    """All trials of a workspace that is open nowhere."""
    with Workspace(folder) as workspace:
        return trials(workspace)


def stage_in(folder):
    """Where its first trial stands."""
    with Workspace(folder) as workspace:
        return stage(workspace)


def events_in(folder):
    """Its journal."""
    with Workspace(folder) as workspace:
        return workspace.events
