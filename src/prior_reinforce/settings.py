"""Settings that keep to their annotations: bounds stand in a field's type.

So the command line, a saved model and a constructor all keep to them, and none checks by hand.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields
from typing import Annotated, Any, get_type_hints

import msgspec
import numpy as np

from prior_reinforce.errors import ConfigurationError, one_of

if sys.version_info >= (3, 11):
    import tomllib as tomllib
else:
    import tomli as tomllib  # noqa: F401  # read from here by all that reads TOML

Count = Annotated[int, msgspec.Meta(ge=1)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Positive = Annotated[float, msgspec.Meta(gt=0)]


@dataclass(frozen=True)
class Checked:
    """Settings that keep to their annotations, whoever makes them."""

    def __post_init__(self) -> None:
        """Check every setting by its annotation.

        ConfigurationError if one is of another type, or outside its range.
        """
        hints = get_type_hints(type(self), include_extras=True)
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, list):  # which another could change
                value = tuple(value)
                object.__setattr__(self, each.name, value)
            plain = tuple(map(_plain, value)) if isinstance(value, tuple) else _plain(value)
            numbers = plain if isinstance(plain, tuple) else (plain,)
            try:
                if any(isinstance(of, float) and not np.isfinite(of) for of in numbers):
                    raise msgspec.ValidationError("Expected a finite number")
                if not isinstance(value, Checked):  # which has checked itself
                    msgspec.convert(plain, hints[each.name])
            except msgspec.ValidationError as error:
                said = f"{each.name}: {error}, got {plain!r}{one_of(hints[each.name])}"
                raise ConfigurationError(said) from error


def _plain(value: Any) -> Any:
    """Python's number for one of numpy."""
    return value.item() if isinstance(value, np.generic) else value
