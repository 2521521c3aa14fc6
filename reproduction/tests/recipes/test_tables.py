"""Tables: names before columns, and how a method stands beside ours."""

import pandas as pd

from reproduction.recipes.tables import Table, mean_of, table_by_round
from reproduction.results import TRIALS, Results


def rows(method, solved_at, sets=("A",)):
    """A row a goal of one training a set."""
    return [
        {"method": method, "learned_on": "t", "task": "t", "set": each, "seed": 0, "goal": j,
         "rounds": 10, "solved_at": at}
        for each in sets
        for j, at in enumerate(solved_at)
    ]  # fmt: skip


def both(sets=("A",)):
    """Rows of two methods."""
    made = rows("ours", [1, 2], sets) + rows("theirs", [2, 3], sets)
    return Results(pd.DataFrame(made), {}).by("method")


METHODS = both()


def test_a_row_has_its_names_and_then_what_each_column_shows():
    two = Table.of(("task", "seed"), {("cup", 1): [4, 5]}, {"sum": sum, "most": max})
    assert two == Table(("task", "seed", "sum", "most"), (("cup", "1", "9", "5"),))
    assert Table.of(("task",), {"cup": 2}, {"number": str}).rows == (("cup", "2"),)


def test_a_column_of_means_may_be_of_some_rows():
    assert mean_of(TRIALS)(METHODS["ours"]).value == 1.5
    assert mean_of(TRIALS, goal=1)(METHODS["ours"]).value == 2.0


def test_ours_is_not_compared_with_itself_and_with_nobody_where_it_was_not_run():
    # An interval is over sets; of one set there is none.
    for sets, interval in ((["A"], False), ([f"drawn{i}" for i in range(20)], True)):
        table = table_by_round(both(sets), "method", "ours")
        ours, theirs = (dict(zip(table.header, row, strict=True)) for row in table.rows)
        assert ours["by round 1"].partition(" ")[0] == "0.50"
        assert ("[" in ours["by round 1"]) == interval
        assert ours["ours minus it, trials"] == ""
        assert theirs["ours minus it, trials"].startswith("-1.00")
        assert theirs["learned from"] == f"{len(sets)} set" + "s" * interval
    alone = table_by_round({"theirs": METHODS["theirs"]}, "method", "ours")
    assert dict(zip(alone.header, alone.rows[0], strict=True))["ours minus it, trials"] == ""
