"""The comparison of generators, on few goals and with ones that learn at once."""

import numpy as np
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
    assert set(rows) == {"dmp", "nearest", "interpolation", OWN, *aligned}
    # The same class under its own name gives the same trials, to the last digit.
    assert rows[OWN]["success"] == rows["nearest"]["success"]
    # A DMP with its own clock is at the goal where neighbours out of time are nowhere.
    assert rows["nearest"]["ours_minus"][0].value > 0.3
    assert [len(row["success"]) for row in rows.values()] == [3] * 6
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
        *("nearest", "dmp,segmented=false", "regression,timing=none"),
        "nearest,timing=align",
        "dmp,segmented=false,timing=align",
        "regression,timing=align",
        OWN,
    ]


def generators_figures(forms_trainings, **minus):
    """Figures in which diffusion reaches .5 and then .96, and others as far below as is said."""
    share = [0.5, 0.96, 0.96, 0.96]

    def interval(value):
        return Interval(value, value - 0.01, value + 0.01)

    def told(method, trainings=6):
        return {**vars(method), "aligned": method.aligned, "trainings": trainings}

    known = {method.label: method for method in METHODS}
    rows = [
        {**told(METHODS[0]), "success": [interval(s) for s in share], "mean_minus": {}},
        {**told(METHODS[1], forms_trainings), "success": [interval(s - 0.01) for s in share],
         "ours_minus": [interval(0.01)] * 4, "mean_minus": {"diffusion": interval(0.01)}},
    ]  # fmt: skip
    for label in ("nearest neighbours", "DMP", "U-Net regression"):
        below = minus[label.split()[0]]
        rows.append(
            {
                **told(known[label]),
                "success": [interval(s - below) for s in share],
                "ours_minus": [interval(below) for _ in share],
                "mean_minus": {
                    "diffusion": interval(below),
                    METHODS[1].label: interval(below + 0.1),
                },
            }
        )
    return {"trainings": 6, "rows": rows}


@pytest.mark.parametrize(
    ("forms_trainings", "of_form"), [(6, Verdict.CONFIRMED), (2, Verdict.OPEN)]
)
def test_verdicts_and_remarks_follow_the_figures(forms_trainings, of_form):
    below = {"nearest": 0.3, "U-Net": -0.02, "DMP": 0.005}
    figures = generators_figures(forms_trainings, **below)
    verdicts = [claim.verdict for claim in RECIPE.claims(figures)[:5]]
    # The paper's form, learned once a set, decides nothing.
    assert verdicts == [
        Verdict.CONFIRMED, Verdict.CONFIRMED, Verdict.OPEN, Verdict.NOT_CONFIRMED, of_form,
    ]  # fmt: skip
    assert RECIPE.claims(figures)[4].measured.startswith("the paper's form of it minus")
    assert ("(2 trainings)" in RECIPE.table(figures).rows[1][0]) == (forms_trainings == 2)
    (remark,) = RECIPE.remarks(figures)
    assert "U-Net regression" in remark
    assert "above diffusion " in remark
    assert "nearest" not in remark


def test_every_network_has_its_untrained_self_beside_it():
    """A figure of a network counts beside its control, and beside what it is corrected with."""
    choices = {method.generator for method in METHODS}
    assert "interpolation" in choices
    for choice in ("diffusion", "diffusion,correction=spline"):
        assert {choice, f"{choice},training_steps=0"} <= choices


def test_fresh_noise_is_another_plan_at_every_trial_and_pairs_with_ours(tmp_path):
    tiny = "perceptron.width=8,perceptron.members=1,training_steps=2"
    methods = (
        Method("ours", "nearest", "method"),
        Method("one plan", f"diffusion,{tiny}", "other", "frozen", one_seed=True),
        Method("fresh", f"diffusion,{tiny}", "other", "frozen", fresh=True, one_seed=True),
    )
    scale = Scale(goals=3, seeds=(0, 1), sets=("A",), rounds=2)
    figures = from_json(to_json(Generators(methods).run(Run(tmp_path, scale))))
    assert [row["trainings"] for row in figures["rows"]] == [2, 1, 1]
    assert [len(row["solved_at"]) for row in figures["rows"]] == [2, 1, 1]
    one, fresh = (m.trials(scale)[0].learned(tmp_path).generator for m in methods[1:])
    goal = np.array([[1.0, 0.0]])
    assert np.array_equal(one.generate(goal), one.generate(goal))
    assert np.abs(fresh.generate(goal) - fresh.generate(goal)).max() > 1e-6


def test_generators_learn_from_exact_outcomes():
    assert {t.perception for t in Generators().trainings(Scale())} == {None}
