"""The gate: a plan is held against the robot's limits as the very stream that the arm gets.

That is the cubic spline through the frames, and what is sampled from it, at the plan's own rate or
at 1 kHz. Its extremes are computed, not looked for: positions and velocities are largest at a frame
or where a parabola turns, accelerations at a frame, and no difference of samples exceeds the
derivative it stands for. The gate refuses or warns. It never clamps and never retimes: a retimed
throw is another throw. It is no safety function: torques, collisions and people in reach are not
its business.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.bench.robots.kinematics import tool_tip
from prior_reinforce.bench.robots.limits import RobotLimits, match_joints, missing_joints
from prior_reinforce.bench.robots.report import (
    LimitLine,
    LimitReport,
    Samples,
    Times,
    worst_place,
)
from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.interpolation import RATE, join_frames
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.signals import REST_SPEED
from prior_reinforce.settings import Checked, NonNegative, Positive

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_FULL_SPEED_WITHIN = 0.05
"""Where no acceleration is published, the largest that is allowed brings a joint to its full speed
within this time, in [s]. Ours: more than twice as brisk as any arm whose maker publishes both (the
Panda needs 0.13 to 0.29 s, the FR3 0.26 to 0.53 s)."""
_FULL_ACCELERATION_WITHIN = 0.002
"""Where no jerk is published, the largest that is allowed brings a joint to its largest
acceleration within this time, in [s]: that of the Panda and the FR3, of every joint."""
_REFUSED_BEYOND_SHOWN = 3.0
"""Times the demonstrations' largest acceleration or jerk that refuses, where none is published.
Ours: between demonstrations, a plan stays below half of that."""
_WARNED_BEYOND_SHOWN = 1.5
"""Times the same that warns. Ours: between demonstrations, a plan stays below it."""
_FLOOR = 0.05
"""Share of the largest allowed acceleration or jerk up to which a joint counts as held in the
demonstrations: theirs is then its encoder's noise. Ours: 3 rad/s^2 of a joint that does 3.14 rad/s;
noise of 2e-5 rad makes 2 rad/s^2 in frames 12.5 ms apart."""
_RANGE_MARGIN = 0.04
"""Share of its demonstrated range by which a column that is no joint may go beyond it. Ours: plans
with a step from 0 to 62 percent, recorded at 30 frames/s, go up to 3.3 % of it beyond where the
step takes one frame, and 1.3 % where it takes more, at goals up to 1.3 times as far out."""
_ERRORS = {"m": (0.01, 0.005), "percent": (5.0, 5.0)}
"""As `GateSettings.start_error` and `tracking_error`, in other units. Ours: for lengths what those
do at half a metre; a gripper that holds something stands some per cent off what it was told."""
_NO_BOX = (
    "no box given, so the tool tip is not checked: set tool_tip, workspace_low and workspace_high "
    "in [gate]"
)
_NONE_SHOWN = "no demonstrations given"
_RATE = "{joint} at {value:.4g} {unit}, {percent:.0f} % of {limit:.4g}"
_AT = ", at {time:.3f} s"
_RESTS = ("rest at start", "rest at end")
_JUST = 1e-12
"""Just before and just after an instant, in [s]."""

Ends = Float[np.ndarray, " d"]
"""One number for each of d joints."""


@dataclass(frozen=True)
class GateSettings(Checked):
    """Where the gate draws the lines that no maker publishes, and the box for the tool tip."""

    warn_above: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.95
    """Share of a velocity, acceleration or jerk limit from which on the gate warns. Ours: a
    delayed cycle makes the robot extrapolate, which costs a few per cent of acceleration."""
    position_margin: NonNegative = 0.02
    """Distance from a joint's end that warns, in [rad]. Ours: about one degree."""
    rest_speed: NonNegative = REST_SPEED["rad"]
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
        return (_ERRORS | {"rad": (self.start_error, self.tracking_error)} | given).get(unit)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A value of another type or outside its range, or half a box.
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


