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
        ("memory", 0),
    ],
)
def test_what_is_out_of_range_is_named_with_its_value(name, value):
    with pytest.raises(ConfigurationError, match=rf"{name}: .*, got "):
        Outer(**{name: value})


def test_what_is_in_range_is_kept():
    made = Outer(steps=np.int64(3), rate=np.float64(0.5), margin=1, memory=None)
    assert (made.steps, made.rate, made.margin) == (3, 0.5, 1)


def test_settings_within_settings_check_themselves():
    with pytest.raises(ConfigurationError, match="widths"):
        Outer(inner=Inner(widths=(0,)))
