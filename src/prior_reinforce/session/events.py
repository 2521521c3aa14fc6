"""Typed events of a session: everything that can happen to its goals and trials.

A log is a list of events that only grows; the current state is a fold over it
(`trials.SessionState`). In a journal on disk an event is a JSON object whose `kind` is the name of
its class, in snake case.
"""

from __future__ import annotations

import re
from typing import Any

import msgspec

from prior_reinforce.adapters.base import Expectation
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.readings import ReadingRecord


class Event(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    tag_field="kind",
    tag=lambda name: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower(),  # `goal_set`
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """Something that happened; never changed."""

    @property
    def kind(self) -> str:
        """Name of the event: `goal_set`, `told`."""
        return str(self.__struct_config__.tag)


class GoalSet(Event, frozen=True):
    """A goal was set; its fields are those of `trials.Goal`."""

    goal: list[float]
    format: OutcomeFormat
    carry_over: bool
    adapter: str = ""
    new_hardware: str | None = None


class Asked(Event, frozen=True):
    """A plan was returned to be executed."""

    trial: int
    goal: int
    """Number of the goal."""
    condition: list[float]
    """c = M(g)."""
    model: str = ""
    """Name of the model that generated the plan."""
    gate: dict[str, Any] | None = None
    """The gate's verdict as plain data (`Verdict.as_json`)."""
    expected: Expectation = Expectation()
    """See `trials.Trial.expected`."""


class Told(Event, frozen=True):
    """The reading of a trial was told."""

    trial: int
    reading: ReadingRecord
    hit: bool
    """Whether the goal was reached: seen directly, or judged by the perceived error."""


class Amended(Told, frozen=True):
    """The reading of a trial was corrected."""


class Voided(Event, frozen=True):
    """A trial was declared not to be data."""

    trial: int
    reason: str


class Entry(msgspec.Struct, frozen=True):
    """An event in a log."""

    id: int
    """Order of events, from 1."""
    event: Event
    time: str = ""
    """When it was written, ISO 8601, UTC; empty in memory."""

    @property
    def kind(self) -> str:
        """See `Event.kind`."""
        return self.event.kind