def check_plan(
    plan: Plan,
    limits: RobotLimits,
    demonstrations: Demonstrations | None = None,
    settings: GateSettings | None = None,
) -> LimitReport:
    """Hold a plan against the limits, joined as `join_frames` does and at rest before and after.

    Args:
        plan: What is to be executed. Its columns are matched to the robot's joints by name
            (`joint4` also matches `panda_joint4`); columns that are no joint of it, such as a
            gripper, are held against `settings.ranges` and the demonstrations. A joint without a
            column cannot be checked, which warns unless `settings.absent_joints` names it.
        limits: Of the robot. Where they have no acceleration or jerk, three times the
            demonstrations' largest refuses, and in any case what no published arm comes near.
        demonstrations: What was shown; None leaves the distance from them unchecked.
        settings: Where the gate draws its own lines; None takes the defaults.

    Returns:
        Nine lines: joints in the plan, position, velocity, acceleration, jerk, rest at either end,
        distance from the demonstrations, box for the tool tip. Two more where columns are no
        joints: their range and their speed.

    Raises:
        InvalidPlanError: A joint in another unit than [rad], two columns that look like one joint,
            frames closer than the arm's cycles, or demonstrations of another format.
        ConfigurationError: `absent_joints` names no joint of the robot, or one that the plan moves;
            `ranges` names no column.
    """
    settings = settings or GateSettings()
    if plan.format.dt < (1 - 1e-9) / RATE:
        raise InvalidPlanError(
            f"a frame every {plan.format.dt:g} s is closer than a cycle of the arm ({1 / RATE:g} "
            "s), which would leave some out; give the plan fewer frames"
        )
    here, there = plan.format, None if demonstrations is None else demonstrations.format
    if there is not None and (there.names, there.units) != (here.names, here.units):
        raise InvalidPlanError(
            f"the plan's columns {here.names} in {here.units} are not the demonstrations' "
            f"{there.names} in {there.units}; give the demonstrations it was learned from"
        )
    columns = match_joints(plan.format, limits)
    lines = [_joints(plan, limits, columns, settings.absent_joints)]
    with np.errstate(all="ignore"):  # what is no number refuses
        if columns:
            lines += _motion(plan, limits, columns, demonstrations, settings)
        else:
            why = f"the plan has no column named like {limits.joint_names[0]}"
            names = ("position", "velocity", "acceleration", "jerk", *_RESTS)
            lines += [_unchecked(name, why) for name in names]
        lines += _channels(plan, columns, demonstrations, settings)
        if demonstrations is None:
            lines.append(_unchecked("demonstrations", _NONE_SHOWN))
        else:
            lines.append(_distance(plan, demonstrations, settings))
        lines.append(_box(plan, limits, columns, settings))
    return LimitReport(limits.robot, limits.firmware, limits.source, tuple(lines))


def _joints(
    plan: Plan, limits: RobotLimits, columns: dict[int, int], absent: Sequence[str]
) -> LimitLine:
    """Whether the plan has a column for every joint, but for those left out on purpose."""
    missing, d = missing_joints(columns, limits, absent), len(limits.joint_names)
    text = f"all {d} are in the plan"
    if absent:
        text = f"{len(columns)} of {d}, without {', '.join(absent)} on purpose"
    if missing:
        text = f"not in the plan, so not checked: {', '.join(missing)}"
    others = [n for i, n in enumerate(plan.format.names) if i not in columns.values()]
    if others and columns:
        text += f"; {', '.join(others)}: by range and speed"
    return LimitLine(
        check="joints",
        status="warn" if missing else "pass",
        value=float(len(missing)),
        limit=0.0,
        margin=0.0 - len(missing),
        unit="1",
        joint=missing[0] if missing else None,
        text=text,
    )


def _motion(
    plan: Plan,
    limits: RobotLimits,
    columns: dict[int, int],
    shown: Demonstrations | None,
    settings: GateSettings,
) -> list[LimitLine]:
    """Position, velocity, acceleration, jerk, and rest at either end."""
    rows, picked = list(columns), list(columns.values())
    joints = [limits.joint_names[row] for row in rows]
    dt, warn = plan.format.dt, settings.warn_above
    spline = join_frames(plan.actions[:, picked], dt)
    t, end = _instants(spline), float(plan.times[-1])
    q, dq = spline(t), spline(t, 1)
    everywhere = np.zeros((len(t), len(limits.joint_names)))
    everywhere[:, rows] = q
    low, high = limits.velocity_bounds(everywhere)
    bound = _narrowest(np.where(dq < 0, -low[:, rows], high[:, rows]))
    # Next to a stop the bound is 0; a joint that rests there (to rounding) breaks nothing.
    speed = np.where(np.abs(dq) < 1e-6, 0.0, np.abs(dq))
    here = " at that position" if limits.envelopes else ""
    near = 1 - settings.position_margin
    lines = [
        _range("position", "rad", joints, t, q, limits.lower[rows], limits.upper[rows], near),
        worst_place("velocity", "rad/s", _RATE + here + _AT, joints, t, speed, bound, warn),
    ]
    largest = limits.velocity / _FULL_SPEED_WITHIN
    for name, unit, rates in (
        ("acceleration", "rad/s^2", _accelerations),
        ("jerk", "rad/s^3", _jerks),
    ):
        published, warns, says = getattr(limits, name), warn, _RATE + _AT
        largest = largest if published is None else published
        limit = largest[rows]
        if published is None and shown is None:
            says = f"no limit is known; {_RATE}, allowed without demonstrations{_AT}"
        elif published is None and shown is not None:
            splines = [join_frames(p[:, picked], shown.format.dt) for p in shown.plans]
            most = np.max([rates(each)[1].max(axis=0) for each in splines], axis=0)
            most = np.clip(most, _FLOOR * limit, limit)
            limit = np.minimum(_REFUSED_BEYOND_SHOWN * most, limit)
            warns = np.minimum(_WARNED_BEYOND_SHOWN * most / limit, warn)
            says = f"no limit is known; {_RATE}, allowed after the demonstrations{_AT}"
        lines.append(worst_place(name, unit, says, joints, *rates(spline), limit, warns))
        largest = largest / _FULL_ACCELERATION_WITHIN
    # The spline brings the arm to rest at either end in any case; what this measures is whether the
    # plan itself does, or leaves the braking to the step where the pose is held.
    steps = np.abs(np.diff(spline(spline.x[[0, 1, -2, -1]]), axis=0))[[0, 2]] / dt
    says = "{joint} moves at {value:.3g} {unit}, less than {limit:g} counts as rest"
    return lines + [
        worst_place(name, "rad/s", says, joints, np.array([time]), step[None], settings.rest_speed)
        for name, time, step in zip(_RESTS, (0.0, end), steps, strict=True)
    ]


