"""Settings that keep to their annotations: bounds stand in a field's type.

So the command line, a saved model and a constructor all keep to them, and none checks by hand.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, get_type_hints

import msgspec
import numpy as np

from prior_reinforce.errors import ConfigurationError

Count = Annotated[int, msgspec.Meta(ge=1)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Positive = Annotated[float, msgspec.Meta(gt=0)]


@dataclass(frozen=True)
class Checked:
    """Settings that keep to their annotations, whoever makes them."""

    def __post_init__(self) -> None:
        """Check every setting by its annotation.

        Raises:
            ConfigurationError: One is of another type, or outside its range.
        """
        hints = get_type_hints(type(self), include_extras=True)
        for each in fields(self):
            value = getattr(self, each.name)
            value = value.item() if isinstance(value, np.generic) else value
            try:
                if isinstance(value, float) and not np.isfinite(value):
                    raise msgspec.ValidationError("Expected a finite number")
                if not isinstance(value, Checked):  # which has checked itself
                    msgspec.convert(value, hints[each.name])
            except msgspec.ValidationError as error:
                raise ConfigurationError(f"{each.name}: {error}, got {value!r}") from error
