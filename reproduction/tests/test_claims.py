"""The rule of verdicts, and that every claim speaks of rows that some recipe makes."""

import numpy as np
import pandas as pd
import pytest

from reproduction.claims import CLAIMS, Claim, decide, holm, judge
from reproduction.recipes import RECIPES, Scale
from reproduction.results import Results, reached
from reproduction.statistics import Interval

ABOVE = Claim("above", "ours", {}, bounds=(0.9, np.inf))
FEWER = Claim("fewer", "ours", {}, {}, margin=0.25)
RANGE = Claim("2 to 4", "ours", {}, bounds=(2.0, 4.0))


@pytest.mark.parametrize(
    ("claim", "low", "high", "verdict"),
    [
        (ABOVE, 0.91, 0.98, "confirmed"),
        (ABOVE, 0.88, 0.96, "open"),
        (ABOVE, 0.70, 0.89, "not confirmed"),
        (FEWER, 0.1, 0.5, "confirmed"),
        (FEWER, 0.1, 0.2, "level"),  # less than a quarter of a trial, for sure
        (FEWER, -0.1, 0.2, "level"),
        (FEWER, -0.1, 0.3, "open"),
        (FEWER, -0.5, 0.0, "not confirmed"),
        (RANGE, 2.1, 3.9, "confirmed"),
        (RANGE, 1.2, 1.9, "fewer"),  # which is not what was claimed
        (RANGE, 1.9, 2.1, "open"),
        (RANGE, 4.1, 5.0, "not confirmed"),
    ],
)
def test_the_whole_interval_decides(claim, low, high, verdict):
    assert decide(claim, Interval((low + high) / 2, low, high), p_of_all=0.001) == verdict


def test_one_of_many_tests_is_confirmed_alone_where_it_does_not_stand_among_all():
    assert decide(ABOVE, Interval(0.95, 0.91, 0.98), p_of_all=0.03) == "confirmed alone"


def test_without_an_interval_nothing_is_decided():
    for value in (0.0, 0.95):
        assert decide(ABOVE, Interval(value, np.nan, np.nan), p_of_all=np.nan) == "open"


def test_holms_method_on_a_worked_example():
    # 4 x .01, 3 x .02, then 2 x .03 (not below the one before), and .04 likewise.
    np.testing.assert_allclose(holm(np.array([0.02, 0.01, 0.04, 0.03])), [0.06, 0.04, 0.06, 0.06])


def rows(method, share, seed):
    """Six sets, of which the share reaches each of 50 goals at once, else never."""
    hit = np.random.default_rng(seed).uniform(size=(6, 50)) < share
    return [
        {"recipe": "r", "method": method, "learned_on": "t", "task": "t", "set": f"v{i}", "seed": i,
         "goal": j, "rounds": 10, "solved_at": int(of)}
        for i, line in enumerate(hit) for j, of in enumerate(line)
    ]  # fmt: skip


def test_claims_are_held_against_rows_with_their_control():
    results = Results(pd.DataFrame(rows("good", 0.97, 0) + rows("bad", 0.5, 1)), {})
    good, bad = ({"recipe": "r", "method": name} for name in ("good", "bad"))
    high = {"measure": reached(4), "bounds": (0.8, np.inf)}
    judged = judge(
        results,
        [
            Claim("good is high", "ours", good, control=bad, **high),
            Claim("bad is high", "ours", bad, **high),
            Claim("bad takes more", "ours", bad, good, margin=0.25),
            Claim("good takes more", "ours", good, bad, margin=0.25),
            Claim("nobody", "ours", {"method": "nobody"}, **high),
        ],
    )
    assert [one.verdict for one in judged] == [
        "confirmed", "not confirmed", "confirmed", "not confirmed", "not run",
    ]  # fmt: skip
    assert judged[0].control.value == judged[1].measured.value
    assert judged[0].p < judged[0].p_of_all < 0.025 < judged[1].p
    assert judged[0].trained == "6 sets"


def test_every_claim_speaks_of_rows_that_a_recipe_makes():
    planned = {
        name: {names.get("method") for _, names in recipe.units(Scale(), ())}
        for name, recipe in RECIPES.items()
    }
    for claim in CLAIMS:
        for where in (claim.a, claim.b, claim.control):
            if where is None or claim.says.startswith("Seeing by a VLM"):
                continue
            recipes = where["recipe"] if isinstance(where["recipe"], tuple) else [where["recipe"]]
            assert any(where["method"] in planned[name] for name in recipes), claim.says


def test_both_forms_are_tested_on_the_same_claims():
    papers, ours = (
        [claim.says for claim in CLAIMS if claim.form == form]
        for form in ("the paper's form", "ours")
    )
    assert papers == ours[: len(papers)]