def _channels(
    plan: Plan, columns: dict[int, int], shown: Demonstrations | None, settings: GateSettings
) -> list[LimitLine]:
    """Range and speed of columns that are no joints, each in its unit.

    Ranges are those of the settings, else the demonstrations' with a margin; speeds are held
    against the demonstrations' largest as unpublished accelerations are.
    """
    form, names = plan.format, np.array(plan.format.names)
    given = {name: (low, high) for name, low, high in settings.ranges}
    if unknown := given.keys() - {*form.names}:
        raise ConfigurationError(
            f"ranges names {', '.join(sorted(unknown))}, and columns are {', '.join(form.names)}"
        )
    others = ~np.isin(np.arange(len(names)), list(columns.values()))
    ranged = np.isin(names, list(given)) | (others & (shown is not None))
    spline = join_frames(plan.actions, form.dt)
    t, lines = _instants(spline), list[LimitLine]()
    low, high = np.zeros((2, len(names)))
    if shown is not None:
        low, high = shown.plans.min(axis=(0, 1)), shown.plans.max(axis=(0, 1))
        margin = _RANGE_MARGIN * _span(low, high)
        low, high = low - margin, high + margin
    for name, ends in given.items():
        low[names == name], high[names == name] = ends
    if ranged.any():
        says = "{joint} at {value:.4g} {unit}, {margin:.3g} {within} its end {limit:.4g} ("
        says += f"of [gate] ranges, or as demonstrated and {_RANGE_MARGIN:.0%} more)"
        units, own = (np.array(of)[ranged].tolist() for of in (form.units, form.names))
        slack = 1e-9 * (high - low)  # a gripper that is closed stands at its end
        low, high, q = (low - slack)[ranged], (high + slack)[ranged], spline(t)[:, ranged]
        lines.append(_range("range", units, own, t, q, low, high, says=says))
    elif others.any():
        lines.append(_unchecked("range", _NONE_SHOWN))
    if shown is not None and others.any():
        splines = [join_frames(each, shown.format.dt) for each in shown.plans]
        most = np.max([np.abs(each(_instants(each), 1)).max(axis=0) for each in splines], axis=0)
        limit = np.maximum(_REFUSED_BEYOND_SHOWN * most, margin / form.dt)[others]  # or noise
        says = f"{_RATE}, {_REFUSED_BEYOND_SHOWN:g} times what was demonstrated{_AT}"
        units, own = (np.array(of)[others].tolist() for of in (form.units, form.names))
        units = [f"{unit}/s" for unit in units]
        warn = _WARNED_BEYOND_SHOWN / _REFUSED_BEYOND_SHOWN
        speed = np.abs(spline(t, 1))[:, others]
        lines.append(worst_place("speed", units, says, own, t, speed, limit, warn))
    elif others.any():
        lines.append(_unchecked("speed", _NONE_SHOWN))
    return lines


def _span(low: Ends, high: Ends) -> Ends:
    """Demonstrated range; of a constant channel little: any visible departure counts fully."""
    return np.maximum(high - low, 1e-3)


def _range(
    name: str,
    unit: str | Sequence[str],
    joints: Sequence[str],
    t: Times,
    values: Samples,
    low: Ends,
    high: Ends,
    warn: float = 1.0,
    says: str = "{joint} at {value:.3f} {unit}, {margin:.3f} {within} its end {limit:.3f}",
) -> LimitLine:
    """Values between two ends; a range is used up by how near an end is, in its unit."""
    limit = np.where(values - low < high - values, low, high)
    used = 1 - np.minimum(values - low, high - values)
    return worst_place(name, unit, says + _AT, joints, t, values, limit, warn, used)


