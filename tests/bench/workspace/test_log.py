"""What a workspace's journal adds up to beside its trials."""

import msgspec
import pytest

from prior_reinforce.bench.robots.executors.command import CommandResult
from prior_reinforce.bench.workspace.log import (
    DemonstrationsImported,
    Executed,
    Executing,
    ModelTrained,
    NotExecuted,
    WorkspaceEvent,
    WorkspaceState,
)
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.session.events import Entry
from prior_reinforce.session.trials import Stage
from tests.bench.workspace.planar import ask, demonstrations
from tests.session.test_trials import ASKED, GOAL


def state(*events):
    made = WorkspaceState()
    for number, event in enumerate(events, start=1):
        made.add(Entry(number, event))
    return made


def imported(sha256):
    return DemonstrationsImported(n=4, sha256=sha256, source="made up")


def trained(model, sha256):
    return ModelTrained(model=model, generator="nearest", seed=0, demonstrations_sha256=sha256)


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
        ([], Stage.EXECUTING),
        ([NotExecuted(trial=1)], Stage.ASKED),
        ([Executed(trial=1, outcome="done")], Stage.EXECUTED),
    ],
)
def test_an_execution_says_where_its_trial_stands(then, stage):
    executing = Executing(trial=1, command="arm {plan}", folder="trial-001-1")
    made = state(GOAL, ASKED, executing, *then)
    assert (made.trials[0].stage, made.trials[0].open) == (stage, True)
    assert made.executions == {1: [executing, *then][-1]}


def test_an_execution_of_no_trial_is_refused():
    with pytest.raises(WorkspaceError, match=r"event 2 \(executed\) does not fit.*no trial 1"):
        state(GOAL, Executed(trial=1, outcome="done"))


def test_demonstrations_that_changed_ask_for_learning_anew(workspace):
    other = demonstrations()
    changed = Demonstrations(other.plans * 1.01, other.outcomes_seen, other.format)
    workspace.import_demonstrations(changed, "again")
    with pytest.raises(WorkspaceError, match="other demonstrations"):
        ask(workspace)


@pytest.mark.parametrize("event", [Executed, NotExecuted])
def test_what_a_command_did_goes_through_the_journal(event):
    result = CommandResult(command=("arm",), exit_status=3, seconds=1.5, outcome="aborted")
    ended = event(trial=1, **result.as_json())
    again = msgspec.json.decode(msgspec.json.encode(ended), type=WorkspaceEvent)
    assert type(again) is event
    assert (again, again.outcome, again.exit_status) == (ended, "aborted", 3)


@pytest.mark.parametrize(
    ("generator", "own"),
    [("interpolation,timing=align", None), ("mine:Spline,knots=4", "mine:Spline")],
)
def test_a_training_knows_whose_generator_it_was(generator, own):
    trained = ModelTrained(model="m", generator=generator, seed=0, demonstrations_sha256="d")
    assert trained.own == own
