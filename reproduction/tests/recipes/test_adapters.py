"""The comparison of adapters, on few goals and with a generator that learns at once."""

import numpy as np
import pytest
from gathered import gather

from reproduction.recipes import Scale
from reproduction.recipes.adapters import RECIPE, units
from reproduction.results import FIRST, TRIALS, reached

SMALL = Scale(goals=2, seeds=(0,), sets=("A",), rounds=3)


@pytest.mark.slow
def test_adapters_that_move_nothing_share_the_first_throw_and_differ_after(tmp_path):
    # Of outcomes seen by eye: something is left to adapt.
    planned = units(SMALL, ("proportional,gain=0.8", "gp-two-term"), generator="dmp")
    results = gather(tmp_path, planned, "adapters")
    methods = results.by("method")
    ours, none = methods["GP of two terms, m = 2"], methods["no adapter"]
    np.testing.assert_array_equal(
        TRIALS.of(methods["proportional,gain=0.8"].frame),  # ours, set by hand
        TRIALS.of(methods["proportional, 0.8"].frame),
    )
    assert none.minus(methods["proportional, 0.8"], FIRST).value == 0.0
    assert ours.mean(reached(3)).value > none.mean(reached(3)).value
    table = RECIPE.table(results)
    assert [row[0] for row in table.rows][-2:] == ["no adapter", "proportional,gain=0.8"]
    assert {len(row) for row in table.rows} == {len(table.header)}
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()


def test_adapters_work_behind_what_was_learned_from_an_eyes_estimates():
    assert {unit.training.perception for unit, _ in units(Scale())} == {"eye"}
