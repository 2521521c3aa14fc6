"""Tests mirror modules: `src/simulators/b.py` is tested in `tests/test_b.py`."""

from pathlib import Path

FOLDER = Path(__file__).parents[1]


def test_every_module_has_its_test_file():
    for path in (FOLDER / "src" / "simulators").glob("*.py"):
        if not path.stem.startswith("__") and path.stem != "served":  # which every test uses
            assert (FOLDER / "tests" / f"test_{path.name}").is_file(), path.name