def _instants(spline: CubicSpline) -> Times:
    """When to look at a motion: at frames, at every millisecond, and where q or dq/dt turns.

    Between two of these instants, positions and velocities only rise or only fall.
    """
    a, b, c = spline.c[:3]
    root = np.sqrt(b * b - 3 * a * c)  # of the velocity 3 a u^2 + 2 b u + c; nan where it has none
    w = -(b + np.copysign(root, b))
    u = np.stack([w / (3 * a), c / w, -b / (3 * a)])
    inside = (u > 0) & (u < np.diff(spline.x)[:, None])
    turns = (spline.x[:-1, None] + np.where(inside, u, 0.0)).ravel()
    cycles = np.arange(math.ceil(spline.x[-1] * RATE)) / RATE
    return np.unique(np.concatenate([spline.x, turns, cycles]))


def _narrowest(bound: Samples) -> Samples:
    """The smallest of each bound and its neighbours', since it changes between two instants."""
    padded = np.concatenate([bound[:1], bound, bound[-1:]])
    return np.minimum(np.minimum(padded[:-2], padded[2:]), bound)


def _accelerations(spline: CubicSpline) -> tuple[Times, Samples]:
    """Sizes at the frames, between which acceleration is linear."""
    return spline.x, np.abs(spline(spline.x, 2))


def _jerks(spline: CubicSpline) -> tuple[Times, Samples]:
    """How much the acceleration differs over a millisecond, wherever that begins, a second.

    It is largest where the millisecond begins or ends with a frame. Before the first frame and
    after the last there is none, so that the steps where the holds meet the motion count.
    """
    end, cycle = float(spline.x[-1]), 1 / RATE
    late = np.concatenate([spline.x, spline.x + cycle])
    late = np.concatenate([late - _JUST, late + _JUST])

    def acceleration(t: Times) -> Samples:
        inside = (t >= 0) & (t <= end)
        return np.asarray(spline(np.clip(t, 0, end), 2) * inside[:, None])

    jerk = (acceleration(late) - acceleration(late - cycle)) * RATE
    return np.clip(late, 0, end), np.abs(jerk)


def _distance(plan: Plan, demonstrations: Demonstrations, settings: GateSettings) -> LimitLine:
    """Distance from the demonstrations' envelope, as a share of each column's demonstrated range.

    The envelope is the band between the lowest and the highest demonstration at each frame; for a
    plan of another horizon or time step, the range over all frames.
    """
    form, shown = demonstrations.format, demonstrations.plans
    low, high = shown.min(axis=(0, 1)), shown.max(axis=(0, 1))
    span = _span(low, high)
    if demonstrations.horizon == plan.horizon and math.isclose(form.dt, plan.format.dt):
        low, high = shown.min(axis=0), shown.max(axis=0)
    beyond = np.maximum(np.maximum(low - plan.actions, plan.actions - high), 0.0) / span
    says = "{joint} is {percent:.0f} % of its demonstrated range beyond the band" + _AT
    if not beyond.any():
        says = "within the band of the demonstrations at every frame"
    limit = max(settings.beyond_refuse, 1e-12)
    warn = settings.beyond_warn / limit
    return worst_place("demonstrations", "1", says, form.names, plan.times, beyond, limit, warn)


def _box(
    plan: Plan, limits: RobotLimits, columns: dict[int, int], settings: GateSettings
) -> LimitLine:
    """Whether the tool tip stays in the box, through forward kinematics at the same instants."""
    if settings.box_low is None or settings.box_high is None:
        return _unchecked("box", _NO_BOX)
    if limits.chain is None or len(columns) < len(limits.joint_names):
        why = f"it needs all {len(limits.joint_names)} joints in the plan"
        if limits.chain is None:
            why = f"the kinematics of {limits.robot} are not known"
        text = f"cannot be checked: {why}; take the box out, or guard it otherwise"
        return LimitLine(check="box", status="refuse", text=text)
    spline = join_frames(plan.actions[:, list(columns.values())], plan.format.dt)
    t = _instants(spline)
    tip = tool_tip(limits.chain, spline(t), settings.tool_tip or (0.0, 0.0, 0.0))
    what = "flange" if settings.tool_tip is None else "tool tip"
    says = f"{what} at {{joint}} = {{value:.3f}} {{unit}}, {{margin:.3f}} {{within}} the box's "
    low, high = np.array(settings.box_low, float), np.array(settings.box_high, float)
    line = _range("box", "m", "xyz", t, tip, low, high, says=says + "{limit:.3f}")
    if settings.tool_tip is not None or line.status == "refuse":
        return line
    return replace(line, status="warn", text=f"{line.text}; the tool is not checked: set tool_tip")


def _unchecked(check: str, why: str) -> LimitLine:
    return LimitLine(check=check, status="unchecked", text=f"not checked: {why}")
