"""A person at the terminal of this process."""

import sys

import pytest

from tests.commands.at_terminal import Person


@pytest.fixture
def person(monkeypatch):
    """Seat a person with these answers, in words or as a function that gives them."""
    monkeypatch.setenv("NO_COLOR", "1")
    seated = []

    def seat(*answers):
        seated.append(Person(*answers))
        monkeypatch.setattr(sys, "stdin", seated[-1].stdin)
        return seated[-1]

    yield seat
    for each in seated:
        each.close()
