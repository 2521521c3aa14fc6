"""What is said and drawn of a region, and what it needs."""

import re

import pytest

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


def test_advice_needs_an_adapter_that_knows_probabilities(run, folder):
    run("goal", folder, "0.9", "0.05", "--adapter", "gp")
    status, out, err = run("advise", folder)
    assert (status, out) == (2, "")
    assert "--adapter bayes" in err


def test_advice_needs_a_goal_and_a_png(run, folder):
    assert "set one" in run("advise", folder)[2]
    assert ".png" in run("advise", folder, "--out", "map.jpg")[2]
