"""What a person or a tracker's table can say of a trial, and what cannot be understood."""

import numpy as np
import pytest

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from tests.arm.workspace.planar import FORMAT, events_in, manifest, trials_in


@pytest.fixture
def line(tmp_path, monkeypatch):
    """A task of one outcome in cm, learned, whose first trial waits; its name."""
    monkeypatch.chdir(tmp_path)
    outcomes = np.array([[80.0], [90.0], [100.0], [110.0]])
    plans = outcomes[:, None] * np.linspace(0.0, 0.01, 24)[:, None] * np.ones(2)
    form = OutcomeFormat(("distance",), ("cm",))
    of_task = {"outcome_names": '["distance"]', "outcome_units": '["cm"]', "tolerance": 1.5}
    with Workspace.create(tmp_path / "line", manifest(**of_task)) as workspace:
        demonstrations = Demonstrations(plans, outcomes, FORMAT, outcome_format=form)
        workspace.import_demonstrations(demonstrations, "made up")
        workspace.learn("interpolation")
        workspace.set_goal([95.0])
        workspace.session().ask()
    return "line"


def asked(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        (("--error", "0.05", "-0.02"), [0.05, -0.02]),
        (("--error", "-0.05", "-0.02"), [-0.05, -0.02]),
        (("--error=-0.05 0.02",), [-0.05, 0.02]),
        (("--error", "-.05,0.02"), [-0.05, 0.02]),
        (("--error", "-1e-2", "0"), [-0.01, 0.0]),
        (("--error", "5cm short and 2 cm right"), [-0.05, -0.02]),
        (("--error", "120cm long"), [1.2, 0.0]),
        (("--error", "1.9512345", "0.0123456"), [1.9512345, 0.0123456]),  # as far as was shown
        (("--error", "hit"), None),
        (("--error", "0"), [0.0, 0.0]),
        (("--outcome", "0.9", "-0.1"), [0.0, -0.15]),
        (("--hit",), None),
        (("--error", "2cm long", "--hit"), [0.02, 0.0]),
        (("5 cm long, 2 cm left",), [0.05, 0.02]),
        (("5", "cm", "long"), [0.05, 0.0]),
        (("0.05", "-0.02"), [0.05, -0.02]),
        (("0,05", "-0,02"), [0.05, -0.02]),
        (("-0.05", "-0.02"), [-0.05, -0.02]),
        (("hit",), None),
        (("long",), [0.05, 0.0]),
    ],
)
def test_an_error_can_be_told_in_many_ways(run, folder, said, seen):
    asked(run, folder)
    assert run("tell", folder, 1, *said)[0] == 0
    (trial,) = trials_in(folder)
    assert (None if trial.error_seen is None else [*trial.error_seen]) == pytest.approx(seen)
    assert trial.hit == ("hit" in said[-1] or np.linalg.norm(seen) <= 0.015)


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ((), "say what was seen"),
        (("2cm long", "--error", "2cm long"), "say what was seen"),
        (("0.05+-0.01", "0.02"), "give all or none"),
        (("0.05+-0.01",), "needs 2 numbers"),
        (("0.05+-x", "0.02"), "cannot read"),
        (("5+-1", "0+-1"), "looks like centimetres"),
        (("--error", "5", "-2"), "looks like centimetres"),
        (("--outcome", "92", "10"), "looks like centimetres"),
        (("--outcome", "0.05", "-0.02"), "looks like an error"),
        (("0.91", "0.04"), "looks like where the object ended"),
        (("--error", "0.05"), "needs 2 numbers"),
        (("--error", "nan", "0"), "void the trial"),
        (("--error", "0.05 long"), "say m, cm or mm"),
        (("--error", "5cm wide"), "write a length and one of long, short"),
        (("--error", "50m long"), "say it again, in cm"),
        (("--error", "0.05", "0", "--outcome", "0.9", "0"), "--error or --outcome"),
        (("--outcome", "0.9"), "needs 2 numbers"),
        (("--outcome", "0.9+-0.1", "0.1"), "give all or none"),
        (("--outcome", "there"), "cannot read 'there'"),
        (("somewhere",), '"somewhere" says nothing of where it went; say lost'),
        (("--hit", "--miss"), "drop one of them"),
        (("hit", "--miss"), "say one of them"),
        (("miss", "--hit"), "say one of them"),
        (("lost", "--hit"), "say one of them"),
    ],
)
def test_what_cannot_be_told_is_one_line_and_changes_nothing(run, folder, said, remedy):
    asked(run, folder)
    before = events_in(folder)
    status, out, err = run("tell", folder, 1, *said)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert events_in(folder) == before


