"""Which failed tests may be run again."""

import json

import pytest

from tests.tiers import only_nightly_failed

PAGE = "tests/arm/console/test_page.py::test_an_event_is_drawn_once"


@pytest.mark.parametrize(
    ("failed", "again"),
    [
        ([PAGE], True),
        ([PAGE, "tests/test_units.py::test_a_unit"], False),
        (["tests/test_units.py"], False),
        ([], False),
    ],
)
def test_only_what_runs_by_the_clock_is_run_again(tmp_path, failed, again):
    kept = tmp_path / "lastfailed"
    kept.write_text(json.dumps(dict.fromkeys(failed, True)))
    assert only_nightly_failed(kept) == again


def test_a_run_that_ended_before_any_test_failed_is_not_repeated(tmp_path):
    assert not only_nightly_failed(tmp_path / "lastfailed")
