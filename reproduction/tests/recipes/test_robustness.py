"""Rules beside one another in conditions, on fields by hand and one that was measured."""

import numpy as np
import pytest
from gathered import gather

from reproduction import fields
from reproduction.fields import Change, Field, MeasuredField
from reproduction.recipes import Scale
from reproduction.recipes.adaptation import later
from reproduction.recipes.robustness import (
    CONDITIONS,
    RECIPE,
    RULES,
    Condition,
    Rule,
    draws,
    tried,
)
from reproduction.results import TRIALS

FIELDS = [[MeasuredField("basketball-v1", "basketball-v1", name, 0) for name in "A"]]
OBSERVERS = "reproduction.observers"
TURNED = Change(shift=(-0.1, 0.05))
FROZEN = Rule("frozen", "frozen", carry_over=True)


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
    conditions = [
        Condition("by eye", FIELDS, goals=4),
        Condition("turned away", FIELDS, TURNED, f"{OBSERVERS}:ErringEye", goals=4),
    ]
    planned = [unit for c in conditions for unit in tried(c, [*RULES, FROZEN], rounds=4)]
    results = gather(tmp_path, planned, "robustness")
    table = RECIPE.table(results)
    assert table.header[2] == "Bayesian, earlier goals too"
    assert table.header[-1] == "frozen"  # the one that was included
    assert "CMA-ES" not in table.header  # which searches, and these conditions ask for none
    assert [row[:2] for row in table.rows] == [("by eye", "3"), ("turned away", "3")]
    for of in later(results).by("condition").values():
        methods = of.by("method")
        ours = methods["Bayesian, earlier goals too"].mean(TRIALS).value
        assert ours < methods["frozen"].mean(TRIALS).value == 5.0  # 3 cm off is never a hit
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()
    assert "Brier" in RECIPE.remarks(results)[-1]


def test_where_goals_are_tried_alone_nothing_is_remembered_and_ours_is_alone_too(by_hand, tmp_path):
    alone = Condition("by eye, alone", FIELDS, goals=3, alone=True)
    planned = tried(alone, [*RULES, Rule("frozen", "frozen")], rounds=4)
    assert not any(unit.carry_over for unit, _ in planned)
    table = RECIPE.table(gather(tmp_path, planned, "robustness"))
    assert table.header[2] == "Bayesian, each goal alone"
    assert not any("earlier goals too" in label for label in table.header)
    assert "(" not in table.rows[0][2]  # not compared with itself
    assert "(-" in table.rows[0][-1]  # with fewer trials than no adapter


def test_who_is_ahead_of_ours_is_named(by_hand, tmp_path):
    swapped = [FROZEN, Rule("Bayesian", "bayes", carry_over=True)]
    results = gather(tmp_path, tried(Condition("by eye", FIELDS), swapped, rounds=2), "robustness")
    assert "Bayesian in 'by eye' (+" in RECIPE.remarks(results)[0]


def test_a_quick_run_is_one_condition_on_one_field():
    planned = RECIPE.units(Scale(rounds=2, variants=False), ())
    assert {names["condition"] for _, names in planned} == {"by eye"}
    assert len({unit.measured for unit, _ in planned}) == 1
    assert len(planned) == 7


def test_every_draw_is_another_and_every_rule_has_its_own_name():
    sets = draws(3, 30)[0]
    assert len({field.demonstrations for field in sets}) == 30
    assert len({rule.label for rule in RULES}) == len(RULES)
    assert len({condition.label for condition in CONDITIONS}) == len(CONDITIONS)
    assert all(c.alone == c.label.endswith(", alone") for c in CONDITIONS)
    assert {"exact, alone", "labels exact, alone"} <= {c.label for c in CONDITIONS}


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
