"""What programs are told: each record keeps to its schema, with nothing more in it."""

import csv
import io
import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from prior_reinforce.arm.workspace.view import (
    AdviceView,
    AskView,
    InspectView,
    StatusView,
    TrialView,
)
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import advice
from tests.arm.workspace.planar import recordings


@pytest.fixture
def afternoon(run, folder):
    """A goal that is reached, one that is worked on, a void, a direction and a correction."""
    run("goal", folder, "0.9", "0.05")
    for told in (("tell", "5cm long"), ("void",), ("tell", "long, somewhere"), ("tell", "hit")):
        run("ask", folder)
        run(told[0], folder, *told[1:])
    run("amend", folder, 1, "0.04", "-0.01")
    run("goal", folder, "1.0", "-0.05", "--new-hardware", "another ball")
    return folder


def test_every_json_is_as_its_schema_says(run, afternoon, tmp_path, monkeypatch):
    monkeypatch.setattr(advice, "_ACROSS", 4)  # goals a side; all 25 take ten seconds
    recordings(tmp_path / "more")
    for args, kind in [
        (("status", afternoon), StatusView),
        (("ask", afternoon), AskView),
        (("trials", afternoon), list[TrialView]),
        (("advise", afternoon), AdviceView),
        (("import", afternoon, "more", "--inspect"), InspectView),
    ]:
        status, out, err = run(*args, "--json")
        assert (status, err) == (0, "")
        record = msgspec.json.decode(out, type=kind)  # unknown and missing fields are errors
        assert json.loads(msgspec.json.encode(record)) == json.loads(out)


def test_the_schema_is_stable():
    """A field that goes or changes its type breaks other people's programs: add, never rename."""
    _, kinds = msgspec.json.schema_components(
        [StatusView, AskView, TrialView, AdviceView, InspectView]
    )
    fields = {name: set(kind["properties"]) for name, kind in kinds.items()}
    assert {"number", "goal", "stage", "condition", "error", "hit", "p_hit"} < fields["TrialView"]
    assert {"task", "goals", "open_trial", "solved", "stale", "next"} < fields["StatusView"]
    assert {"trial", "gate", "first_pose", "execution"} < fields["AskView"]
    assert {n: len(f) for n, f in fields.items()} == {
        "StatusView": 25,
        "GoalView": 9,
        "TrialView": 24,
        "AskView": 6,
        "AdviceView": 11,
        "InspectView": 9,
    }


def test_trials_say_what_was_told(run, afternoon):
    first, void, direction, hit = json.loads(run("trials", afternoon, "--json")[1])
    assert (first["error"], first["hit"], first["stage"]) == ([0.04, -0.01], False, "told")
    assert first["asked"] < first["told"]
    assert (void["reason"], void["error"], void["hit"], void["told"]) == (None, None, None, None)
    assert direction["said"] == "long, somewhere"
    assert direction["error"][0] > 0
    assert [trial["vague"] for trial in (first, void, direction, hit)] == [
        False,
        False,
        True,
        False,
    ]
    assert hit["hit"] is True
    assert (hit["error"], hit["outcome"]) == (None, None)  # nobody said where in the goal
    assert run("trials", afternoon)[1].splitlines()[3].endswith(": reached (hit)")


@pytest.mark.parametrize(("told", "hit"), [("miss", False), ("lost", False), ("hit", True)])
def test_what_was_told_without_a_place_has_no_error_and_no_outcome(run, folder, told, hit):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, told)
    (trial,) = json.loads(run("trials", folder, "--json")[1])
    assert (trial["hit"], trial["error"], trial["outcome"]) == (hit, None, None)
    (row,) = csv.DictReader(io.StringIO(run("trials", folder, "--csv")[1]))
    assert (row["error x [m]"], row["error y [m]"], row["hit"]) == ("", "", str(hit))


def test_status_has_all_goals(run, afternoon):
    status = json.loads(run("status", afternoon, "--json")[1])
    assert [goal["reached_after"] for goal in status["goals"]] == [3, None]
    assert [goal["new_hardware"] for goal in status["goals"]] == [None, "another ball"]
    assert status["solved"] is False
    assert status["open_trial"] is None
    text = run("status", afternoon)[1]
    assert status["text"] + "\n" == text
    assert "goal 1          90 cm ahead, 5 cm left: reached in 3 trials" in text
    assert "goal 2          100 cm ahead, 5 cm right: not reached yet" in text


