"""Timeline alignment: what it moves, and how alike starts are afterwards."""

from gathered import gather

from reproduction.recipes import Scale
from reproduction.recipes.alignment import RECIPE


def test_alignment_brings_starts_and_middles_together(tmp_path):
    results = gather(tmp_path, RECIPE.units(Scale(sets=("A",)), ()), "alignment")
    table = RECIPE.table(results)
    assert [row[0] for row in table.rows] == ["basketball-v1", "curling", "fishing"]
    for row in table.rows:
        before_start, start, before_middle, middle = map(float, row[3:])
        assert start < 0.5 * before_start
        assert middle < 0.5 * before_middle
    assert table.rows[0][2] == "0.28"  # [s]
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.read_bytes().startswith(b"\x89PNG")
