"""What the gate says of a plan: one line a check, with its worst place and its margin."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from prior_reinforce.errors import RobotLimitError

Status = Literal["pass", "warn", "refuse", "unchecked"]
_MARK: dict[Status, str] = {
    "pass": "ok    ",
    "warn": "WARN  ",
    "refuse": "REFUSE",
    "unchecked": "  -   ",
}


@dataclass(frozen=True, kw_only=True)
class LimitLine:
    """One check with its worst place; numbers are None where nothing could be checked."""

    check: str
    """`joints`, `position`, `velocity`, `acceleration`, `jerk`, `rest at start`, `rest at end`,
    `demonstrations` or `box`."""
    status: Status
    """`unchecked` where the plan, the robot or the settings lack what the check needs."""
    value: float | None = None
    """The plan's worst value, in `unit`."""
    limit: float | None = None
    """What it is held against, in `unit`."""
    margin: float | None = None
    """How far within the limit, in `unit`; negative beyond it."""
    unit: str = ""
    """Unit of the three numbers."""
    joint: str | None = None
    """Joint or axis of the worst place."""
    time: float | None = None
    """Time of the worst place from the plan's first frame, in [s]."""
    text: str
    """The same for a person, without the check's name."""


@dataclass(frozen=True)
class LimitReport:
    """All checks of one plan against one robot."""

    robot: str
    """Which arm."""
    firmware: str
    """Which firmware the limits are for."""
    source: str
    """Where the limits are published."""
    lines: tuple[LimitLine, ...]
    """The checks, always all of them and in the same order."""

    @property
    def refused(self) -> bool:
        """Whether any line refuses the plan."""
        return any(line.status == "refuse" for line in self.lines)

    @property
    def warned(self) -> bool:
        """Whether any line warns."""
        return any(line.status == "warn" for line in self.lines)

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Names of the checks that could not be made."""
        return tuple(line.check for line in self.lines if line.status == "unchecked")

    def text(self) -> str:
        """Return a readable report: a verdict and a line a check."""
        if self.refused:
            verdict = "refused"
        elif "velocity" in self.unchecked:
            verdict = "NOT CHECKED for the arm"
        else:
            verdict = "passes with warnings" if self.warned else "passes"
        head = f"plan {verdict}: limits of {self.robot} (firmware {self.firmware}) at 1 kHz"
        return "\n".join(
            [head, *(f"  {_MARK[line.status]} {line.check:<14} {line.text}" for line in self.lines)]
        )

    def as_json(self) -> dict[str, Any]:
        """Return the same as plain data, ready for `json.dumps`."""
        verdicts = {"refused": self.refused, "warned": self.warned, "unchecked": [*self.unchecked]}
        lines = [asdict(line) for line in self.lines]
        about = {"robot": self.robot, "firmware": self.firmware, "source": self.source}
        return about | verdicts | {"lines": lines}

    def require(self) -> None:
        """Do nothing if the plan may leave.

        Raises:
            RobotLimitError: The plan is refused; the message names check, joint, time and margin.
        """
        refusals = [f"{line.check}: {line.text}" for line in self.lines if line.status == "refuse"]
        if refusals:
            raise RobotLimitError(
                f"plan refused for {self.robot}: " + "; ".join(refusals) + ". It is never clamped "
                "or retimed: choose another goal, learn another way (another --generator or "
                "--seed), or demonstrate gentler motions"
            )
