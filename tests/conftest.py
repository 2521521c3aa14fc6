"""One BLAS thread: the tests' matrices are small, and spinning threads crawl on a busy machine."""

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """Hold for the whole run; torch sets its own number of threads."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
