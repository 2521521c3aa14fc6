"""Checks of a plan's joints against the maker's limits: all there, position and so on, and rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from prior_reinforce.plans.interpolation import FineMotion
from prior_reinforce.plans.motions import Plan
from prior_reinforce.robots.limits import RobotLimits
from prior_reinforce.robots.matching import missing_joints
from prior_reinforce.robots.report import LimitLine, Status, unchecked
from prior_reinforce.robots.settings import GateSettings


@dataclass(frozen=True, eq=False)
class JointChecks:
    """The four checks of the fine joint motion."""

    columns: dict[int, int]
    """Column of the plan by index of the robot's joint."""
    limits: RobotLimits
    """Of the robot."""
    fine: FineMotion
    """The plan at 1 kHz."""
    settings: GateSettings
    """Where a line warns."""

    def lines(self) -> list[LimitLine]:
        """Position, velocity, acceleration and jerk, each at its worst joint and time."""
        if not self.columns:
            why = f"the plan has no column named like {self.limits.joint_names[0]}"
            return [
                unchecked(name, why) for name in ("position", "velocity", "acceleration", "jerk")
            ]
        rows, picked = list(self.columns), list(self.columns.values())
        q, dq = self.fine.q[:, picked], self.fine.dq[:, picked]
        low, high = self._velocity_bounds(q, rows)
        bound = np.where(dq < 0, -low, high)
        return [
            self._position(q, rows),
            self._rate("velocity", "rad/s", dq, bound, rows),
            self._rate(
                "acceleration",
                "rad/s^2",
                self.fine.ddq[:, picked],
                np.broadcast_to(self.limits.acceleration[rows], q.shape),
                rows,
            ),
            self._rate(
                "jerk",
                "rad/s^3",
                self.fine.dddq[:, picked],
                np.broadcast_to(self.limits.jerk[rows], q.shape),
                rows,
            ),
        ]

    def _velocity_bounds(self, q: np.ndarray, rows: list[int]) -> tuple[np.ndarray, np.ndarray]:
        everywhere = np.zeros((q.shape[0], len(self.limits.joint_names)))
        everywhere[:, rows] = q
        low, high = self.limits.velocity_bounds(everywhere)
        return low[:, rows], high[:, rows]

    def _position(self, q: np.ndarray, rows: list[int]) -> LimitLine:
        lower, upper = self.limits.lower[rows], self.limits.upper[rows]
        distance = np.minimum(q - lower, upper - q)
        sample, joint = np.unravel_index(int(np.argmin(distance)), distance.shape)
        margin, value = float(distance[sample, joint]), float(q[sample, joint])
        near_low = value - lower[joint] < upper[joint] - value
        limit = float(lower[joint] if near_low else upper[joint])
        status: Status = "pass"
        if margin <= 0:
            status = "refuse"
        elif margin < self.settings.position_margin:
            status = "warn"
        name, time = self.limits.joint_names[rows[joint]], float(self.fine.t[sample])
        where = "beyond" if margin <= 0 else "from"
        text = (
            f"{name} at {value:.3f} rad, {abs(margin):.3f} {where} its end {limit:.3f}, "
            f"at {time:.3f} s"
        )
        return LimitLine("position", status, value, limit, margin, "rad", name, time, text)

    def _rate(
        self,
        check: str,
        unit: str,
        values: np.ndarray,
        bound: np.ndarray,
        rows: list[int],
    ) -> LimitLine:
        # Next to a stop the bound is 0; a joint that rests there (to rounding) breaks nothing.
        used = np.where(np.abs(values) < 1e-6, 0.0, np.abs(values) / np.maximum(bound, 1e-12))
        sample, joint = np.unravel_index(int(np.argmax(used)), used.shape)
        share = float(used[sample, joint])
        value, limit = float(values[sample, joint]), float(bound[sample, joint])
        margin = limit - abs(value)
        status: Status = "pass"
        if share >= 1:
            status = "refuse"
        elif share > self.settings.warn_above:
            status = "warn"
        name, time = self.limits.joint_names[rows[joint]], float(self.fine.t[sample])
        here = " at that position" if check == "velocity" and self.limits.envelopes else ""
        text = (
            f"{name} at {abs(value):.4g} {unit}, {100 * share:.0f} % of {limit:.4g}{here}, "
            f"at {time:.3f} s"
        )
        return LimitLine(check, status, abs(value), limit, margin, unit, name, time, text)


def check_joints(columns: dict[int, int], limits: RobotLimits, settings: GateSettings) -> LimitLine:
    """Whether the plan has a column for every joint, but for those left out on purpose.

    Raises:
        ConfigurationError: `absent_joints` names no joint of the robot, or one that the plan moves.
    """
    missing = missing_joints(columns, limits, settings.absent_joints)
    n, all_ = len(columns), len(limits.joint_names)
    if missing:
        text = f"not in the plan, so not checked: {', '.join(missing)}"
    elif settings.absent_joints:
        text = f"{n} of {all_}, without {', '.join(settings.absent_joints)} on purpose"
    else:
        text = f"all {all_} are in the plan"
    status: Status = "warn" if missing else "pass"
    first = missing[0] if missing else None
    return LimitLine(
        "joints", status, float(len(missing)), 0.0, 0.0 - len(missing), "1", first, None, text
    )


def check_rest(
    check: str,
    plan: Plan,
    columns: dict[int, int],
    limits: RobotLimits,
    settings: GateSettings,
    *,
    first: bool,
) -> LimitLine:
    """Speed over the first or the last interval between two frames, which should be rest.

    The spline brings the arm to rest there in any case; what this measures is whether the plan
    itself does, or leaves the braking to the step where the pose is held.
    """
    if not columns:
        return unchecked(check, f"the plan has no column named like {limits.joint_names[0]}")
    picked = list(columns.values())
    frames = plan.actions[:2] if first else plan.actions[-2:]
    speeds = np.abs(frames[1] - frames[0])[picked] / plan.format.dt
    worst = int(np.argmax(speeds))
    speed, limit = float(speeds[worst]), settings.rest_speed
    name = limits.joint_names[list(columns)[worst]]
    time = 0.0 if first else (plan.horizon - 1) * plan.format.dt
    status: Status = "pass" if speed <= limit else "refuse"
    text = f"{name} moves at {speed:.3g} rad/s, at most {limit:g} counts as rest"
    return LimitLine(check, status, speed, limit, limit - speed, "rad/s", name, time, text)
