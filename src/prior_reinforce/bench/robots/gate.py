"""The gate: every plan that leaves the program is held against the robot's limits at 1 kHz.

It refuses or warns. It never clamps and never retimes: a retimed throw is another throw. It is no
safety function: torques, collisions and people in reach are not its business.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.bench.robots.kinematics import tool_tip
from prior_reinforce.bench.robots.limits import PerJoint, RobotLimits, match_joints, missing_joints
from prior_reinforce.bench.robots.report import LimitLine, LimitReport, Status
from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.interpolation import RATE, interpolate, join_frames
from prior_reinforce.plans.motions import Demonstrations, Plan

_BEYOND_SHOWN = 1.5
"""Share of the demonstrations' largest acceleration or jerk from which on the gate warns, where the
maker publishes no limit. Ours: between demonstrations, a plan exceeds each of them by less."""
_HOLD = 0.01
"""Held before and after the motion, in [s], so that the steps where they meet are seen."""
_NO_BOX = (
    "no box given, so the table is not looked at: set tool_tip, workspace_low and workspace_high "
    "in [gate]"
)

Samples = Float[np.ndarray, "T d"]
"""Of d joints or axes at T times, 1 ms apart."""
Times = Float[np.ndarray, " T"]
"""Of as many samples, in [s]."""
Ends = Float[np.ndarray, " d"]
"""Lower or upper ends of d ranges."""


@dataclass(frozen=True)
class GateSettings:
    """Where the gate draws the lines that no maker publishes, and the box for the tool tip."""

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
    box_low: tuple[float, float, float] | None = None
    """Lowest corner that the tool tip may reach, [m], base frame; None leaves the box unchecked."""
    box_high: tuple[float, float, float] | None = None
    """Highest corner that the tool tip may reach, [m], base frame."""
    start_error: float = 0.02
    """How far a joint may stand from a plan's first frame when it is to begin, [rad]. Ours: about
    one degree, and what the FR3's interface refuses by itself is less."""
    tracking_error: float = 0.01
    """Distance of the executed from the planned motion, root mean square, [rad], from which on a
    reading is warned of. Ours: good servos stay below 4 mrad, one that lags 100 ms is at 90."""
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
        if not (self.start_error > 0 and self.tracking_error > 0):
            raise ConfigurationError(
                "start_error and tracking_error must be more than 0, got "
                f"{self.start_error} and {self.tracking_error}"
            )
        if not (self.position_margin >= 0 and self.rest_speed >= 0):
            raise ConfigurationError(
                "position_margin and rest_speed must be 0 or more, got "
                f"{self.position_margin} and {self.rest_speed}"
            )
        if len(self.tool_tip) != 3 or not np.all(np.isfinite(self.tool_tip)):
            raise ConfigurationError(f"tool_tip must be three numbers in [m], got {self.tool_tip}")
        if self.box_low is None and self.box_high is None:
            return
        if self.box_low is None or self.box_high is None:
            raise ConfigurationError("a box for the tool tip needs both corners: give low and high")
        box = np.array([self.box_low, self.box_high], dtype=float)
        if box.shape != (2, 3) or not np.all(box[0] < box[1]):
            raise ConfigurationError(
                f"the box must have low < high in x, y and z, got {box.tolist()}"
            )


