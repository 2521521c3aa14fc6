"""A command's text: split without a shell, and kept without its arguments."""

from pathlib import Path

import pytest

from prior_reinforce.arm.executing.arguments import (
    check_command,
    split_command,
    without_arguments,
)
from prior_reinforce.errors import ConfigurationError


def test_the_path_stays_one_argument_whatever_is_in_it():
    plan = Path("/it's; touch $(oops)/plan 1.npz")
    arguments = split_command("controller --plan={plan} --speed 1", plan)
    assert arguments == ("controller", f"--plan={plan}", "--speed", "1")


def test_a_folder_may_be_called_like_a_place():
    arguments = split_command("c {plan} {result}", Path("/a{result}b/p"), Path("/a{plan}b/r"))
    assert arguments == ("c", "/a{result}b/p", "/a{plan}b/r")


@pytest.mark.parametrize(
    "secret",
    [
        *("--password hunter2", "--password=hunter2", "-p hunter2", "--pwd hunter2"),
        *("--user=a:hunter2", "TOKEN=hunter2", "-H 'Authorization: Bearer hunter2'"),
        *('\'{"password": "hunter2"}\'', "https://h/?token=hunter2", "'password: hunter2'"),
    ],
)
def test_no_argument_of_a_persons_own_goes_to_the_journal(secret):
    kept = without_arguments(f"arm {secret} --plan={{plan}} {{result}}")
    assert "hunter" not in kept
    assert kept.startswith("arm ...")
    assert kept.endswith("{plan} {result}")


def test_where_what_is_started_cannot_be_found_again_nothing_is(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(ConfigurationError, match=r"on Linux only, .*write the plan with --out"):
        check_command("true {plan}", time_limit=1.0)
