"""Where the gate draws the lines that no maker publishes, and the box for the tool tip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.signals import REST_SPEED
from prior_reinforce.settings import Checked, NonNegative, Positive
from prior_reinforce.units import Kind, in_unit

_START: Mapping[Kind, float] = {"length": 0.01, "share": 0.05}
_WAY: Mapping[Kind, float] = {"length": 0.005, "share": 0.05}
"""As `GateSettings.start_error` and `tracking_error`, in [m] and [1]. Ours: for lengths what those
do at half a metre; a gripper that holds something stands some per cent off what it was told."""


@dataclass(frozen=True)
class GateSettings(Checked):
    """Where the gate draws the lines that no maker publishes, and the box for the tool tip."""

    warn_above: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.95
    """Share of a velocity, acceleration or jerk limit from which on the gate warns. Ours: a
    delayed cycle makes the robot extrapolate, which costs a few per cent of acceleration."""
    position_margin: NonNegative = 0.02
    """Distance from a joint's end that warns, in [rad]. Ours: about one degree."""
    rest_speed: NonNegative = REST_SPEED["angle"]
    """Speed over the first and the last frame's interval that is no rest any more, in [rad/s].
    Ours: the makers ask for exactly 0; a smooth start recorded at 30 frames/s shows 0.02. The jerk
    of the step into the hold is stricter where frames are close: at 80 frames/s, 0.05 rad/s asks
    for 14 000 rad/s^3."""
    beyond_warn: NonNegative = 0.1
    """How far beyond the demonstrations' band warns, as a share of the joint's demonstrated
    range. Ours."""
    beyond_refuse: float = 0.5
    """How far beyond the band refuses. Ours: half a range beyond what was ever shown is no
    variation of the demonstrated motion."""
    absent_joints: tuple[str, ...] = ()
    """Joints that plans leave out on purpose, because they stay where they are: nothing of them is
    checked. Any other joint without a column warns."""
    ranges: tuple[tuple[str, float, float], ...] = ()
    """Name, lowest and highest value of columns of plans, in their units, such as a gripper's.
    Others that are no joints are held against the demonstrations' range."""
    box_low: tuple[float, float, float] | None = None
    """Lowest corner that the tool tip may reach, [m], base frame; None leaves the box unchecked."""
    box_high: tuple[float, float, float] | None = None
    """Highest corner that the tool tip may reach, [m], base frame."""
    start_error: Positive = 0.02
    """How far a joint may stand from a plan's first frame when it is to begin, [rad]. Ours: about
    one degree, and what the FR3's interface refuses by itself is less."""
    tracking_error: Positive = 0.01
    """Distance of the executed from the planned motion, root mean square, [rad], from which on a
    reading is warned of. Ours: good servos stay below 4 mrad, one that lags 100 ms is at 90."""
    errors: tuple[tuple[str, Positive, Positive], ...] = ()
    """The same two for columns in other units: unit, at the start, on the way; see `errors_of`."""
    tool_tip: tuple[float, float, float] | None = None
    """Tool tip in the flange's frame of the maker's kinematics, [m]; the Franka hand's frame is
    turned by -45 degrees about its z axis. None keeps the flange in the box instead, and warns."""

    def errors_of(self, unit: str) -> tuple[float, float] | None:
        """How far columns of a unit may be off at the start, and on the way; None if not known."""
        given = {name: (start, way) for name, start, way in self.errors}
        start = in_unit({**_START, "angle": self.start_error}, unit)
        way = in_unit({**_WAY, "angle": self.tracking_error}, unit)
        return given.get(unit, None if start is None or way is None else (start, way))

    def __post_init__(self) -> None:
        """Check the settings.

        ConfigurationError if a value is of another type or outside its range, or there is half a
        box.
        """
        super().__post_init__()
        if self.beyond_warn > self.beyond_refuse:
            raise ConfigurationError(
                f"beyond_warn must be at most beyond_refuse, got {self.beyond_warn} and "
                f"{self.beyond_refuse}"
            )
        for unit, *both in self.errors:
            if not all(map(math.isfinite, both)):
                raise ConfigurationError(f"errors must be finite, got {both} for {unit}")
        for name, low, high in self.ranges:
            if not -math.inf < low < high < math.inf:
                raise ConfigurationError(
                    f"ranges must be [name, low, high] with low < high, got {name}, {low}, {high}"
                )
        if not np.all(np.isfinite(self.tool_tip or 0.0)):
            raise ConfigurationError(f"tool_tip must be three numbers in [m], got {self.tool_tip}")
        if (self.box_low is None) != (self.box_high is None):
            raise ConfigurationError("a box for the tool tip needs both corners: give low and high")
        if self.box_low and self.box_high and not np.all(np.less(self.box_low, self.box_high)):
            raise ConfigurationError(
                f"the box must have low < high in x, y and z, got {self.box_low}, {self.box_high}"
            )
