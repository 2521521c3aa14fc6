"""The notebook of the documentation runs, and prints what is stored in it."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[1] / "docs" / "first-goal.ipynb"
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d*)?")
_ROUNDED = 0.011
"""Numbers with decimals may differ by a unit in their last place on another machine."""


def printed(notebook):
    """What each cell prints."""
    return [
        "".join(out["text"] for out in cell.get("outputs", []) if out["output_type"] == "stream")
        for cell in notebook.cells
    ]


@pytest.mark.slow
def test_the_notebook_prints_what_is_stored_in_it(tmp_path):
    stored = nbformat.read(NOTEBOOK, as_version=4)
    again = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(again, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
    for was, now in zip(printed(stored), printed(again), strict=True):
        assert _NUMBER.sub("#", was).split() == _NUMBER.sub("#", now).split()
        numbers = [[float(number) for number in _NUMBER.findall(text)] for text in (was, now)]
        assert numbers[0] == pytest.approx(numbers[1], abs=_ROUNDED)
    assert any("HIT" in text for text in printed(stored))
