"""Settings of U-Net regression."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, get_args

from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.unet_size import UNetSize
from prior_reinforce.plans.codec import Representation


@dataclass(frozen=True)
class UNetRegressionConfig:
    """Everything that decides what `UNetRegression` learns; docs/baselines.md tells what was tried.

    Network and representation default to the diffusion generator's, so that the two differ in
    nothing but diffusion.
    """

    representation: Representation = "splines"
    """Code plans by spline control points where they fit, or by raw frames."""
    frames_per_point: int = 4
    """Frames for each spline control point."""
    start_times: bool = True
    """Predict when the motion starts as a number of its own, as the diffusion generator does."""
    margin: float = 0.05
    """How far plans may leave the demonstrated range of a dimension, as a fraction of it."""
    network: UNetSize = field(
        default_factory=lambda: UNetSize(
            widths=(64, 128, 128), step_width=64, condition_width=64, activation="silu"
        )
    )
    """Size of the U-Net."""
    training_steps: int = 800
    """Optimiser steps, each on all demonstrations."""
    learning_rate: float = 3e-3
    """Peak of the cosine schedule, which starts there and ends at 0."""
    weight_decay: float = 2.0
    """Of AdamW. Large, because a network that meets six demonstrations to a milliradian ripples
    between them: with next to none the error at new goals was three times as large."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if self.representation not in get_args(Representation):
            raise ConfigurationError(
                f"representation must be one of {get_args(Representation)}, "
                f"got {self.representation!r}"
            )
        for name in ("frames_per_point", "training_steps"):
            if getattr(self, name) < 1:
                raise ConfigurationError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not self.learning_rate > 0:
            raise ConfigurationError(f"learning_rate must be positive, got {self.learning_rate}")
        for name in ("margin", "weight_decay"):
            if not getattr(self, name) >= 0:
                raise ConfigurationError(f"{name} must not be negative, got {getattr(self, name)}")

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """Rebuild the settings from `dataclasses.asdict`, which JSON turned tuples of to lists."""
        network = dict(values["network"])
        network["widths"] = tuple(network["widths"])
        return cls(**{**values, "network": UNetSize(**network)})