@pytest.mark.parametrize(
    ("said", "low", "high", "sd"),
    [
        (("5 +- 0.5 cm long",), [0.05, -0.01], [0.05, 0.01], [0.005, 0.0]),
        (("0.05+-0.003", "-0.02+-0.001"), [0.05, -0.02], [0.05, -0.02], [0.003, 0.001]),
        (("0.05", "+-", "0.003,", "0", "±", "0.001"), [0.05, 0.0], [0.05, 0.0], [0.003, 0.001]),
        (("long, somewhere",), [0.01, -np.inf], [np.inf, np.inf], [0.0, 0.0]),
        (("0 long, somewhere",), [-0.01, -np.inf], [0.01, np.inf], [0.0, 0.0]),
        (("--miss",), [-np.inf] * 2, [np.inf] * 2, [0.0, 0.0]),
    ],
)
def test_the_journal_keeps_what_was_said(run, folder, said, low, high, sd):
    asked(run, folder)
    assert run("tell", folder, 1, *said)[0] == 0
    (trial,) = trials_in(folder)
    np.testing.assert_allclose(trial.reading.low, low)
    np.testing.assert_allclose(trial.reading.high, high)
    np.testing.assert_allclose(trial.reading.sd, sd)
    assert not trial.hit


def test_a_direction_is_said_back_as_it_was_said(run, folder):
    asked(run, folder)
    assert "trial 1: long, somewhere\n" in run("tell", folder, 1, "long, somewhere")[1]
    assert "long, somewhere" in run("status", folder)[1]


@pytest.mark.parametrize(
    ("place", "seen"),
    [
        (("95cm", "3cm"), [0.05, -0.02]),
        (("95cm 3cm",), [0.05, -0.02]),
        (("95cm ahead, 3cm left",), [0.05, -0.02]),
        (("190cm", "5cm"), [1.0, 0.0]),
    ],
)
def test_where_it_ended_is_read_as_a_goal_is(run, folder, place, seen):
    asked(run, folder)
    assert run("tell", folder, 1, "--outcome", *place)[0] == 0
    np.testing.assert_allclose(trials_in(folder)[0].error_seen, seen, atol=1e-12)


def test_where_it_ended_may_be_measured(run, folder):
    asked(run, folder)
    assert run("tell", folder, 1, "--outcome", "95cm 3cm +- 2mm")[0] == 0
    np.testing.assert_allclose(trials_in(folder)[0].reading.sd, [0.002, 0.002])


@pytest.mark.parametrize(
    ("number", "what"),
    [
        (1, "1 may be what was seen: prior-reinforce tell line 1 1; or the trial: prior-reinforce"),
        (5, "there is no trial 5; if 5 is what was seen: prior-reinforce tell line 1 5\n"),
        (-5, "there is no trial -5; if -5 is what was seen: prior-reinforce tell line 1 -5\n"),
    ],
)
def test_a_number_alone_may_be_the_trial_or_what_was_seen(run, line, number, what):
    status, _, err = run("tell", line, number)
    assert status == 2
    assert what in err
    assert run("tell", line, 1, number)[0] == 0


def test_a_trial_that_was_voided_by_mistake_is_told_again(run, line):
    run("tell", line, 1, "5cm long")
    assert "amend it to tell it again" in run("void", line, 1)[1]
    assert "trial 1, corrected: 5cm long" in run("amend", line, 1, "5cm long")[1]
    run("ask", line)
    assert "amend" not in run("void", line, 2)[1]


@pytest.mark.parametrize(
    ("said", "understood"),
    [
        ("3 inches long", "; understood as 7.6 cm long\n"),
        ("too far by 0.1 m and a bit right", "; understood as 10 cm long, right\n"),
        ("0.05 m long", "; understood as 5 cm long\n"),
        ("5cm long & 2cm left", ": 5cm long & 2cm left\n"),
        ("long", ": long\n"),
    ],
)
def test_words_that_say_other_numbers_are_said_back_in_centimetres(run, folder, said, understood):
    asked(run, folder)
    assert understood in run("tell", folder, 1, said)[1]


@pytest.mark.parametrize(("said", "doubted"), [("hit 5cm long", True), ("hit, 2cm long", False)])
def test_a_hit_that_was_told_to_lie_outside_the_tolerance_is_said_to_be_one(
    run, folder, said, doubted
):
    asked(run, folder)
    assert ("not within 1.5 cm" in run("tell", folder, 1, said)[1]) == doubted
    (trial,) = trials_in(folder)
    assert trial.hit


def test_where_it_ended_may_have_a_spread_behind_each_number(run, folder):
    asked(run, folder)
    status, _, err = run("tell", folder, 1, "--outcome", "0.92+-0.002", "0.05")
    assert status == 2
    assert "give all or none" in err
    assert run("tell", folder, 1, "--outcome", "0.92+-0.002", "0.05+-0.003")[0] == 0
    (trial,) = trials_in(folder)
    np.testing.assert_allclose(trial.error_seen, [0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(trial.reading.sd, [0.002, 0.003])


@pytest.mark.filterwarnings("ignore:goal 0.9 cm ahead")
def test_numbers_that_take_the_unit_of_the_last_are_said_to(run, folder):
    spoken = "numbers without a unit are centimetres"
    assert spoken in run("goal", folder, "92", "5cm")[1]
    assert "say 0.9cm or 0.9m" in run("goal", folder, "0.9", "5cm")[2]
    assert spoken not in run("goal", folder, "0.9", "0.05")[1]
    assert spoken not in run("goal", folder, "92cm ahead, 5 left")[1]
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    assert spoken in run("tell", folder, 1, "--outcome", "92", "5cm")[1]
