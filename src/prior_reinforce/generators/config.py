"""Settings of the generators that are networks, apart from them: read without torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import msgspec

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.codec import Representation
from prior_reinforce.settings import Checked, Count, NonNegative, Positive

Activation = Literal["mish", "silu"]


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
    trend: Literal["affine", "zero"] = "affine"
    """The network learns what an affine function of the outcome leaves of codes, or all of them."""
    network: UNetSize = field(default_factory=_laptop)
    """Size of the U-Net."""
    training_steps: Count = 500
    """Optimiser steps."""
    learning_rate: Positive = 1e-3
    """Peak of the cosine schedule."""
    warmup_steps: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Steps in which the learning rate rises linearly."""
    weight_decay: NonNegative = 1e-6
    """Of AdamW."""
