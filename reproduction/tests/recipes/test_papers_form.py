"""The paper's form behind the adapters: what is run, and its table from rows."""

import numpy as np
import pandas as pd

from reproduction.recipes import RECIPES, Scale
from reproduction.recipes.adapters import ADAPTERS
from reproduction.recipes.generators import AMPLIFIED, FRESH, PAPERS_FORM
from reproduction.recipes.papers_form import RECIPE, units
from reproduction.results import Results


def test_one_training_a_set_and_seed_serves_everything():
    planned = units(Scale())
    trainings = {unit.training for unit, _ in planned}
    assert {t.generator for t in trainings} == {PAPERS_FORM}
    whole = [t for t in trainings if t.task == "basketball-v1" and not t.subset]
    assert (len(whole), len(trainings)) == (6, 6 + 4 + 8)  # three demonstrations; two more tasks
    assert [unit.training.seed for unit, _ in planned] == sorted(
        unit.training.seed for unit, _ in planned
    )  # a run that is stopped has whole seeds


def test_its_rows_stand_beside_other_generators():
    rows = [
        {"recipe": recipe, "method": name, "condition": condition, "learned_on": "t", "task": "t",
         "set": "A", "seed": 0, "goal": 0, "rounds": 10, "solved_at": at}
        for at, (recipe, name, condition) in enumerate((
            ("generators", "diffusion", None), ("generators", "closed form", None),
            ("papers-form", "GP of two terms, m = 2", AMPLIFIED), ("papers-form", FRESH, AMPLIFIED),
            ("papers-form", "proportional, 0.8", AMPLIFIED),
            ("papers-form", "GP, m = 2", "V1, by eye"),
        ), start=1)
    ]  # fmt: skip
    shown = RECIPES["generators"].rows_of(Results(pd.DataFrame(rows), {})).by("method")
    assert {name: of.frame["solved_at"].tolist() for name, of in shown.items()} == {
        "diffusion": [1],
        "the paper's form, GP of two terms": [3],
        "the paper's form, no adapter, fresh noise": [4],
        "closed form": [2],
    }
    assert next(iter(shown)) == "diffusion"


def test_a_row_a_condition_and_adapter():
    rng = np.random.default_rng(0)
    rows = [
        {"condition": condition, "method": name, "learned_on": "t", "task": condition, "set": "A",
         "seed": seed, "goal": j, "rounds": 10, "solved_at": rng.integers(1, 4)}
        for condition in ("amplified noise", "V1, by eye") for name in list(ADAPTERS)[:2]
        for seed in range(3) for j in range(5)
    ]  # fmt: skip
    table = RECIPE.table(Results(pd.DataFrame(rows), {}))
    assert [row[0] for row in table.rows] == [
        "GP of two terms, m = 2, amplified noise",
        "GP of two terms, no forgetting, amplified noise",
        "GP of two terms, m = 2, V1, by eye", "GP of two terms, no forgetting, V1, by eye",
    ]  # fmt: skip
    assert {len(row) for row in table.rows} == {len(table.header)}
