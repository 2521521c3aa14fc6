"""The comparisons of methods, on few goals and with generators that learn at once."""

import json

import numpy as np
import pytest

from prior_reinforce.experiments.recipes import Run, Scale, Verdict
from prior_reinforce.experiments.recipes.adapters import Adapters
from prior_reinforce.experiments.recipes.generators import METHODS, Generators, Method
from prior_reinforce.experiments.recipes.success import (
    difference_curve,
    mean_success_difference,
    success_curve,
)

SMALL = Scale(goals=5, seeds=(0,), sets=("A",), rounds=3)
OWN = "prior_reinforce.generators:NearestNeighbours"


def test_curves_of_a_worked_example():
    solved = np.array([[1, 2, 0, 3]])
    assert [point["value"] for point in success_curve(solved, 3)] == [0.25, 0.5, 0.75]
    other = np.array([[1, 0, 0, 1]])
    assert [point["value"] for point in difference_curve(solved, other, 3)] == [-0.25, 0.0, 0.25]
    assert mean_success_difference(solved, other, 3).value == pytest.approx(0.0)


def test_a_difference_is_paired():
    solved = np.tile([1, 0], (3, 20))
    (point,) = difference_curve(solved, solved, 1)
    assert point == {"value": 0.0, "low": 0.0, "high": 0.0}


@pytest.mark.slow
def test_generators_with_an_own_one(tmp_path):
    methods = (
        Method("segmented DMP", "dmp", aligned=False, kind="method"),
        *(m for m in METHODS if m.generator in ("nearest", "interpolation")),
    )
    recipe = Generators(methods)
    figures = recipe.run(Run(tmp_path, SMALL, include=(OWN,)))
    figures = json.loads(json.dumps(figures))
    rows = {(row["generator"], row["aligned"]): row for row in figures["rows"]}
    assert set(rows) == {
        ("dmp", False), ("nearest", False), ("nearest", True), ("interpolation", True),
        (OWN, False),
    }  # fmt: skip
    # The same class under its own name gives the same trials, to the last digit.
    assert rows[OWN, False]["success"] == rows["nearest", False]["success"]
    # A DMP with its own clock is at the goal where neighbours out of time are nowhere.
    assert rows["nearest", False]["ours_minus"][0]["value"] > 0.3
    assert [len(row["success"]) for row in rows.values()] == [3] * 5
    claims = recipe.claims(figures)
    assert {claim.verdict for claim in claims} == {Verdict.OPEN}
    assert any("aligned" in claim.paper for claim in claims)
    table = recipe.table(figures)
    assert {len(row) for row in table.rows} == {len(table.header)}
    (picture,) = recipe.draw(figures, tmp_path)
    assert picture.path.is_file()


@pytest.mark.slow
def test_adapters_that_move_nothing_share_the_first_throw_and_differ_after(tmp_path):
    recipe = Adapters(generator="dmp")  # of outcomes seen by eye: something is left to adapt
    figures = json.loads(json.dumps(recipe.run(Run(tmp_path, SMALL))))
    frozen = [point["value"] for point in figures["success"]["frozen"]]
    adapted = [point["value"] for point in figures["success"]["gp"]]
    assert figures["proportional_minus_frozen"][0] == {"value": 0.0, "low": 0.0, "high": 0.0}
    assert adapted[-1] > frozen[-1]
    assert figures["gp_minus"]["frozen"][-1]["value"] == pytest.approx(adapted[-1] - frozen[-1])
    table = recipe.table(figures)
    assert [row[0] for row in table.rows][-1] == "no adapter"
    assert {claim.verdict for claim in recipe.claims(figures)} == {Verdict.OPEN}
    (picture,) = recipe.draw(figures, tmp_path)
    assert picture.path.is_file()


def test_without_variants_the_papers_comparison_and_own_methods_are_left():
    small = Scale(goals=5, seeds=(0,), sets=("A",), variants=False)
    learned = [(t.generator, t.aligned) for t in Generators().trainings(small, (OWN,))]
    assert learned == [
        ("diffusion", False),
        *((name, False) for name in ("nearest", "dmp-whole", "regression-whole")),
        *((name, True) for name in ("nearest", "dmp-whole", "regression-whole")),
        (OWN, False),
    ]


def generators_figures(**minus):
    """Figures in which diffusion reaches .5 and then .96, and others as far below as is said."""
    share = [0.5, 0.96, 0.96, 0.96]

    def interval(value):
        return {"value": value, "low": value - 0.01, "high": value + 0.01}

    rows = [{**vars(METHODS[0]), "success": [interval(s) for s in share], "mean_minus": {}}]
    for method in METHODS[2:5]:
        below = minus[method.generator]
        rows.append(
            {
                **vars(method),
                "success": [interval(s - below) for s in share],
                "ours_minus": [interval(below) for _ in share],
                "mean_minus": {
                    "diffusion": interval(below),
                    "diffusion on whole plans": interval(below + 0.1),
                },
            }
        )
    return {"trainings": 6, "rows": rows}


def test_verdicts_and_remarks_follow_the_figures():
    figures = generators_figures(nearest=0.3, **{"regression-whole": -0.02, "dmp-whole": 0.005})
    recipe = Generators()
    verdicts = [claim.verdict for claim in recipe.claims(figures)[:5]]
    assert verdicts == [
        Verdict.CONFIRMED, Verdict.CONFIRMED, Verdict.OPEN, Verdict.NOT_CONFIRMED,
        Verdict.CONFIRMED,
    ]  # fmt: skip
    assert "whole plans" in recipe.claims(figures)[4].measured
    (remark,) = recipe.remarks(figures)
    assert "U-Net regression" in remark
    assert "nearest" not in remark


def test_adapters_learn_from_what_an_eye_saw_and_generators_from_what_was_recorded():
    for recipe, perception in ((Adapters(), "eye"), (Generators(), None)):
        assert {t.perception for t in recipe.trainings(Scale(), ())} == {perception}
