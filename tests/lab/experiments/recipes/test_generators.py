"""The comparison of generators, on few goals and with ones that learn at once."""

import pytest

from prior_reinforce.lab.experiments.claims import Verdict
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json
from prior_reinforce.lab.experiments.recipes.generators import METHODS, RECIPE, Generators, Method
from prior_reinforce.lab.experiments.statistics import Interval

SMALL = Scale(goals=5, seeds=(0,), sets=("A",), rounds=3)
OWN = "prior_reinforce.generators.interpolation:NearestNeighbours"


@pytest.mark.slow
def test_generators_with_an_own_one(tmp_path):
    methods = (
        Method("segmented DMP", "dmp", kind="method"),
        *(m for m in METHODS if m.generator.startswith(("nearest", "interpolation"))),
    )
    figures = Generators(methods).run(Run(tmp_path, SMALL, include=(OWN,)))
    figures = from_json(to_json(figures))
    rows = {row["generator"]: row for row in figures["rows"]}
    aligned = {name for name, row in rows.items() if row["aligned"]}
    assert aligned == {"nearest,timing=align", "interpolation,timing=align"}
    assert set(rows) == {"dmp", "nearest", OWN, *aligned}
    # The same class under its own name gives the same trials, to the last digit.
    assert rows[OWN]["success"] == rows["nearest"]["success"]
    # A DMP with its own clock is at the goal where neighbours out of time are nowhere.
    assert rows["nearest"]["ours_minus"][0].value > 0.3
    assert [len(row["success"]) for row in rows.values()] == [3] * 5
    claims = RECIPE.claims(figures)
    assert {claim.verdict for claim in claims} == {Verdict.OPEN}
    assert any("aligned" in claim.paper for claim in claims)
    table = RECIPE.table(figures)
    assert {len(row) for row in table.rows} == {len(table.header)}
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.is_file()


def test_without_variants_the_papers_comparison_and_own_methods_are_left():
    small = Scale(goals=5, seeds=(0,), sets=("A",), variants=False)
    assert [t.generator for t in Generators().trainings(small, (OWN, "nearest"))] == [
        "diffusion",
        *("nearest", "dmp,segmented=false,exact=no", "regression,timing=none,exact=no,trend=zero"),
        "nearest,timing=align",
        "dmp,segmented=false,timing=align,exact=no",
        "regression,timing=align,exact=no,trend=zero",
        OWN,
    ]


def generators_figures(**minus):
    """Figures in which diffusion reaches .5 and then .96, and others as far below as is said."""
    share = [0.5, 0.96, 0.96, 0.96]

    def interval(value):
        return Interval(value, value - 0.01, value + 0.01)

    def told(method):
        return {**vars(method), "aligned": method.aligned}

    rows = [{**told(METHODS[0]), "success": [interval(s) for s in share], "mean_minus": {}}]
    for method in METHODS[2:5]:
        below = minus[method.label.split()[0]]
        rows.append(
            {
                **told(method),
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
    figures = generators_figures(**{"nearest": 0.3, "U-Net": -0.02, "DMP": 0.005})
    verdicts = [claim.verdict for claim in RECIPE.claims(figures)[:5]]
    assert verdicts == [
        Verdict.CONFIRMED, Verdict.CONFIRMED, Verdict.OPEN, Verdict.NOT_CONFIRMED,
        Verdict.CONFIRMED,
    ]  # fmt: skip
    assert "whole plans" in RECIPE.claims(figures)[4].measured
    # No verdict calls the spline with its timing and network just "diffusion".
    ours = "our default (spline, timing and network)"
    assert all(c.measured.startswith(ours) for c in RECIPE.claims(figures)[:4])
    (remark,) = RECIPE.remarks(figures)
    assert "U-Net regression" in remark
    assert f"above {ours} " in remark
    assert "nearest" not in remark


def test_generators_learn_from_exact_outcomes():
    assert {t.perception for t in Generators().trainings(Scale())} == {None}
