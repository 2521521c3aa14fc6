import numpy as np
import pytest

from prior_reinforce.arm.console.view import motion_of, state_of
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.workspace.events import Moved, Moving
from prior_reinforce.arm.workspace.execute import _begin, _end
from prior_reinforce.arm.workspace.template import NewWorkspace
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import TrialStateError
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.simulation.tasks import make_task
from tests.arm.workspace.planar import ask, demonstrations, tell, void


@pytest.mark.slow
def test_the_state_is_the_journal_s(workspace):
    ask(workspace)
    tell(workspace, 1, "5cm long, 2cm left")
    ask(workspace)
    void(workspace, 2, "slipped <b>")
    ask(workspace)
    state = state_of(workspace)
    assert state.id == workspace.events[-1].id
    assert state.shown == demonstrations().outcomes_seen.tolist()
    first, second, third = state.trials
    assert (first.stage, first.seen, first.hit) == ("told", "5cm long, 2cm left", False)
    np.testing.assert_allclose(first.outcome, [0.95, 0.07])
    assert (second.stage, second.outcome, second.line) == ("voided", None, "void: slipped <b>")
    assert state.open_trial == third
    assert third.number == 3
    assert third.sha256 == workspace.plan_file(workspace.state.trial(3)).sha256
    assert state.goals[0].told == 1
    assert state.goals[0].tolerance == [0.015, 0.015]


def moved(outcome, reason):
    return Moved(trial=1, motion="approach", outcome=outcome, reason=reason)


def test_what_a_motion_that_was_no_trial_came_to_is_said(workspace):
    ask(workspace)
    _begin(workspace, Moving(1, "approach", "toy", ""))
    assert state_of(workspace).trials[0].warning == "its result was not recorded"
    _end(
        workspace,
        Moved(trial=1, motion="approach", outcome="not_moved", reason="brakes are closed"),
    )
    assert state_of(workspace).trials[0].warning == "nothing moved: brakes are closed"
    _begin(workspace, Moving(1, "approach", "toy", ""))
    _end(workspace, moved("aborted", "overload"))
    assert state_of(workspace).trials[0].warning == "the arm only began to move: overload"


def test_what_was_seen_without_a_number_has_no_place(workspace):
    ask(workspace)
    tell(workspace, 1, None, hit=False)
    assert state_of(workspace).trials[0].outcome is None


_X, _Y, _Z = ("cm", 0, "long"), ("cm", 1, "left"), ("cm", 2, "high")
_TWO_OF_EACH = {"cm": 2, "ms": 20, "deg": np.rad2deg(0.02), "in": 0.02}


@pytest.mark.parametrize(
    ("names", "units", "said"),
    [
        (("x", "y"), ("m", "m"), [_X, _Y]),
        (("y",), ("m",), [_Y]),
        (("angle",), ("rad",), [("deg", 3, "long")]),
        (("a", "b", "at"), ("m", "m", "s"), [_X, _Y, ("ms", 3, "late")]),
        (("distance",), ("in",), [("in", 3, "long")]),
        (("x", "y", "z", "more"), ("m",) * 4, [_X, _Y, _Z, ("cm", 3, None)]),
    ],
)
def test_each_number_of_an_outcome_is_said_in_its_own_words_and_unit(tmp_path, names, units, said):
    made = Workspace.create(
        tmp_path / "w",
        robot="none",
        outcome_names=names,
        outcome_units=units,
        tolerance=[0.02] * len(names),
    )
    with made as workspace:
        found = state_of(workspace).components
    assert [(c.shown, c.axis, (*c.words, None)[0]) for c in found] == said
    for component in found:
        shown = component.factor * component.tolerance
        assert shown == pytest.approx(_TWO_OF_EACH[component.shown])


@pytest.fixture(scope="module")
def panda(tmp_path_factory):
    task = make_task("basketball-v1")
    demos = task.demonstrations("A")
    names, dt = demos.format.names, demos.format.dt
    text = NewWorkspace(robot="panda", action_names=names, dt=dt).manifest("shot")
    with Workspace.create(tmp_path_factory.mktemp("panda") / "w", text) as workspace:
        workspace.import_demonstrations(demos, "A")
        workspace.learn("interpolation")
        workspace.set_goal([0.95, 0.05])
        ask(workspace)
        yield workspace


@pytest.mark.slow
def test_the_motion_is_the_plan_s_with_the_arm_s_places_and_limits(panda):
    motion, plan = motion_of(panda, 1), panda.plan(panda.state.trial(1))
    limits = robot_limits("panda")
    assert motion.times[0] == 0
    assert motion.times[-1] == pytest.approx(plan.times[-1])
    for j, column in enumerate(motion.columns):
        assert column.limits == (limits.lower[j], limits.upper[j])
        assert column.values[-1] == pytest.approx(plan.actions[-1, j], abs=1e-5)
    tip = tool_tip(limits.chain, plan.actions[[0, -1]])
    np.testing.assert_allclose(np.array(motion.links)[[0, -1], -1], tip, atol=1e-4)
    assert len(motion.links[0]) == 9
    assert motion.verdict.startswith("passes")
    assert {line.check for line in motion.checks} >= {"position", "velocity", "jerk"}


def test_without_a_robot_there_is_neither_arm_nor_limit(workspace):
    ask(workspace)
    motion = motion_of(workspace, 1)
    assert motion.links == []
    assert motion.columns[0].limits is None
    assert "no limits checked" in motion.verdict
    with pytest.raises(TrialStateError):
        motion_of(workspace, 2)
