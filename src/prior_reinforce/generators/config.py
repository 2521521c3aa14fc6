"""Settings of the generators that are networks, apart from them: read without torch.

A bound stands in a field's annotation, so that the command line, a saved model and a constructor
all keep to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from typing import Annotated, Any, Literal, get_type_hints

import msgspec
import numpy as np

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.codec import Representation

Activation = Literal["mish", "silu"]
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
        hints = _hints(type(self))
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


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


@dataclass(frozen=True)
class UNetSize(Checked):
    """Everything that sets the size of a `ConditionalUNet`; the defaults are the reference's."""

    widths: tuple[Count, ...] = (256, 512, 1024)
    """Channels of each level; time is halved between two levels."""
    kernel: Count = 5
    """Frames that a convolution sees; odd."""
    groups: Count = 8
    """Of every group normalisation; divides each width."""
    step_width: Annotated[int, msgspec.Meta(ge=4, multiple_of=2)] = 256
    """Size of the embedding of the noise level; even, at least 4."""
    condition_width: Count = 256
    """Both layers of the condition's MLP."""
    activation: Activation = "mish"
    """Everywhere. SiLU is as good and takes a quarter of Mish's time on a CPU."""

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            ConfigurationError: One is outside its range, or they do not fit together.
        """
        super().__post_init__()
        if not self.widths or any(width % self.groups for width in self.widths):
            raise ConfigurationError(
                f"widths must be positive multiples of groups ({self.groups}), got {self.widths}"
            )
        if self.kernel % 2 == 0:
            raise ConfigurationError(f"kernel must be odd, got {self.kernel}")

    @property
    def length_multiple(self) -> int:
        """The number of frames must be a multiple of this."""
        return int(2 ** (len(self.widths) - 1))


def _laptop() -> UNetSize:
    return UNetSize(widths=(64, 128, 128), step_width=64, condition_width=64, activation="silu")


@dataclass(frozen=True)
class UNetConfig(Checked):
    """What all generators with a U-Net are set by; the defaults are sized for a laptop."""

    representation: Representation = "splines"
    """Code plans by spline control points where they fit, or by raw frames."""
    frames_per_point: Count = 4
    """Frames for each spline control point."""
    margin: NonNegative = 0.05
    """How far plans may leave the demonstrated range of a dimension, as a fraction of it."""
    network: UNetSize = field(default_factory=_laptop)
    """Size of the U-Net."""
    training_steps: Count = 1000
    """Optimiser steps."""
    learning_rate: Positive = 1e-3
    """Peak of the cosine schedule."""
    warmup_steps: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Steps in which the learning rate rises linearly."""
    weight_decay: NonNegative = 1e-6
    """Of AdamW."""
