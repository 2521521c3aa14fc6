"""Rules beside one another in conditions, on fields by hand and one that was measured."""

import json

import numpy as np
import pytest

from prior_reinforce.lab.experiments import fields
from prior_reinforce.lab.experiments.fields import Change, Field, MeasuredField
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json
from prior_reinforce.lab.experiments.recipes.robustness import (
    CONDITIONS,
    RECIPE,
    RULES,
    Condition,
    Robustness,
    draws,
)
from prior_reinforce.lab.experiments.statistics import Interval

FIELDS = [[MeasuredField("basketball-v1", "basketball-v1", name, 0) for name in "A"]]
OBSERVERS = "prior_reinforce.lab.experiments.observers"
SMALL = Robustness(
    conditions=(
        Condition("by eye", FIELDS),
        Condition("turned away", FIELDS, Change(shift=(-0.1, 0.05)), f"{OBSERVERS}:ErringEye"),
    )
)


@pytest.fixture
def by_hand(monkeypatch):
    """Instead of physics: 3 cm short, and further left the further ahead."""

    def measured(self, folder):
        x, y = np.linspace(0.85, 1.15, 5), np.linspace(-0.3, 0.3, 9)
        off = np.stack(np.meshgrid(np.full(5, -0.03), 0.1 * y, indexing="ij"), axis=-1)
        corners = np.array([[0.9, -0.2], [0.9, 0.2], [1.1, -0.2], [1.1, 0.2]])
        return Field(
            "by hand", np.array([0.85, -0.3]), np.array([x[1] - x[0], y[1] - y[0]]), off,
            np.array([0.004, 0.004]), np.array([[0.9, -0.2], [1.1, 0.2]]), 0.015, corners,
            np.full((4, 2), 0.01), np.zeros((4, 2)),
        )  # fmt: skip

    monkeypatch.setattr(MeasuredField, "field", measured)
    monkeypatch.setattr(MeasuredField, "run", lambda self, folder: {})


def test_conditions_give_table_picture_and_remarks(by_hand, tmp_path):
    run = Run(tmp_path, Scale(rounds=4), include=("frozen",))
    figures = from_json(to_json(SMALL.run(run)))
    table = RECIPE.table(figures)
    assert table.header[2] == "Bayesian, earlier goals too"
    assert table.header[-1] == "frozen"  # the one that was included
    assert "CMA-ES" not in table.header  # which searches, and these conditions ask for none
    assert [row[:2] for row in table.rows] == [("by eye", "7"), ("turned away", "7")]
    for condition in figures["conditions"]:
        of = {label: rule["mean"].value for label, rule in condition["rules"].items()}
        assert of["Bayesian, earlier goals too"] < of["frozen"] == 5.0  # 3 cm off is never a hit
        assert condition["rules"]["Bayesian, earlier goals too"]["ours_minus"].value == 0.0
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.is_file()
    assert "Brier" in RECIPE.remarks(figures)[-1]


def test_where_goals_are_tried_alone_nothing_is_remembered_and_ours_is_alone_too(by_hand, tmp_path):
    alone = Robustness(conditions=(Condition("by eye, alone", FIELDS, goals=2, alone=True),))
    run = Run(tmp_path, Scale(rounds=4), include=("frozen",))
    figures = from_json(to_json(alone.run(run)))
    table = RECIPE.table(figures)
    assert table.header[2] == "Bayesian, each goal alone"
    assert not any("earlier goals too" in label for label in table.header)
    assert "(" not in table.rows[0][2]  # not compared with itself
    assert "(" in table.rows[0][3]
    kept = [json.loads(path.read_text())["unit"] for path in tmp_path.glob("units/*")]
    assert not any(unit["carry_over"] for unit in kept if "carry_over" in unit)
    rules = figures["conditions"][0]["rules"]
    assert rules["Bayesian, each goal alone"]["ours_minus"].value == 0.0
    assert rules["frozen"]["ours_minus"].value < 0.0


def test_who_is_ahead_of_ours_is_named(by_hand, tmp_path):
    figures = SMALL.run(Run(tmp_path, Scale(rounds=2)))
    figures["conditions"][0]["rules"]["mean offset"]["ours_minus"] = Interval(0.5, 0.4, 0.6)
    assert "mean offset in 'by eye'" in RECIPE.remarks(figures)[0]


def test_a_quick_run_is_one_condition_on_one_field(by_hand, tmp_path):
    quick = Scale(rounds=2, variants=False)
    (condition,) = Robustness().run(Run(tmp_path, quick))["conditions"]
    assert condition["goals"] == 7
    assert len(condition["rules"]) == 7


def test_every_draw_is_another_and_every_rule_has_its_own_name():
    sets = draws(3, 30)[0]
    assert len({field.demonstrations for field in sets}) == 30
    assert len({rule.label for rule in RULES}) == len(RULES)
    assert len({condition.label for condition in CONDITIONS}) == len(CONDITIONS)
    assert all(c.alone == c.label.endswith(", alone") for c in CONDITIONS)
    assert sum(c.alone for c in CONDITIONS) == 10


def test_a_field_of_a_draw_is_measured_once_and_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(fields, "SPACING", 0.2)  # in physics, but coarsely
    of = MeasuredField("basketball-v1", "basketball-v1", "F", 0, 3, seed=3001)
    field = of.field(tmp_path)
    assert field.demonstrations.n == 3
    assert 0.001 < field.noise_sd.max() < 0.02
    kept = next(tmp_path.glob("fields/*.npz"))
    before = kept.stat().st_mtime_ns
    np.testing.assert_array_equal(of.field(tmp_path).displacement, field.displacement)
    assert kept.stat().st_mtime_ns == before
