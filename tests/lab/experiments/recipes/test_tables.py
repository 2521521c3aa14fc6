"""Tables: names before columns, and how a method stands beside ours."""

import pandas as pd

from prior_reinforce.lab.experiments.recipes.tables import Table, mean_of, table_by_round
from prior_reinforce.lab.experiments.results import TRIALS, Results


def rows(method, solved_at):
    """A row a goal of one training."""
    return [
        {"method": method, "learned_on": "t", "task": "t", "set": "A", "seed": 0, "goal": j,
         "rounds": 10, "solved_at": at}
        for j, at in enumerate(solved_at)
    ]  # fmt: skip


METHODS = Results(pd.DataFrame(rows("ours", [1, 2]) + rows("theirs", [2, 3])), {}).by("method")


def test_a_row_has_its_names_and_then_what_each_column_shows():
    two = Table.of(("task", "seed"), {("cup", 1): [4, 5]}, {"sum": sum, "most": max})
    assert two == Table(("task", "seed", "sum", "most"), (("cup", "1", "9", "5"),))
    assert Table.of(("task",), {"cup": 2}, {"number": str}).rows == (("cup", "2"),)


def test_a_column_of_means_may_be_of_some_rows():
    assert mean_of(TRIALS)(METHODS["ours"]).value == 1.5
    assert mean_of(TRIALS, goal=1)(METHODS["ours"]).value == 2.0


def test_ours_is_not_compared_with_itself_and_with_nobody_where_it_was_not_run():
    table = table_by_round(METHODS, "method", "ours")
    ours, theirs = (dict(zip(table.header, row, strict=True)) for row in table.rows)
    assert ours["by round 1"].startswith("0.50 [")
    assert ours["ours minus it, trials"] == ""
    assert theirs["ours minus it, trials"].startswith("-1.00 [")
    assert theirs["trainings"] == "1 of 1 set"
    alone = table_by_round({"theirs": METHODS["theirs"]}, "method", "ours")
    assert dict(zip(alone.header, alone.rows[0], strict=True))["ours minus it, trials"] == ""
