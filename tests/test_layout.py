"""Tests mirror modules: `src/prior_reinforce/a/b.py` is tested in `tests/a/test_b.py`."""

from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
SOURCE, TESTS = REPOSITORY / "src" / "prior_reinforce", REPOSITORY / "tests"

TESTED_ELSEWHERE = {
    "errors": "names only; every test of bad input raises them",
}
"""Modules without a test file of their own, and where they are tested instead."""

OF_THE_WHOLE = {
    "test_examples": "the examples as a reader runs them",
    "test_extending": "a new member of each family",
    "test_layout": "this file",
    "test_public": "what the package exports",
    "test_shapes": "the check of shapes that runs during the tests",
    "test_tutorial": "the tutorial from top to bottom",
}
"""Test files of no single module, and of what they are."""


def modules():
    found = {path.relative_to(SOURCE) for path in SOURCE.rglob("*.py")}
    return {str(path.with_suffix("")) for path in found if path.name != "__init__.py"}


def mirrored():
    found = {path.relative_to(TESTS) for path in TESTS.rglob("test_*.py")}
    return {str(path.with_name(path.name.removeprefix("test_")).with_suffix("")) for path in found}


def test_every_module_has_its_test_file():
    assert modules() - mirrored() == set(TESTED_ELSEWHERE)


def test_every_test_file_has_its_module():
    assert mirrored() - modules() == {name.removeprefix("test_") for name in OF_THE_WHOLE}
