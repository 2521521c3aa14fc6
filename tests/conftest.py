"""What holds for all tests: arrays have the shapes they are annotated with, and one thread each."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from jaxtyping import install_import_hook
from threadpoolctl import threadpool_limits

import tests.shapes  # noqa: F401  (the hook finds it by name)

# Before anything imports the package, or it stays unchecked.
install_import_hook("prior_reinforce", "tests.shapes.arrays_only")

# Threads that wait for each other by spinning crawl on a busy machine; two test processes are one.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MUJOCO_GL", "egl")


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """The tests' matrices are small; torch sets its own number of threads."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start the longest tests first, or one process waits for them in the end."""
    items.sort(key=lambda item: item.path.suffix != ".ipynb" and item.path.stem != "test_tutorial")
