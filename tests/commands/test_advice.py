"""What is said and drawn of a region, and what it needs."""

import json
import re

import pytest

import prior_reinforce as pr
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import advice
from tests.arm.workspace.planar import events_in


@pytest.mark.slow
def test_advice_names_places_and_draws_the_region(run, folder, monkeypatch):
    monkeypatch.setattr(advice, "_ACROSS", 6)  # goals a side; all 15 take seconds
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, 1, "5 cm long")
    before = events_in(folder)
    status, out, _ = run("advise", folder, "--out", "map.png")
    assert status == 0
    assert re.search(r"a first throw's hit is likeliest at .* \((unlikely|possible|likely)\)", out)
    assert re.search(r"throw that teaches most: \d+(\.\d)? cm ahead", out)
    assert "demonstration that teaches most: one that ends at" in out
    assert "picture: map.png" in out
    assert events_in(folder) == before


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:goal 90 cm behind")
def test_of_a_goal_far_off_advice_says_so_and_is_drawn_whole(run, folder, monkeypatch):
    monkeypatch.setattr(advice, "_ACROSS", 6)
    run("goal", folder, "-0.9", "0.1")
    status, out, err = run("advise", folder)  # what cannot be laid out is warned of
    assert (status, err) == (0, "")
    assert "170 cm in x outside what was demonstrated" in out


def test_advice_needs_an_adapter_that_knows_probabilities(run, folder):
    run("goal", folder, "0.9", "0.05", "--adapter", "gp")
    status, out, err = run("advise", folder)
    assert (status, out) == (2, "")
    assert "--adapter bayes" in err


def test_advice_needs_a_goal_and_a_png(run, folder):
    assert "set a goal first" in run("advise", folder)[2]
    assert ".png" in run("advise", folder, "--out", "map.jpg")[2]


@pytest.mark.slow
def test_before_a_goal_it_draws_what_moved_motions_can_reach(run, tmp_path):
    folder = tmp_path / "hoop"
    one = pr.make_task("basketball-v1").demonstrations("A").only([0]).without_symmetry()
    with Workspace.create(folder, symmetry="carried", no_box=True) as hoop:
        hoop.import_demonstrations(one, "a throw")
        model = hoop.learn().model
    elsewhere = tmp_path / "shown" / "on monday" / "reach.png"
    assert run("advise", folder, "--out", elsewhere)[0] == 0
    assert elsewhere.is_file()
    status, out, _ = run("advise", folder)
    assert status == 0
    share = int(re.search(r"(\d+)% of the goals to which motions may be moved", out)[1])
    assert 20 < share < 90
    picture = folder / "pictures" / f"reach-{model}.png"
    assert f"picture: {picture}" in out
    assert picture.is_file()
    run("goal", folder, "1.0", "0.1")
    run("ask", folder)
    run("tell", folder, 1, "hit")
    assert run("report", folder)[0] == 0
    assert "What can be reached" in (folder / "report" / "report.html").read_text()


@pytest.mark.slow
def test_where_a_turn_was_found_no_throw_and_no_demonstration_teaches_most(run, tmp_path):
    folder = tmp_path / "hoop"
    shown = pr.make_task("basketball-v1").demonstrations("A").without_symmetry()
    with Workspace.create(folder, no_box=True) as hoop:
        hoop.import_demonstrations(shown, "throws")
        hoop.learn()
    run("goal", folder, "1.0", "0.1")
    status, out, _ = run("advise", folder)
    assert status == 0
    assert "hit is likeliest at" in out
    assert "teaches most" not in out
    advised = json.loads(run("advise", folder, "--json")[1])
    for goal in (advised["best"], advised["worst"]):  # of goals that can be set
        assert run("goal", folder, *map(str, goal))[0] == 0
