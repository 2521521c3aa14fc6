"""Some of the scripts of `benchmarks/`, as a reader runs them."""

import re
import runpy
import sys
from pathlib import Path

import pytest

from prior_reinforce.generators import make_generator
from prior_reinforce.registry import PLUGINS, load_plugins
from prior_reinforce.simulation.learned import save_learned
from prior_reinforce.simulation.tasks import make_task

FOLDER = Path(__file__).parents[1] / "benchmarks"
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def printed(monkeypatch, capsys):
    """Run a script; its exit status, and what it printed."""
    monkeypatch.syspath_prepend(EXAMPLES)

    def call(name, *args):
        monkeypatch.setattr(sys, "argv", [name, *args])
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
        return 0, capsys.readouterr().out

    return call


@pytest.mark.slow
def test_earlier_goals_are_compared_with_none(printed, tmp_path, monkeypatch):
    load_plugins("own_task")
    monkeypatch.delenv(PLUGINS)
    demonstrations = make_task("toss").demonstrations("A")
    generator = make_generator("interpolation").fit(demonstrations, seed=0)
    save_learned(tmp_path / "model", generator, demonstrations, seed=0)
    options = [
        "--sequences",
        "2",
        "--rounds",
        "2",
        "--adapters",
        "gp-two-term",
        "--perception",
        "exact",
    ]
    models = ["--models", str(tmp_path / "model"), "--task", "toss"]
    _, text = printed("carry_over", *models, *options)
    mean = r"-?\d\.\d\d"  # of one set, so that there is no interval
    row = rf"^\| gp-two-term \| {mean} \| {mean} \| {mean} \|$"
    assert re.search(row, text, re.MULTILINE)


def test_first_throws_of_a_method_are_a_row_a_set(printed):
    _, text = printed("zero_shot", "--methods", "nearest,timing=align", "--goals", "4")
    rows = re.findall(r"^\| nearest,timing=align \| ([AB]) \| [\d.]+ \(", text, re.MULTILINE)
    assert rows == ["A", "B"]


@pytest.mark.slow
def test_what_is_said_of_first_throws_stands_beside_what_hit_on_drawn_sets(printed):
    options = ["--tasks", "fishing", "--sets", "v00", "v01", "--goals", "3", "--p-changed", "0.2"]
    _, text = printed("first_throws", *options, "--perception", "exact")
    assert re.search(r"^\| fishing \| 0\.\d\d \| [01]\.\d\d \|", text, re.MULTILINE)
    assert "6 throws" in text


@pytest.mark.slow
def test_what_a_found_turn_gains_is_a_row_a_task(printed):
    options = ["--tasks", "zoo-bounce", "zoo-pour", "--sets", "2", "--goals", "2"]
    _, text = printed("found_turn", *options, "--perception", "exact")
    mean, with_interval = r"-?\d+\.\d\d", r"-?\d+\.\d\d[^|]*"
    found, none = re.findall(r"^\| (zoo-\S+ \| \d of 2) \|", text, re.MULTILINE)
    assert (found, none) == ("zoo-bounce | 2 of 2", "zoo-pour | 0 of 2")
    # Where none is found, both generators are the same.
    same = rf"zoo-pour \| 0 of 2 \| ({mean}), \1 \| 0\.00[^|]*\| ({mean}), \2 \| 0\.00[^|]*\|"
    assert re.search(same, text)
    assert re.search(rf"zoo-bounce \| 2 of 2 \| {mean}, {mean} \| {with_interval}\|", text)
