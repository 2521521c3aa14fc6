"""What a workspace's journal adds up to beside its trials, and what comes next."""

from types import SimpleNamespace

import msgspec
import pytest

from prior_reinforce.arm.executing.result import MotionResult
from prior_reinforce.arm.workspace.events import (
    DemonstrationsImported,
    ModelTrained,
    Moved,
    Moving,
    WorkspaceEvent,
)
from prior_reinforce.arm.workspace.state import Standing, WorkspaceState
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.session.events import Entry, Told
from tests.arm.workspace.planar import ask, demonstrations
from tests.session.test_trials import ASKED, GOAL, VOIDED, reading


def state(*events):
    made = WorkspaceState()
    for number, event in enumerate(events, start=1):
        made.add(Entry(number, event))
    return made


def ended(outcome, motion="trial"):
    return Moved(trial=1, motion=motion, outcome=outcome)


def imported(sha256):
    return DemonstrationsImported(n=4, sha256=sha256, source="made up")


def trained(model, sha256):
    return ModelTrained(
        model=model, generator="interpolation", seed=0, demonstrations_sha256=sha256
    )


def test_the_last_training_is_in_use_until_other_demonstrations_come():
    assert (state().training, state().stale, state().in_use) == (None, True, ("", ""))
    events = [imported("a"), trained("m", "a"), trained("n", "a"), trained("m", "a")]
    learned = state(*events)
    assert (learned.training.model, learned.stale) == ("m", False)
    assert list(learned.trainings) == ["n", "m"]
    again = state(*events, imported("b"))
    assert (again.stale, again.in_use) == (True, ("m", "b"))


@pytest.mark.parametrize(
    ("then", "stage"),
    [
        ([], "executing"),
        ([ended("not_moved")], "asked"),
        ([ended("done")], "executed"),
        ([ended("aborted"), VOIDED], "voided"),
    ],
)
def test_an_execution_says_where_its_trial_stands(then, stage):
    began = Moving(1, "trial", "arm", "trial-001-1")
    made = state(GOAL, ASKED, began, *then)
    assert made.stage(made.trials[0]) == stage
    assert made.executions == made.moves == {1: [began, *then][min(len(then), 1)]}


def test_an_execution_of_no_trial_is_refused():
    with pytest.raises(WorkspaceError, match=r"event 2 \(moved\) does not fit.*no trial 1"):
        state(GOAL, ended("done"))


def test_demonstrations_that_changed_ask_for_learning_anew(workspace):
    other = demonstrations()
    changed = Demonstrations(other.plans * 1.01, other.outcomes_seen, other.format)
    workspace.import_demonstrations(changed, "again")
    with pytest.raises(WorkspaceError, match="other demonstrations"):
        ask(workspace)


def test_what_a_command_did_goes_through_the_journal():
    result = MotionResult(exit_status=3, seconds=1.5, outcome="aborted")
    moved = Moved(trial=1, motion="approach", **msgspec.structs.asdict(result))
    again = msgspec.json.decode(msgspec.json.encode(moved), type=WorkspaceEvent)
    assert type(again) is Moved
    assert (again, again.outcome, again.exit_status) == (moved, "aborted", 3)


def test_what_comes_next_is_decided_once(tmp_path, monkeypatch):
    """In order: each event moves the step on."""
    slowly = Moving(1, "approach", "arm", "f")
    events = {
        "import": [],
        "learn": [imported("a")],
        "goal": [trained("m", "a")],
        "ask": [GOAL],
        "execute": [ASKED, slowly, ended("aborted", "approach")],
        "settle": [Moving(1, "trial", "arm", "f"), ended("aborted")],
        "tell": [ended("not_moved"), Moving(1, "trial", "arm", "f"), ended("done")],
        "reached": [Told(trial=1, reading=reading(0.0, 0.0), hit=True)],
    }
    happened = []
    for step, then in events.items():
        happened += then
        now = Standing(tmp_path, SimpleNamespace(), state(*happened))
        assert (now.step, now.moving) == (step, False)
    for moving, step in ((True, "executing"), (False, "settle")):
        monkeypatch.setattr(
            "prior_reinforce.arm.workspace.state.is_executing", lambda _, now=moving: now
        )
        cut = state(imported("a"), trained("m", "a"), GOAL, ASKED, Moving(1, "trial", "arm", "f"))
        assert Standing(tmp_path, SimpleNamespace(), cut).step == step
