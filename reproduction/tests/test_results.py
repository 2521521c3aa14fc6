"""The table of raw results: what is written is read, paired, and averaged."""

import gzip

import numpy as np
import pandas as pd
import pytest

from prior_reinforce.errors import FileFormatError
from reproduction.results import (
    FIRST,
    TRIALS,
    Results,
    as_text,
    column,
    raw_path,
    reached,
    read_results,
    write_rows,
)


def rows(method, solved_at, task="hoop", learned_on="hoop", **more):
    """A row a goal, of solved_at by training and goal."""
    return [
        {
            "method": method, "task": task, "learned_on": learned_on, "set": "AB"[i], "seed": 0,
            "goal": j, "rounds": 10, "solved_at": at, "commit": "c0ffee", **more,
        }
        for i, of_training in enumerate(solved_at)
        for j, at in enumerate(of_training)
    ]  # fmt: skip


def results(*parts):
    return Results(pd.DataFrame([row for part in parts for row in part]), {})


def test_rows_are_read_as_they_were_written_and_equal_rows_give_equal_bytes(tmp_path):
    told = rows("gp-two-term", [[1, 0], [3, 2]], p_hit=as_text([0.21234, 0.9], 3))
    path = write_rows(tmp_path, "trials", told, "this command")
    first = path.read_bytes()
    assert write_rows(tmp_path, "trials", told, "this command").read_bytes() == first
    write_rows(tmp_path, "other", rows("gp-two-term", [[1]]), "another")
    read = read_results(tmp_path)
    assert read.made_by == {"trials": "this command", "other": "another"}
    one = read.where(recipe="trials")
    np.testing.assert_array_equal(TRIALS.of(one.frame), [1, 11, 3, 2])
    np.testing.assert_allclose(next(one.texts("p_hit")), [0.212, 0.9])
    # By nothing but pandas, as the docs say.
    alone = pd.read_csv(path, comment="#")
    assert alone["solved_at"].tolist() == [1, 0, 3, 2]


def test_a_goal_that_was_not_reached_counts_as_one_trial_more():
    of = results(rows("gp-two-term", [[1, 0], [3, 2]]))
    assert of.mean(TRIALS).value == pytest.approx((1 + 11 + 3 + 2) / 4)
    assert of.mean(FIRST).value == 0.25
    assert of.mean(reached(2)).value == 0.5
    assert of.mean(column("rounds")).value == 10


def test_a_difference_is_paired_over_what_both_have():
    ours = results(rows("ours", [[1, 2, 9], [3, 4, 9]]))
    fewer = results(rows("theirs", [[2, 3]]))  # one training, two goals
    difference = fewer.minus(ours, TRIALS)
    assert difference.value == 1.0
    assert np.isnan(ours.minus(ours.where(method="nobody"), TRIALS).value)
    assert f"{ours.minus(ours.where(method='nobody'), TRIALS):+.2f}" == ""


def test_tasks_of_one_set_of_demonstrations_share_trainings_and_weigh_alike():
    first = rows("gp-two-term", [[1], [3]])
    second = rows("gp-two-term", [[2], [4]], task="cup")  # learned from the hoop's demonstrations
    other = rows("gp-two-term", [[10], [10]], task="slide", learned_on="slide")
    assert results(first, second, other).mean(TRIALS).value == pytest.approx((2 + 3 + 10) / 3)


def test_a_training_that_is_not_done_is_left_out():
    partly = results(rows("gp-two-term", [[1, 1], [5]]))
    assert partly.mean(TRIALS).value == 1.0
    assert partly.sets == 2


def test_more_seeds_are_not_more_sets_of_demonstrations():
    of = results(rows("gp-two-term", [[1], [3]]), rows("gp-two-term", [[5]], seed=1))
    assert of.trained == "2 sets, 3 trainings"
    assert of.where(seed=0).trained == "2 sets"


def test_an_interval_is_of_sets_and_there_is_none_of_two_however_often_they_are_learned():
    """What a hundred more trainings of a set would not tell cannot make an interval narrower."""
    rng = np.random.default_rng(0)
    three = pd.DataFrame(rows("ours", rng.integers(1, 9, (2, 30))) + [
        {**row, "set": "C"} for row in rows("ours", rng.integers(1, 9, (1, 30)))
    ])  # fmt: skip
    more = pd.concat([three.assign(seed=seed) for seed in range(40)])
    once, often = (Results(frame, {}).mean(TRIALS) for frame in (three, more))
    assert (often.value, often.low, often.high) == pytest.approx((once.value, once.low, once.high))
    few = Results(more, {}).where(set=("A", "B")).mean(TRIALS)
    assert not few.known
    assert format(few, ".1f") == f"{few.value:.1f}"


def test_rows_are_told_apart_by_columns_in_their_order():
    both = results(rows("b", [[1]]), rows("a", [[2]]))
    assert list(both.by("method")) == ["b", "a"]
    assert both.where(method=("a", "c")).n == 1
    assert both.where(nothing="x").empty


@pytest.mark.parametrize(
    "content",
    [b"", b"no gzip", gzip.compress(b"# c\n"), gzip.compress(b"# c\nrecipe\nother\n")],
    ids=["empty", "no gzip", "no table", "another recipe"],  # gzip has the time in its bytes
)
def test_a_damaged_file_is_named_with_its_remedy(tmp_path, content):
    path = raw_path(tmp_path, "adapters")
    path.parent.mkdir()
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=r"adapters\.csv\.gz.*reproduction adapters"):
        read_results(tmp_path)
