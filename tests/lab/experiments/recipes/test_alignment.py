"""Timeline alignment: what it moves, and how alike starts are afterwards."""

import numpy as np

from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.alignment import RECIPE, AlignmentShifts


def test_alignment_brings_starts_and_middles_together(tmp_path):
    figures = AlignmentShifts().run(Run(tmp_path, Scale(sets=("A",))))
    assert [row["task"] for row in figures["rows"]] == ["basketball-v1", "curling", "fishing"]
    for row in figures["rows"]:
        for before, after in (row["start_sd_s"], row["middle_sd_s"]):
            assert after < 0.5 * before
    before, after = (np.array(figures["shown"][when]) for when in ("before", "after"))
    assert len(before) == len(after)
    assert after.shape[1] >= before.shape[1]
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.read_bytes().startswith(b"\x89PNG")
