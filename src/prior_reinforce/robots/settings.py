"""Where the gate draws the lines that no maker publishes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from prior_reinforce.errors import ConfigurationError


@dataclass(frozen=True)
class GateSettings:
    """The gate's own lines, and the box the tool tip must stay in."""

    warn_above: float = 0.95
    """Share of a velocity, acceleration or jerk limit from which on the gate warns. Ours: a
    delayed cycle makes the robot extrapolate, which costs a few per cent of acceleration."""
    position_margin: float = 0.02
    """Distance from a joint's end that warns, in [rad]. Ours: about one degree."""
    rest_speed: float = 0.05
    """Largest speed over the first and the last frame's interval that counts as rest, in [rad/s].
    Ours: the makers ask for exactly 0; a smooth start recorded at 30 frames/s shows 0.02. The jerk
    of the step into the hold is stricter where frames are close: at 80 frames/s, 0.05 rad/s asks
    for 14 000 rad/s^3."""
    beyond_warn: float = 0.1
    """How far beyond the demonstrations' band warns, as a share of the joint's demonstrated
    range. Ours."""
    beyond_refuse: float = 0.5
    """How far beyond the band refuses. Ours: half a range beyond what was ever shown is no
    variation of the demonstrated motion."""
    absent_joints: tuple[str, ...] = ()
    """Joints that plans leave out on purpose, because they stay where they are: nothing of them is
    checked. Any other joint without a column warns."""
    workspace_low: tuple[float, float, float] | None = None
    """Lowest corner that the tool tip may reach, [m], base frame; None leaves the box unchecked."""
    workspace_high: tuple[float, float, float] | None = None
    """Highest corner that the tool tip may reach, [m], base frame."""
    tool_tip: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Tool tip in the flange's frame of the maker's kinematics, [m]; the Franka hand's frame is
    turned by -45 degrees about its z axis."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A value outside its range, or half a box.
        """
        if not (0 < self.warn_above <= 1 and 0 <= self.beyond_warn <= self.beyond_refuse):
            raise ConfigurationError(
                "warn_above must be within (0, 1] and beyond_warn at most beyond_refuse, got "
                f"{self.warn_above}, {self.beyond_warn} and {self.beyond_refuse}"
            )
        if not (self.position_margin >= 0 and self.rest_speed >= 0):
            raise ConfigurationError(
                "position_margin and rest_speed must be 0 or more, got "
                f"{self.position_margin} and {self.rest_speed}"
            )
        if (self.workspace_low is None) != (self.workspace_high is None):
            raise ConfigurationError("a workspace box needs both corners: give low and high")
        if not np.all(np.isfinite(self.tool_tip)) or len(self.tool_tip) != 3:
            raise ConfigurationError(f"tool_tip must be three numbers in [m], got {self.tool_tip}")
        if self.workspace_low is not None and self.workspace_high is not None:
            box = np.array([self.workspace_low, self.workspace_high], dtype=float)
            if box.shape != (2, 3) or not np.all(box[0] < box[1]):
                raise ConfigurationError(
                    f"the workspace box must have low < high in x, y and z, got {box.tolist()}"
                )
