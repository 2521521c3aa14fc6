"""Tests mirror modules: `src/prior_reinforce/a/b.py` is tested in `tests/a/test_b.py`.

A package's own file, `a/__init__.py`, has `tests/a/test_init.py` where it holds something.
"""

from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
SOURCE, TESTS = REPOSITORY / "src" / "prior_reinforce", REPOSITORY / "tests"

TESTED_ELSEWHERE = {
    "__main__": "one call, in test_cli",
    "adapters/base": "what the base does for all is in testing/test_adapters",
    "adapters/displaced_trials": "half of the adapter of adapters/test_bayesian",
    "adapters/moved_prior": "the prior of the model in adapters/test_moved",
    "adapters/moved_trials": "the trials of the model in adapters/test_moved",
    "arm/executing/base": "an interface, held to in arm/executing/test_drive",
    "arm/workspace/events": "what they add up to is in arm/workspace/test_state",
    "arm/workspace/folder": "what is one and what is not is in arm/workspace/test_workspace",
    "arm/workspace/reaching": "goals out of reach are in arm/workspace/test_declared",
    "arm/workspace/template": "what it writes is read in arm/workspace/test_manifest",
    "session/parts": "what a session loads is in session/test_session",
    "perception/base": "an interface, held to in testing/test_perception",
}
"""Modules without a test file of their own, and where they are tested instead."""

OF_THE_WHOLE = {
    "arm/recordings/made_up": "ten kinds of recordings made up by seeds, and what they hold",
    "arm/recordings/real_forms": "forms in which recorders write the same throws",
    "attacks/attacks": "generated attacks of every class: one table",
    "arm/console/page": "the page in a browser, from recordings to a hit",
    "commands/walk": "how many files and functions an `ask` passes through",
    "dependencies": "floors of libraries, and calls that would run code from data",
    "documentation": "what the docs show, run as it stands",
    "examples": "the examples as a reader runs them",
    "extending": "a new member of each family",
    "fr3_page": "the page of the FR3, from an empty folder to a hit on the simulated arm",
    "folders": "folders as labs have them, from recordings to a plan",
    "layout": "this file",
    "notebook": "the notebook as a reader runs it",
    "once": "one demonstration, from Python and on contact physics",
    "public": "what the package exports, and how little small commands load",
    "shapes": "the check of shapes that runs during the tests",
    "tiers": "which tests are quick, and which are run again",
    "tutorial": "the tutorial from top to bottom",
}
"""Test files of no single module, and what they are about."""


def modules():
    found = {str(path.relative_to(SOURCE).with_suffix("")) for path in SOURCE.rglob("*.py")}
    return {name.replace("__init__", "init") for name in found}


def mirrored():
    found = {path.relative_to(TESTS) for path in TESTS.rglob("test_*.py")}
    return {str(path.with_name(path.stem.removeprefix("test_"))) for path in found}


def mirror(name):
    """The test file of a module."""
    return f"tests/{Path(name).with_name(f'test_{Path(name).name}.py')}"


def test_every_module_has_its_test_file():
    untested = {name for name in modules() - mirrored() if Path(name).name != "init"}
    missing, stale = untested - set(TESTED_ELSEWHERE), set(TESTED_ELSEWHERE) - untested
    assert not missing, f"write {', '.join(map(mirror, sorted(missing)))}"
    assert not stale, f"take out of TESTED_ELSEWHERE: {', '.join(sorted(stale))}"


def test_every_test_file_has_its_module():
    alone = mirrored() - modules()
    orphans, gone = alone - set(OF_THE_WHOLE), set(OF_THE_WHOLE) - alone
    assert not orphans, (
        f"{', '.join(map(mirror, sorted(orphans)))}: rename after a module, or say in OF_THE_WHOLE "
        "what it is about"
    )
    assert not gone, f"write {', '.join(map(mirror, sorted(gone)))}, or take out of OF_THE_WHOLE"
