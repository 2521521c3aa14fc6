"""What is said of recordings is one record, checked when it is made."""

import pytest
import tyro

from prior_reinforce.arm.recordings import FORMATS, ReadOptions
from prior_reinforce.errors import ConfigurationError


def test_every_format_stands_in_the_help():
    import inspect

    assert ", ".join(FORMATS) in inspect.getsource(ReadOptions)


def test_lists_become_tuples_of_texts_and_only_what_is_given_is_listed():
    options = ReadOptions(episodes=[3, "4"], key="q")
    assert options.given == {"episodes": ("3", "4"), "key": ("q",)}
    assert ReadOptions().given == {}


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"rate": 0.0}, "positive number of frames"),
        ({"rate": float("inf")}, "positive number of frames"),
        ({"time_unit": "minutes"}, "time-unit must be one of s, ms"),
        ({"delimiter": "dash"}, "delimiter must be one of comma"),
    ],
)
def test_values_are_checked(said, message):
    with pytest.raises(ConfigurationError, match=message):
        ReadOptions(**said)


def test_what_was_not_asked_for_is_left_out():
    options = ReadOptions(episodes=("a", "b"), leave_out=("b",))
    assert [options.leaves_out(name) for name in "abc"] == [False, True, True]


def test_the_key_may_be_given_again():
    assert tyro.cli(ReadOptions, args=["--key", "q", "--key", "grip"]).key == ("q", "grip")
    assert "key" not in tyro.cli(ReadOptions, args=[]).given
