"""What is printed of a trial, word for word."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress

from prior_reinforce.adapters.base import Expectation
from prior_reinforce.commands.live import (
    LiveView,
    drawing_progress,
    fit_progress,
    say,
)
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.base import FitProgress
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Stage
from prior_reinforce.simulation.protocol import GoalTrials
from tests.report.swing_world import told as record

DEMONSTRATIONS = SimpleNamespace(n=6, outcome_format=OutcomeFormat.metres(2))
TIMED = SimpleNamespace(n=5, outcome_format=OutcomeFormat(("x", "arrival"), ("m", "s")))
GOAL = np.array([1.0, 0.1])


def trial(number, condition, error_seen, hit=False, p_hit=None):
    return SimpleNamespace(
        number=number,
        condition=np.array(condition),
        reading=Reading.measured(error_seen) if error_seen else Reading.only(hit, 2),
        hit=hit,
        stage=Stage.TOLD,
        expected=Expectation(p_hit),
    )


TRIALS = (
    trial(1, [1.0, 0.1], [0.05, 0.0]),
    trial(2, [0.95, 0.1], [0.0, 0.0]),
    trial(3, [0.95, 0.08], [0.0, 0.01], hit=True),
)
SOLVED = record([0.05, 0.0], [0.0, 0.02], [0.0, 0.01])
MISSED = record([0.05, 0.0], [0.0, 0.02])


@pytest.fixture
def view():
    console = Console(file=io.StringIO(), width=200)
    return LiveView(console, DEMONSTRATIONS), console.file


@pytest.mark.parametrize(
    ("n", "line"),
    [
        (1, "trial 1  aim at the goal                      seen: 5 cm long"),
        (2, "trial 2  aim moved 5 cm short                 seen: a near miss"),
        (3, "trial 3  aim moved 2 cm right                 seen: HIT"),
    ],
)
def test_a_trial_tells_how_the_aim_moved_and_what_was_seen(view, n, line):
    shown, told = view
    shown.trial(GoalTrials(GOAL, TRIALS[:n], ()))
    assert told.getvalue().strip() == line


def test_a_trial_of_a_later_goal_is_counted_for_its_goal_and_tells_its_chance(view):
    shown, told = view
    first = trial(7, [1.0, 0.1], [0.05, 0.0], p_hit=0.523)
    shown.trial(GoalTrials(GOAL, (first,), ()))
    line = "trial 1  aim at the goal                      hit possible  seen: 5 cm long"
    assert told.getvalue().strip() == line


def test_a_miss_of_which_nothing_else_was_told_is_no_near_miss(view):
    shown, told = view
    shown.trial(GoalTrials(GOAL, (trial(1, [1.0, 0.1], None),), ()))
    assert told.getvalue().strip().endswith("seen: missed")


def test_a_time_is_no_length():
    console = Console(file=io.StringIO(), width=200)
    shown = LiveView(console, TIMED)
    shown.goal(1, 1, GOAL)
    shown.trial(GoalTrials(GOAL, (trial(1, [1.0, 0.1], [0.05, 0.3]),), ()))
    assert console.file.getvalue().splitlines()[1:] == [
        "goal: x 1 m, arrival 0.1 s",
        "  trial 1  aim at the goal                      seen: x +0.05 m, arrival +0.3 s",
    ]


def test_the_papers_count_is_demonstrations_plus_trials(view):
    shown, told = view
    shown.goal(2, 3, GOAL)
    shown.end(GoalTrials(GOAL, TRIALS, ()))
    shown.end(GoalTrials(GOAL, TRIALS[:2], ()))
    shown.summary([SOLVED, MISSED])
    said = told.getvalue()
    assert "goal 2 of 3: 100 cm ahead, 10 cm left" in said
    assert "N = 6 demonstrations + 3 trials = 9" in said
    assert "not reached in 2 trials" in said
    assert "trials by goal: 3, 2+" in said
    assert "1 of 2 goals reached, on average N = 6 demonstrations + 3.0 trials = 9.0" in said


def test_where_no_goal_was_reached_nothing_is_counted(view):
    shown, told = view
    shown.summary([MISSED, MISSED])
    assert told.getvalue() == ""


def test_a_fit_shows_its_loss_and_the_time_left(monkeypatch):
    shown = []
    monkeypatch.setattr(Progress, "update", lambda self, line, **to: shown.append(to))
    with fit_progress(Console(file=io.StringIO())) as progress:
        progress(FitProgress(step=5, n_steps=10, loss=0.25, seconds_left=12.0))
    assert shown[0] == {"total": 10, "completed": 5, "detail": "loss 0.2500, 12 s left"}
    assert shown[-1]["detail"] == "done"


def test_a_fit_that_cannot_be_leaves_no_bar():
    console = Console(file=io.StringIO(), width=80)
    with pytest.raises(WorkspaceError), fit_progress(console):
        raise WorkspaceError("there are no demonstrations")
    assert not console.file.getvalue().strip()


def test_names_and_reasons_are_printed_as_they_are(capsys):
    odd = (
        "no [red]x[/red] [/] :ball: \x1b[2J in a line that is longer than any terminal is wide " * 2
    )
    say(Console(), odd, ("HIT", "bold"))
    assert capsys.readouterr().out == odd.replace("\x1b", "\\x1b") + "HIT\n"


@pytest.mark.parametrize("watched", [True, False])
def test_the_goals_of_a_report_are_counted_where_somebody_watches(watched):
    console = Console(file=io.StringIO(), width=200, force_terminal=watched)
    with drawing_progress(console) as progress:
        progress(1, 5)
        console.file.flush()
    assert ("1 of 5 goals" in console.file.getvalue()) is watched
    if not watched:
        assert console.file.getvalue() == ""
