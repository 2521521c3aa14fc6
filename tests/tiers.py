"""Which tests `make quick`, `make test` and `make nightly` run.

quick     every test takes at most 0.1 s of processor time (`--most`), all of them under a minute
test      everything but what is nightly
nightly   attacks, kills, floods, simulated arms, the browser, the reproduction

    python -m tests.tiers

exits with 0 where all tests that failed last are nightly ones: these run programs, browsers and
arms by the clock, and may starve beside others.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

NIGHTLY = (
    "reproduction/tests",
    "simulators/tests",
    "tests/arm/console/test_camera.py",
    "tests/arm/console/test_guard.py",
    "tests/arm/console/test_page.py",
    "tests/arm/executing/test_lerobot.py",
    "tests/arm/executing/test_lerobot_bridge.py",
    "tests/arm/executing/test_ur.py",
    "tests/attacks",
    "tests/commands/test_questions.py",
    "tests/test_fr3_page.py",
    "tests/test_notebook.py",
    "tests/test_tutorial.py",
)
"""Folders and files of tests."""
NOT_QUICK = (
    "tests/adapters/test_bayesian.py",
    "tests/adapters/test_memory.py",
    "tests/adapters/test_moved.py",
    "tests/arm/console",
    "tests/arm/executing",
    "tests/arm/recordings/test_outcomes.py",
    "tests/arm/recordings/test_preview.py",
    "tests/arm/recordings/test_zarr.py",
    "tests/arm/robots/test_urdf_file.py",
    "tests/arm/workspace/test_declared.py",
    "tests/arm/workspace/test_execute.py",
    "tests/arm/workspace/test_report.py",
    "tests/arm/workspace/test_view.py",
    "tests/commands/test_importing.py",
    "tests/commands/test_learning.py",
    "tests/commands/test_outcome_questions.py",
    "tests/commands/test_photographs.py",
    "tests/commands/test_telling.py",
    "tests/commands/test_record.py",
    "tests/commands/test_simulated.py",
    "tests/commands/test_trials.py",
    "tests/commands/test_walk.py",
    "tests/generators/network",
    "tests/generators/test_auto.py",
    "tests/generators/test_equivariant.py",
    "tests/generators/test_patterns.py",
    "tests/generators/test_reach.py",
    "tests/generators/timing/test_evidence.py",
    "tests/perception/test_amplified.py",
    "tests/perception/test_bounded_replies.py",
    "tests/perception/test_camera.py",
    "tests/perception/test_vlm.py",
    "tests/perception/test_vlm_client.py",
    "tests/perception/test_vlm_reading.py",
    "tests/report",
    "tests/simulation",
    "tests/test_cli.py",
    "tests/test_environment.py",
    "tests/test_examples.py",
    "tests/test_extending.py",
    "tests/test_extras.py",
    "tests/test_folders.py",
    "tests/test_once.py",
    "tests/testing",
)
"""Folders and files whose tests start programs, learn, or throw in contact physics."""


def mark(items: Sequence[pytest.Item], root: str) -> None:
    """Mark tests `nightly` by where they stand, and `quick` what is neither that nor slow."""
    for item in items:
        path = os.path.relpath(item.path, root)
        nightly, other = (_within(path, places) for places in (NIGHTLY, NOT_QUICK))
        if nightly:
            item.add_marker("nightly")
        elif not other and item.get_closest_marker("slow") is None:
            item.add_marker("quick")


def _within(path: str, places: Sequence[str]) -> bool:
    return any(path == place or path.startswith(f"{place}/") for place in places)


def within(most: float) -> Iterator[None]:
    """Run a test, which fails where it took more processor time than that, in seconds.

    Processor time, its programs' included: what others do on the machine does not count.
    """
    before = sum(os.times()[:4])
    yield
    taken = sum(os.times()[:4]) - before
    if taken > most:
        pytest.fail(f"took {taken:.2f} s, more than {most} s: mark it slow", pytrace=False)


FAILED = Path(".pytest_cache/v/cache/lastfailed")
"""Where pytest keeps which tests failed."""


def only_nightly_failed(kept: Path = FAILED) -> bool:
    """Whether some tests failed, and each of them is nightly."""
    failed = json.loads(kept.read_text()) if kept.exists() else {}
    return bool(failed) and all(_within(test.split("::")[0], NIGHTLY) for test in failed)


if __name__ == "__main__":
    sys.exit(not only_nightly_failed())
