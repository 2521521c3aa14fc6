"""What the gate says of a plan: one line a check, with its worst place and its margin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import RobotLimitError

Samples = Float[np.ndarray, "T d"]
"""Values of d joints or axes at T times."""
Times = Float[np.ndarray, " T"]
"""Times of T samples, in [s]."""

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
    `range`, `speed` (of columns that are no joints), `tempo` (of moved demonstrations),
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


def worst_place(
    check: str,
    unit: str | Sequence[str],
    says: str | Sequence[str],
    joints: Sequence[str],
    t: Times,
    value: Samples,
    limit: float | Float[np.ndarray, "*T d"],
    warn: float | Float[np.ndarray, " d"] = 1.0,
    used: Samples | None = None,
) -> LimitLine:
    """The worst place: of what refuses where anything does, else of what is nearest to warning.

    What is no number refuses. `unit` and `says` are one for all joints, or one each; in the line's
    text `{joint}`, `{value}`, `{unit}`, `{limit}`, `{margin}`, `{percent}`, `{time}` and `{within}`
    stand for those of the worst place. From `warn` times a limit on it warns, and from a share
    `used` of 1 on it refuses; that is value / limit if not given.
    """
    limits = np.broadcast_to(limit, value.shape)
    if used is None:
        used = np.where(value == 0, 0.0, value / np.maximum(limits, 1e-12))
    refuses, warns = ~(used < 1), used > warn
    status: Status = "refuse" if refuses.any() else "warn" if warns.any() else "pass"
    worst = used if status == "refuse" else used - warn
    at, joint = divmod(int(np.argmax(worst)), len(joints))
    distance, beyond = abs(float(limits[at, joint] - value[at, joint])), bool(refuses[at, joint])
    place: dict[str, Any] = {
        "value": float(value[at, joint]),
        "limit": float(limits[at, joint]),
        "unit": unit if isinstance(unit, str) else unit[joint],
        "joint": joints[joint],
        "time": float(t[at]),
    }
    percent = 100 * (place["value"] if unit == "1" else float(used[at, joint]))
    within = "beyond" if beyond else "within"
    says = says if isinstance(says, str) else says[joint]
    text = says.format(**place, margin=distance, percent=percent, within=within)
    margin = -distance if beyond else distance
    return LimitLine(check=check, status=status, margin=margin, text=text, **place)


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
    """The checks, always in the same order."""

    @property
    def refused(self) -> bool:
        """Whether any line refuses the plan."""
        return bool(self.refusals)

    @property
    def refusals(self) -> str:
        """What the lines that refuse it say, one after the other."""
        lines = (f"{line.check}: {line.text}" for line in self.lines if line.status == "refuse")
        return "; ".join(lines)

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
        missing = any(line.check == "joints" and line.status == "warn" for line in self.lines)
        if self.refused:
            verdict = "refused"
        elif "velocity" in self.unchecked:
            verdict = "NOT CHECKED for the arm"
        elif missing:
            verdict = "NOT CHECKED for every joint"
        else:
            verdict = "passes with warnings" if self.warned else "passes"
        head = f"plan {verdict}: limits of {self.robot} (firmware {self.firmware})"
        if self.unchecked:
            head += f"; not checked: {', '.join(self.unchecked)}"
        return "\n".join(
            [head, *(f"  {_MARK[line.status]} {line.check:<14} {line.text}" for line in self.lines)]
        )

    def as_json(self) -> dict[str, Any]:
        """Return the same as plain data, ready for `json.dumps`."""
        verdicts = {"refused": self.refused, "warned": self.warned, "unchecked": [*self.unchecked]}
        return asdict(self) | verdicts

    def require(self) -> None:
        """Do nothing if the plan may leave.

        Raises:
            RobotLimitError: The plan is refused; the message names check, joint, time and margin.
        """
        if self.refusals:
            moves_on = "rest at " in self.refusals
            raise RobotLimitError(
                f"plan refused for {self.robot}: {self.refusals}",
                remedy="plans are never clipped or slowed down: choose another goal, learn with "
                "another --generator, demonstrate gentler motions, or, if the recordings are "
                "noisy, import them "
                f"with {'--no-trim, which keeps their still ends, or with ' * moves_on}"
                "--smooth 20 or less",
            )
