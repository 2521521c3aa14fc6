"""The gate: every plan that leaves the program is held against the robot's limits at 1 kHz.

It refuses or warns. It never clamps and never retimes: a retimed throw is another throw.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from prior_reinforce.motions import Demonstrations, Plan
from prior_reinforce.robots.limits import RobotLimits

Status = Literal["pass", "warn", "refuse", "unchecked"]


@dataclass(frozen=True)
class GateSettings:
    """Where the gate draws its own lines."""

    workspace_low: tuple[float, float, float] | None = None
    """Lowest corner that the tool tip may reach, [m], base frame; None leaves the box unchecked."""
    workspace_high: tuple[float, float, float] | None = None
    """Highest corner that the tool tip may reach, [m], base frame."""
    tool_tip: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Tool tip in the flange's frame, [m]."""


@dataclass(frozen=True)
class LimitLine:
    """One check with its worst place."""

    check: str
    status: Status
    value: float | None
    limit: float | None
    margin: float | None
    unit: str
    joint: str | None
    time: float | None
    text: str


@dataclass(frozen=True)
class LimitReport:
    """All checks of one plan."""

    robot: str
    firmware: str
    lines: tuple[LimitLine, ...]

    @property
    def refused(self) -> bool:
        """Whether any line refuses the plan."""
        return any(line.status == "refuse" for line in self.lines)

    def text(self) -> str:
        """Readable report, a line a check."""
        raise NotImplementedError

    def as_json(self) -> dict[str, Any]:
        """The same as plain data for the journal."""
        raise NotImplementedError

    def require(self) -> None:
        """Do nothing if the plan may leave.

        Raises:
            RobotLimitError: The plan is refused; the message names check, joint, time and margin.
        """
        raise NotImplementedError


def check_plan(
    plan: Plan,
    limits: RobotLimits,
    demonstrations: Demonstrations | None = None,
    settings: GateSettings = GateSettings(),  # noqa: B008 - frozen
) -> LimitReport:
    """Hold a plan against the limits, at rest before and after, sampled at 1 kHz."""
    raise NotImplementedError
