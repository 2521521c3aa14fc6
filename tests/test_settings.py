"""Settings keep to their annotations: what is out of range is named."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.settings import Checked, Count, NonNegative, Positive


@dataclass(frozen=True)
class Inner(Checked):
    widths: tuple[Count, ...] = (1, 2)


@dataclass(frozen=True)
class Outer(Checked):
    steps: Count = 1
    rate: Positive = 0.1
    margin: NonNegative = 0.0
    inner: Inner = field(default_factory=Inner)
    memory: Count | None = None
    ends: tuple[float, float] = (0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("steps", 0),
        ("steps", 2.5),
        ("steps", "3"),
        ("rate", 0.0),
        ("rate", float("inf")),
        ("margin", -1e-9),
        ("margin", float("nan")),
        ("inner", 3),
        ("ends", (0.0, float("inf"))),
        ("ends", (0.0, 1.0, 2.0)),
        ("ends", 1.0),
        ("memory", 0),
    ],
)
def test_what_is_out_of_range_is_named_with_its_value(name, value):
    with pytest.raises(ConfigurationError, match=rf"{name}: .*, got "):
        Outer(**{name: value})


def test_what_is_in_range_is_kept():
    made = Outer(steps=np.int64(3), rate=np.float64(0.5), margin=1, memory=None)
    assert (made.steps, made.rate, made.margin) == (3, 0.5, 1)


def test_ends_may_be_of_numpy_and_a_list_and_cannot_be_changed_later():
    assert Outer(ends=tuple(np.array([0.5, 2.0]))).ends == (0.5, 2.0)
    assert Outer(ends=[0.5, 2.0]) == Outer(ends=(0.5, 2.0))
    assert hash(Outer(ends=[0.5, 2.0])) == hash(Outer(ends=(0.5, 2.0)))


def test_settings_within_settings_check_themselves():
    with pytest.raises(ConfigurationError, match="widths"):
        Outer(inner=Inner(widths=(0,)))
