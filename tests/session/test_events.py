"""Events as they stand in a journal."""

import msgspec
import pytest

from prior_reinforce.readings import Reading
from prior_reinforce.session.events import Amended, Asked, GoalSet, Told, Voided

SessionEvent = GoalSet | Asked | Told | Amended | Voided


def test_an_event_is_an_object_that_names_its_kind():
    event = Asked(trial=1, goal=1, condition=[0.9, 0.1])
    assert msgspec.json.decode(msgspec.json.encode(event)) == {
        "kind": "asked",
        "trial": 1,
        "goal": 1,
        "condition": [0.9, 0.1],
    }


def test_an_event_is_read_back_as_what_it_was():
    record = Reading.by_eye([0.05, 0.0]).record()
    for event in (
        Told(trial=1, reading=record, hit=False),
        Amended(trial=1, reading=record, hit=True),
    ):
        again = msgspec.json.decode(msgspec.json.encode(event), type=SessionEvent)
        assert type(again) is type(event)
        assert again == event


@pytest.mark.parametrize(
    "text",
    [
        '{"kind": "asked", "trial": 1, "goal": 1}',
        '{"kind": "asked", "trial": 1.5, "goal": 1, "condition": []}',
        '{"kind": "voided", "trial": 1, "reason": "", "hit": true}',
        '{"kind": "unknown"}',
    ],
    ids=["a field lacks", "a wrong type", "an unknown field", "an unknown kind"],
)
def test_what_is_no_event_is_refused(text):
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(text, type=SessionEvent)
