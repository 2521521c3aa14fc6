"""Tests mirror modules: `src/reproduction/a/b.py` is tested in `tests/a/test_b.py`."""

from pathlib import Path

FOLDER = Path(__file__).parents[1]
SOURCE = FOLDER / "src" / "reproduction"
TESTED_ELSEWHERE = {
    "generators/ways": "held to the contract in test_contracts, compared in recipes/test_ways",
}


def test_every_module_has_its_test_file():
    for path in SOURCE.rglob("*.py"):
        module = path.relative_to(SOURCE)
        if path.stem.startswith("__") or str(module.with_suffix("")) in TESTED_ELSEWHERE:
            continue
        if module.parts[0] == "demonstrations":  # every set is made again in one test
            continue
        test = FOLDER / "tests" / module.with_name(f"test_{module.name}")
        assert test.is_file(), f"write {test}"
