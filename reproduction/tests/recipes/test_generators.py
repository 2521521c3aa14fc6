"""The comparison of generators, on few goals and with ones that learn at once."""

import numpy as np
import pandas as pd
import pytest
from gathered import gather

from prior_reinforce.generators import GENERATORS
from reproduction.recipes import Scale, generators
from reproduction.recipes.generators import (
    METHODS,
    RECIPE,
    FreshNoiseTrials,
    Method,
    units,
)
from reproduction.results import TRIALS, Results

SMALL = Scale(goals=3, seeds=(0,), sets=("A",), rounds=3)
OWN = "twin"
QUICK = ("segmented DMP", "nearest neighbours", "nearest neighbours, aligned")


@pytest.mark.slow
def test_recorded_and_aligned_stand_side_by_side(tmp_path, monkeypatch):
    monkeypatch.setitem(GENERATORS.members, OWN, GENERATORS.members["nearest"])
    chosen = tuple(method for name in QUICK for method in METHODS if method.label == name)
    monkeypatch.setattr(generators, "METHODS", chosen)
    monkeypatch.setattr(generators, "OURS", "segmented DMP")
    results = gather(tmp_path, units(SMALL, (OWN, "nearest")), "generators")
    methods = results.by("method")
    assert list(methods) == [*QUICK, OWN]
    # The same class under its own name gives the same trials, to the last digit.
    np.testing.assert_array_equal(
        TRIALS.of(methods[OWN].frame), TRIALS.of(methods["nearest neighbours"].frame)
    )
    # A DMP with its own clock is at the goal where neighbours out of time are nowhere.
    assert methods["nearest neighbours"].minus(methods["segmented DMP"], TRIALS).value > 0.3
    table = RECIPE.table(results)
    assert {len(row) for row in table.rows} == {len(table.header)}
    assert table.rows[0][0] == "segmented DMP (ours)"
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()


def test_without_variants_the_papers_comparison_and_own_methods_are_left():
    small = Scale(goals=5, seeds=(0,), sets=("A",), variants=False)
    assert [unit.training.generator for unit, _ in units(small, (OWN, "nearest"))] == [
        "diffusion",
        *("nearest", "dmp,segmented=false", "regression,timing=none"),
        "nearest,timing=align",
        "dmp,segmented=false,timing=align",
        "regression,timing=align",
        OWN,
    ]


def test_who_needs_fewer_trials_than_ours_is_named():
    rng = np.random.default_rng(0)
    rows = [
        {"method": name, "learned_on": "t", "task": "t", "set": f"drawn{drawn}", "seed": 0,
         "goal": j, "rounds": 10, "solved_at": at + rng.integers(2)}
        for name, at in (("diffusion", 3), ("DMP", 1), ("closed form", 3))
        for drawn in range(4) for j in range(20)
    ]  # fmt: skip
    (remark,) = RECIPE.remarks(Results(pd.DataFrame(rows), {}))
    assert "DMP (-2." in remark
    assert "closed form" not in remark
    few = pd.DataFrame([row for row in rows if row["set"] in ("drawn0", "drawn1")])
    assert RECIPE.remarks(Results(few, {})) == []  # of two sets nothing is said


def test_every_network_has_its_untrained_self_beside_it():
    """A figure of a network counts beside its control."""
    choices = {method.generator for method in METHODS}
    assert "interpolation" in choices
    assert {"diffusion", "diffusion,training_steps=0"} <= choices


def test_fresh_noise_is_another_plan_at_every_trial_and_pairs_with_ours(tmp_path):
    tiny = "diffusion,perceptron.width=8,perceptron.members=1,training_steps=2"
    scale = Scale(goals=3, seeds=(0, 1), sets=("A",), rounds=2)
    ours = Method("ours", "nearest", "method").trials(scale)
    one = Method("one plan", tiny, "other", "frozen").trials(scale)[:1]
    fresh = [
        FreshNoiseTrials(t.training, t.task, t.adapter, t.perception, t.goals, rounds=t.rounds)
        for t in one
    ]
    results = gather(tmp_path, [(ours[0], {"method": "a"}), (ours[1], {"method": "a"}),
                                (fresh[0], {"method": "b"})])  # fmt: skip
    assert results.where(noise="fresh").n == 3
    pair = results.by("method")
    assert np.isfinite(pair["a"].minus(pair["b"], TRIALS).value)  # over the seed that both have
    once, anew = (trials[0].learned(tmp_path).generator for trials in (one, fresh))
    goal = np.array([[1.0, 0.0]])
    assert np.array_equal(once.generate(goal), once.generate(goal))
    assert np.abs(anew.generate(goal) - anew.generate(goal)).max() > 1e-6


def test_generators_learn_from_exact_outcomes():
    assert {unit.training.perception for unit, _ in units(Scale())} == {None}
