"""Recordings that several test files read."""

import pytest

from tests.arm.recordings.recorded import write_csv


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Six CSV throws without outcomes; copy nothing into it."""
    return write_csv(tmp_path_factory.mktemp("throws"))