def check_plan(
    plan: Plan,
    limits: RobotLimits,
    demonstrations: Demonstrations | None = None,
    settings: GateSettings | None = None,
) -> LimitReport:
    """Hold a plan against the limits, at rest before and after, sampled at 1 kHz.

    Args:
        plan: What is to be executed. Its columns are matched to the robot's joints by name
            (`joint4` also matches `panda_joint4`); columns that are no joint of it, such as a
            gripper, are only held against the demonstrations. A joint without a column cannot be
            checked, which warns unless `settings.absent_joints` names it.
        limits: Of the robot.
        demonstrations: What was shown; None leaves the distance from them unchecked.
        settings: Where the gate draws its own lines; None takes the defaults.

    Returns:
        Nine lines: joints in the plan, position, velocity, acceleration, jerk, rest at either end,
        distance from the demonstrations, box for the tool tip.

    Raises:
        InvalidPlanError: A joint in another unit than [rad], two columns that look like one joint,
            frames closer than the arm's cycles, or demonstrations of another format.
        ConfigurationError: `absent_joints` names no joint of the robot, or one that the plan moves.
    """
    settings = settings or GateSettings()
    if plan.format.dt < (1 - 1e-9) / RATE:
        raise InvalidPlanError(
            f"a frame every {plan.format.dt:g} s is closer than a cycle of the arm ({1 / RATE:g} "
            "s), and what is between two cycles cannot be checked; give the plan fewer frames"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number is refused below
        checks = _Checks(plan, limits, settings, demonstrations)
        shown = _check_demonstrations(plan, demonstrations, settings)
        lines = (checks.joints(), *checks.motion(), shown, checks.box())
    return LimitReport(limits.robot, limits.firmware, limits.source, lines)


class _Checks:
    """The checks of one plan's joints against one robot."""

    def __init__(
        self,
        plan: Plan,
        limits: RobotLimits,
        settings: GateSettings,
        shown: Demonstrations | None,
    ) -> None:
        self._shown = shown if shown is not None and shown.format == plan.format else None
        self._plan, self._limits, self._settings = plan, limits, settings
        self._columns = match_joints(plan.format, limits)
        self._rows, self._picked = list(self._columns), list(self._columns.values())
        self._names = [limits.joint_names[row] for row in self._rows]
        self._fine = interpolate(plan.actions, plan.format.dt, hold_before=_HOLD, hold_after=_HOLD)
        # A held pose is that of the first or the last frame, and is said to be there.
        self._t = np.clip(self._fine.t, 0.0, plan.times[-1])
        self._at_frames = join_frames(plan.actions, plan.format.dt)(plan.times, 2)

    def joints(self) -> LimitLine:
        """Whether the plan has a column for every joint, but for those left out on purpose."""
        absent = self._settings.absent_joints
        missing = missing_joints(self._columns, self._limits, absent)
        d = len(self._limits.joint_names)
        text = f"all {d} are in the plan"
        if absent:
            text = f"{len(self._columns)} of {d}, without {', '.join(absent)} on purpose"
        if missing:
            text = f"not in the plan, so not checked: {', '.join(missing)}"
        return LimitLine(
            check="joints",
            status=_status(False, warn=bool(missing)),
            value=float(len(missing)),
            limit=0.0,
            margin=0.0 - len(missing),
            unit="1",
            joint=missing[0] if missing else None,
            text=text,
        )

    def motion(self) -> list[LimitLine]:
        """Position, velocity, acceleration, jerk and rest, each at its worst joint and time."""
        if not self._columns:
            why = f"the plan has no column named like {self._limits.joint_names[0]}"
            checks = (
                "position",
                "velocity",
                "acceleration",
                "jerk",
                "rest at start",
                "rest at end",
            )
            return [_unchecked(check, why) for check in checks]
        fine, limits, rows = self._fine, self._limits, self._rows
        q, dq, ddq, dddq = (x[:, self._picked] for x in (fine.q, fine.dq, fine.ddq, fine.dddq))
        everywhere = np.zeros((len(q), len(limits.joint_names)))
        everywhere[:, rows] = q
        low, high = limits.velocity_bounds(everywhere)
        # Linear from frame to frame, it is largest at a frame, which may lie between two cycles.
        t_ddq = np.concatenate([self._t, self._plan.times])
        ddq = np.concatenate([ddq, self._at_frames[:, self._picked]])
        bounds = np.where(dq < 0, -low[:, rows], high[:, rows])
        return [
            self._range("position", "rad", q, limits.lower[rows], limits.upper[rows], self._names),
            self._rate("velocity", "rad/s", self._t, dq, bounds),
            self._derivative(
                "acceleration", "rad/s^2", t_ddq, ddq, _picked(limits.acceleration, rows), 0
            ),
            self._derivative("jerk", "rad/s^3", self._t, dddq, _picked(limits.jerk, rows), 1),
            self._rest("rest at start", 0, 0.0),
            self._rest("rest at end", -2, float(self._plan.times[-1])),
        ]

    def box(self) -> LimitLine:
        """Whether the tool tip stays in the box, through forward kinematics at 1 kHz."""
        settings, limits, d = self._settings, self._limits, len(self._limits.joint_names)
        if settings.box_low is None or settings.box_high is None:
            return _unchecked("box", _NO_BOX)
        if limits.chain is None or len(self._columns) < d:
            why = f"it needs all {d} joints in the plan"
            if limits.chain is None:
                why = f"the kinematics of {limits.robot} are not known"
            return LimitLine(
                check="box",
                status="refuse",
                text=f"cannot be checked: {why}; take the box out, or guard it otherwise",
            )
        tip = tool_tip(limits.chain, self._fine.q[:, self._picked], settings.tool_tip)
        low, high = np.array(settings.box_low, float), np.array(settings.box_high, float)
        return self._range("box", "m", tip, low, high, "xyz")

    def _range(
        self, check: str, unit: str, values: Samples, low: Ends, high: Ends, names: Sequence[str]
    ) -> LimitLine:
        """Joints or the tool tip where they come nearest to an end, or are farthest beyond."""
        distance = np.minimum(values - low, high - values)
        sample, column = _worst(-distance)
        value, margin = float(values[sample, column]), float(distance[sample, column])
        near_low = value - low[column] < high[column] - value
        limit = float(low[column] if near_low else high[column])
        name, time, beyond = names[column], float(self._t[sample]), not margin > 0
        place, where, end = f"{name} at", "beyond" if beyond else "from", "its end"
        if check == "box":
            place, where, end = (
                f"tool tip at {name} =",
                "beyond" if beyond else "within",
                "the box's",
            )
        return LimitLine(
            check=check,
            status=_status(beyond, check != "box" and margin < self._settings.position_margin),
            value=value,
            limit=limit,
            margin=margin,
            unit=unit,
            joint=name,
            time=time,
            text=f"{place} {value:.3f} {unit}, {abs(margin):.3f} {where} {end} {limit:.3f}, "
            f"at {time:.3f} s",
        )

    def _rate(
        self, check: str, unit: str, t: Times, values: Samples, bound: Samples | Ends
    ) -> LimitLine:
        bound = np.broadcast_to(bound, values.shape)
        # Next to a stop the bound is 0; a joint that rests there (to rounding) breaks nothing.
        used = np.where(np.abs(values) < 1e-6, 0.0, np.abs(values) / np.maximum(bound, 1e-12))
        sample, joint = _worst(used)
        share, value = float(used[sample, joint]), abs(float(values[sample, joint]))
        limit, time = float(bound[sample, joint]), float(t[sample])
        here = " at that position" if check == "velocity" and self._limits.envelopes else ""
        return LimitLine(
            check=check,
            status=_status(not share < 1, share > self._settings.warn_above),
            value=value,
            limit=limit,
            margin=limit - value,
            unit=unit,
            joint=self._names[joint],
            time=time,
            text=f"{self._names[joint]} at {value:.4g} {unit}, {100 * share:.0f} % of "
            f"{limit:.4g}{here}, at {time:.3f} s",
        )

    def _derivative(
        self, check: str, unit: str, t: Times, values: Samples, limit: Ends | None, which: int
    ) -> LimitLine:
        """Against the maker's limit; where there is none, beside what was demonstrated.

        What the arm did in the demonstrations is no limit, so that line warns and never refuses.
        """
        if limit is not None:
            return self._rate(check, unit, t, values, limit)
        missing = f"no limit of {self._limits.robot} is known"
        if self._shown is None:
            return _unchecked(check, f"{missing}, nor a demonstration to compare with")
        bound = np.maximum(_largest_shown(self._shown, self._picked)[which], 1e-12)
        used = np.abs(values) / bound
        sample, joint = _worst(used)
        share, value = float(used[sample, joint]), abs(float(values[sample, joint]))
        return LimitLine(
            check=check,
            status=_status(False, not share <= _BEYOND_SHOWN),
            value=value,
            limit=float(bound[joint]),
            margin=float(bound[joint]) - value,
            unit=unit,
            joint=self._names[joint],
            time=float(t[sample]),
            text=f"{missing}; {self._names[joint]} at {value:.4g} {unit}, {100 * share:.0f} % of "
            f"the demonstrations' largest {bound[joint]:.4g}, at {float(t[sample]):.3f} s",
        )

    def _rest(self, check: str, frame: int, time: float) -> LimitLine:
        """Speed over the interval after a frame, which should be rest.

        The spline brings the arm to rest there in any case; what this measures is whether the plan
        itself does, or leaves the braking to the step where the pose is held.
        """
        actions, dt = self._plan.actions[:, self._picked], self._plan.format.dt
        speeds = np.abs(actions[frame + 1] - actions[frame]) / dt
        name, speed = self._names[int(np.argmax(speeds))], float(speeds.max())
        limit = self._settings.rest_speed
        return LimitLine(
            check=check,
            status=_status(not speed <= limit),
            value=speed,
            limit=limit,
            margin=limit - speed,
            unit="rad/s",
            joint=name,
            time=time,
            text=f"{name} moves at {speed:.3g} rad/s, at most {limit:g} counts as rest",
        )


def _check_demonstrations(
    plan: Plan, demonstrations: Demonstrations | None, settings: GateSettings
) -> LimitLine:
    """Distance from the demonstrations' envelope, as a share of each column's demonstrated range.

    The envelope is the band between the lowest and the highest demonstration at each frame; for a
    plan of another horizon or time step, the range over all frames.

    Raises:
        InvalidPlanError: The demonstrations have other columns than the plan.
    """
    if demonstrations is None:
        return _unchecked("demonstrations", "no demonstrations given")
    form, shown = demonstrations.format, demonstrations.plans
    if form.names != plan.format.names:
        raise InvalidPlanError(
            f"the plan's columns {plan.format.names} are not the demonstrations' {form.names}; "
            "give the demonstrations it was learned from"
        )
    low, high = shown.min(axis=(0, 1)), shown.max(axis=(0, 1))
    span = high - low
    if demonstrations.horizon == plan.horizon and math.isclose(form.dt, plan.format.dt):
        low, high = shown.min(axis=0), shown.max(axis=0)
    beyond = np.maximum(np.maximum(low - plan.actions, plan.actions - high), 0.0)
    # A channel that was shown constant has no range; any visible departure from it counts fully.
    share = beyond / np.maximum(span, 1e-3)
    frame, column = _worst(share)
    value, time = float(share[frame, column]), float(frame * plan.format.dt)
    name, unit = form.names[column], plan.format.units[column]
    return LimitLine(
        check="demonstrations",
        status=_status(not value <= settings.beyond_refuse, value > settings.beyond_warn),
        value=value,
        limit=settings.beyond_refuse,
        margin=settings.beyond_refuse - value,
        unit="1",
        joint=name if value else None,
        time=time if value else None,
        text=f"{name} is {beyond[frame, column]:.3g} {unit} beyond the band, {100 * value:.0f} % "
        f"of its demonstrated range, at {time:.3f} s"
        if value
        else "within the band of the demonstrations at every frame",
    )


def _picked(limit: PerJoint | None, rows: Sequence[int]) -> Ends | None:
    """A limit of the joints that a plan has; None where none is known."""
    return None if limit is None else limit[list(rows)]


def _largest_shown(shown: Demonstrations, columns: Sequence[int]) -> tuple[Ends, Ends]:
    """Largest acceleration and jerk of each column in any demonstration."""
    fine = [
        interpolate(p, shown.format.dt, hold_before=_HOLD, hold_after=_HOLD) for p in shown.plans
    ]
    picked = list(columns)
    return (
        np.max([np.abs(f.ddq[:, picked]).max(axis=0) for f in fine], axis=0),
        np.max([np.abs(f.dddq[:, picked]).max(axis=0) for f in fine], axis=0),
    )


def _worst(values: Samples) -> tuple[int, int]:
    """Sample and column of the largest value."""
    sample, column = np.unravel_index(int(np.argmax(values)), values.shape)
    return int(sample), int(column)


def _status(refuse: bool, warn: bool = False) -> Status:
    return "refuse" if refuse else "warn" if warn else "pass"


def _unchecked(check: str, why: str) -> LimitLine:
    return LimitLine(check=check, status="unchecked", text=f"not checked: {why}")
