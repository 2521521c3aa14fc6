"""From recordings of any rate and length to plans of one time step and one horizon."""

from __future__ import annotations

import math
from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError


@dataclass(frozen=True)
class Preprocessing:
    """How recordings become plans. Time is never stretched: a retimed throw is another throw."""

    dt: float | None = None
    """Time between two frames of a plan, in [s]; None takes the recordings' median period."""
    horizon: int | None = None
    """Frames of every plan; None takes the longest recording's. Shorter ones hold their last pose;
    a longer one is an error, never cut."""
    trim: bool = True
    """Drop the still time before the first and after the last movement of each recording."""
    margin: float = 0.1
    """Still time that trimming keeps at either end, in [s]. Ours: enough for the plan to start
    and end at rest at 30 frames a second."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A value outside its range.
        """
        if self.dt is not None and not (math.isfinite(self.dt) and self.dt > 0):
            raise ConfigurationError(f"dt must be a positive number of seconds, got {self.dt}")
        if self.horizon is not None and self.horizon < 2:
            raise ConfigurationError(f"horizon must be at least 2 frames, got {self.horizon}")
        if not (math.isfinite(self.margin) and self.margin >= 0):
            raise ConfigurationError(f"margin must be 0 s or more, got {self.margin}")
