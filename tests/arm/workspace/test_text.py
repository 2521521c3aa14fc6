"""Where a workspace stands, in words."""

from dataclasses import replace

import pytest
from msgspec import structs

from prior_reinforce.adapters.base import Expectation
from prior_reinforce.arm.workspace import text
from prior_reinforce.arm.workspace.events import Moving
from prior_reinforce.arm.workspace.text import (
    goal_step,
    next_step,
    say_expectation,
    tell_example,
)
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.formats import OutcomeFormat
from tests.arm.workspace.planar import amend, ask, describe, tell


@pytest.mark.slow
def test_status_is_short_and_says_what_is_next(workspace):
    assert "prior-reinforce ask" in describe(workspace)
    tell(workspace, ask(workspace).number, [0.05, 0.0])
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    text = describe(workspace)
    assert "5 cm long" in text
    assert "reached in 2 trials (N = 4 demonstrations + 2 trials = 6)" in text
    assert len(text.splitlines()) <= 12


def test_a_first_trial_that_hits_is_one_trial(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    assert "reached in 1 trial (N = 4 demonstrations + 1 trial = 5)" in describe(workspace)


@pytest.mark.slow
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


def test_advice_is_left_out_where_a_remark_has_given_it_in_whatever_words(workspace):
    for error in (0.2, -0.2, 0.2):
        tell(workspace, ask(workspace).number, [error, 0.0])
    poor = replace(
        ask(workspace), expected=Expectation(0.01, remark="too far: demonstrate near it")
    )
    advice = "\n".join(say_expectation(workspace.standing, poor))
    assert "what would help" in advice
    told = say_expectation(
        workspace.standing, replace(poor, expected=structs.replace(poor.expected, beyond=True))
    )
    assert "what would help" not in "\n".join(told)


@pytest.mark.slow
def test_a_plan_of_before_a_correction_is_named(workspace):
    tell(workspace, ask(workspace).number, [0.30, 0.0])
    ask(workspace)
    assert "before a correction" not in describe(workspace)
    amend(workspace, 1, [0.03, 0.0])
    assert "planned before your correction; if it was not thrown yet, void it" in describe(
        workspace
    )


@pytest.mark.slow
def test_a_goal_far_outside_may_be_refused_and_a_nearer_one_is_named(workspace):
    assert "nearer" not in describe(workspace)
    with pytest.warns(UserWarning, match="outside"):
        workspace.set_goal([0.9, 0.9])
    assert "ask" in describe(workspace).splitlines()[-1]
    assert "if it refuses, a goal nearer" in describe(workspace).splitlines()[-1]
    ask(workspace)  # nothing refused it
    assert "nearer" not in describe(workspace)


def test_how_many_trials_are_to_go_is_left_out_where_nobody_knows(workspace):
    trial = replace(ask(workspace), expected=Expectation(1e-8))
    assert say_expectation(workspace.standing, trial)[0] == "a hit is unlikely"


def test_takes_that_were_recorded_and_not_imported_are_named(tmp_path):
    with Workspace.create(tmp_path / "new", robot="none", action_names=("a", "b")) as workspace:
        assert workspace.status().next.endswith(f"import {workspace.folder} RECORDINGS")
        for number in (2, 10, 11):
            (workspace.folder / "recordings" / str(number)).mkdir(parents=True)
        (workspace.folder / "recordings" / "2" / "take-1.npz").touch()
        (workspace.folder / "recordings" / "10" / "take-1.npz").touch()
        assert workspace.status().next.endswith(f"{workspace.folder / 'recordings' / '10'}")


def test_a_name_of_several_words_is_one_word_where_a_number_is_to_be_typed(workspace):
    form = OutcomeFormat(("landing spot", "how long it rolls"), ("furlong", "beat"), (1.0, 1.0))
    now = workspace.standing
    now = replace(now, manifest=replace(now.manifest, outcome_format=form))
    assert goal_step(now).endswith(" LANDING_SPOT HOW_LONG_IT_ROLLS")
    assert tell_example(now.manifest) == "--error DLANDING_SPOT DHOW_LONG_IT_ROLLS"


def test_while_the_arms_program_runs_it_is_named_and_waited_for(workspace, monkeypatch):
    trial, now = ask(workspace), workspace.standing
    now.state.moves[trial.number] = Moving(trial.number, "trial", "arm.sh", "1-1")
    monkeypatch.setattr(text, "programs_executing", lambda folder: [(71, "arm.sh plan.npz")])
    vars(now)["moving"] = False
    assert next_step(now).startswith("prior-reinforce tell")
    vars(now)["moving"] = True
    said, then = next_step(now).split("; wait for its end, then: ")
    assert "(pid 71: arm.sh plan.npz)" in said
    assert then.startswith("prior-reinforce tell")
