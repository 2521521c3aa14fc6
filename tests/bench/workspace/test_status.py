"""Where a workspace stands, in words."""

from types import SimpleNamespace

import numpy as np
import pytest

from prior_reinforce.bench.robots.gate import GateSettings
from prior_reinforce.bench.robots.report import LimitReport
from prior_reinforce.bench.workspace.status import ask_to_move, describe
from tests.bench.workspace.planar import amend, ask, tell


def test_status_is_short_and_says_what_is_next(workspace):
    assert "prior-reinforce ask" in describe(workspace)
    tell(workspace, ask(workspace).number, [0.05, 0.0])
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    text = describe(workspace)
    assert "5 cm long" in text
    assert "reached in 2 trials (N = 4 demonstrations + 2 = 6)" in text
    assert len(text.splitlines()) <= 12


def test_a_first_trial_that_hits_is_one_trial(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    assert "reached in 1 trial (N = 4 demonstrations + 1 = 5)" in describe(workspace)


def test_trials_that_are_not_shown_are_counted(workspace):
    for error in (0.05, 0.04, 0.03):
        tell(workspace, ask(workspace).number, [error, 0.0])
    assert "more" not in describe(workspace)
    for error in (0.02, 0.02):
        tell(workspace, ask(workspace).number, [error, 0.0])
    text = describe(workspace)
    assert "2 more" in text
    assert "trial 3" in text
    assert "trial 2" not in text


def test_a_plan_of_before_a_correction_is_named(workspace):
    tell(workspace, ask(workspace).number, [0.30, 0.0])
    ask(workspace)
    assert "before a correction" not in describe(workspace)
    amend(workspace, 1, [0.03, 0.0])
    assert "planned before a correction: unless it was thrown, void it" in describe(workspace)


def test_a_goal_far_outside_may_be_refused_and_a_nearer_one_is_named(workspace):
    assert "nearer" not in describe(workspace)
    with pytest.warns(UserWarning, match="outside"):
        workspace.set_goal([0.9, 0.9])
    assert "ask" in describe(workspace).splitlines()[-1]
    assert "if it refuses, a goal nearer" in describe(workspace).splitlines()[-1]
    ask(workspace)  # nothing refused it
    assert "nearer" not in describe(workspace)


@pytest.mark.parametrize("gated", [True, False])
def test_the_box_for_the_tool_tip_holds_for_a_plan_and_its_approach_where_the_gate_saw_them(gated):
    gate = GateSettings(box_low=(0.2, -0.6, 0.05), box_high=(0.9, 0.6, 1.2))
    verdict = LimitReport("fr3", "any", "", ()) if gated else None
    workspace = SimpleNamespace(
        manifest=SimpleNamespace(gate=gate),
        plan=lambda trial: SimpleNamespace(actions=np.zeros((2, 7))),
        gate=lambda frames: verdict,
    )
    trial = SimpleNamespace(number=1)
    said = "the table, but for the tool tip; is" if gated else "the table; is"
    assert said in ask_to_move(workspace, trial, where=True)
    assert said in ask_to_move(workspace, trial, motion="approach", where=True)