def test_what_a_goal_cost_stays_what_its_own_model_learned_from(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, "hit")
    with Workspace(folder) as workspace:
        shown = workspace.demonstrations
        workspace.import_demonstrations(shown.only([0, 1, 2]), "three of them")
        workspace.learn("interpolation")
    assert "N = 4 demonstrations + 1 trial = 5" in run("status", folder)[1]
    run("goal", folder, "0.9", "0.1")
    run("ask", folder)
    run("tell", folder, "hit")
    goals = json.loads(run("status", folder, "--json")[1])["goals"]
    assert [goal["demonstrations"] for goal in goals] == [4, 3]
    page = Path(run("report", folder)[1].split()[-1]).read_text()
    assert "4, 3" in page


def test_demonstrations_that_are_gone_are_named_everywhere_with_what_brings_them_back(
    run, folder, tmp_path
):
    run("goal", folder, "0.9", "0.05")
    (path,) = Path(folder, "demonstrations").iterdir()
    content, remedy = path.read_bytes(), f"prior-reinforce import {folder} RECORDINGS"
    for left, what in ((None, "is missing"), (content[:100], "is not what was imported")):
        path.unlink() if left is None else path.write_bytes(left)
        status, out, _ = run("status", folder)
        assert status == 0
        assert f"{path} {what}" in out
        assert remedy in out
        for command in ("ask", "learn"):
            status, _, err = run(command, folder)
            assert status == 2
            assert remedy in err


def test_before_a_goal_too_it_is_said_where_the_manifest_means_other_numbers(run, folder):
    manifest = Path(folder, "workspace.toml")
    manifest.write_text(manifest.read_text().replace('units = ["m", "m"]', 'units = ["cm", "cm"]'))
    out = run("status", folder)[1]
    assert "what was imported has outcome units ('m', 'm')" in out


def test_a_goal_that_keeps_a_tolerance_of_before_says_so(run, folder):
    run("goal", folder, "0.9", "0.05")
    assert "within" not in run("status", folder)[1]
    manifest = Path(folder, "workspace.toml")
    manifest.write_text(manifest.read_text().replace("tolerance = 0.015", "tolerance = 0.05"))
    run("goal", folder, "0.9", "0.1")
    out = run("status", folder)[1]
    assert "tolerance 5 cm" in out
    assert "goal 1          90 cm ahead, 5 cm left, within 1.5 cm as it was set: not tried" in out
    assert "goal 2          90 cm ahead, 10 cm left: not reached yet" in out


def test_the_table_has_a_column_for_each_number(run, afternoon):
    run("ask", afternoon)
    run("void", afternoon, "--reason", "=cmd|' /C calc'!A0")
    rows = list(csv.DictReader(io.StringIO(run("trials", afternoon, "--csv")[1])))
    assert [row["trial"] for row in rows] == ["1", "2", "3", "4", "5"]
    assert (rows[0]["goal x [m]"], rows[0]["error y [m]"]) == ("0.9", "-0.01")
    assert (rows[1]["error x [m]"], rows[1]["hit"]) == ("", "")
    assert np.isfinite(float(rows[4]["p_hit"]))
    assert not rows[4]["reason"].startswith("=")  # no cell is a formula
    assert run("trials", afternoon, "--csv", "--json")[0] == 2


def test_ask_says_what_a_program_needs(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    asked = json.loads(run("ask", folder, "--json", "--out", "p-{trial}.csv")[1])
    assert asked["written"] == "p-1.csv"
    assert (tmp_path / "p-1.csv").is_file()
    assert set(asked["first_pose"]) == {"joint1", "joint2"}
    assert asked["gate"] is asked["execution"] is None
    copy = "cp {plan} copied.npz"
    ran = json.loads(run("ask", folder, "--json", "--run", copy, "--yes")[1])
    assert (ran["execution"]["outcome"], ran["trial"]["stage"]) == ("done", "executed")
