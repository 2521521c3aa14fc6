"""The comparison of adapters, on few goals and with a generator that learns at once."""

import pytest

from prior_reinforce.lab.experiments.claims import Verdict
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.adapters import RECIPE, Adapters
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json
from prior_reinforce.lab.experiments.statistics import Interval

SMALL = Scale(goals=5, seeds=(0,), sets=("A",), rounds=3)


@pytest.mark.slow
def test_adapters_that_move_nothing_share_the_first_throw_and_differ_after(tmp_path):
    run = Run(tmp_path, SMALL, include=("proportional,gain=0.8", "gp"))
    # Of outcomes seen by eye: something is left to adapt.
    figures = from_json(to_json(Adapters(generator="dmp").run(run)))
    success = figures["success"]
    assert success["proportional,gain=0.8"] == success["proportional"]  # ours, set by hand
    frozen = [point.value for point in figures["success"]["frozen"]]
    adapted = [point.value for point in figures["success"]["gp"]]
    assert figures["proportional_minus_frozen"][0] == Interval(0.0, 0.0, 0.0)
    assert adapted[-1] > frozen[-1]
    assert figures["gp_minus"]["frozen"][-1].value == pytest.approx(adapted[-1] - frozen[-1])
    table = RECIPE.table(figures)
    assert [row[0] for row in table.rows][-2:] == ["no adapter", "proportional,gain=0.8"]
    assert {claim.verdict for claim in RECIPE.claims(figures)} == {Verdict.OPEN}
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.is_file()


def test_adapters_work_behind_what_was_learned_from_an_eyes_estimates():
    assert {t.perception for t in Adapters().trainings(Scale())} == {"eye"}


def test_in_the_end_is_judged_only_where_something_is_left_to_reach():
    certain, none = (Interval(v, v, v) for v in (1.0, 0.0))
    half = Interval(0.5, 0.4, 0.6)
    names = ("gp", "gp-all", "proportional", "frozen")
    figures = {
        "trainings": 6,
        "success": {name: [half, certain] for name in names},
        "forms": {
            "gp": {
                "minus_proportional": [none, none],
                "mean_minus_proportional": half,
                "minus_no_forgetting": [none, none],
            }
        },
        "proportional_minus_frozen": [half, half],
        "proportional_mean_minus_frozen": half,
    }
    verdicts = {claim.paper: claim.verdict for claim in RECIPE.claims(figures)}
    assert verdicts["GP, m = 2: the proportional compensator ends lower."] is Verdict.OPEN
    reached = {**figures, "success": {name: [half, half] for name in names}}
    verdicts = {claim.paper: claim.verdict for claim in RECIPE.claims(reached)}
    assert verdicts["GP, m = 2: the proportional compensator ends lower."] is Verdict.NOT_CONFIRMED
