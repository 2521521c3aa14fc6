"""The gate: a plan is held against the robot's limits as the very stream that the arm gets.

That is the cubic spline through the frames, and what is sampled from it, at the plan's own rate or
at 1 kHz. Its extremes are computed, not looked for (`extremes`), and no difference of samples
exceeds the derivative it stands for. What is sent otherwise is another plan, which is held against
the limits itself: frames at another rate (`resampled`), or that begin where the arm stands
(`begin_at`). The gate refuses or warns. It never clamps and never retimes: a retimed
throw is another throw. It is no safety function: torques, collisions and people in reach are not
its business.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.robots.extremes import accelerations, jerks, speeds, turns, with_cycles
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import (
    RobotLimits,
    match_joints,
    missing_joints,
    other_quantities,
)
from prior_reinforce.arm.robots.report import LimitLine, LimitReport, Samples, Times, worst_place
from prior_reinforce.arrays import Point
from prior_reinforce.errors import ConfigurationError, InvalidPlanError, OutOfReachError
from prior_reinforce.plans.interpolation import RATE, join_frames
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.symmetry import Anchors

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
_LEAST_RANGE = 1e-3
"""What a column's demonstrated range counts as at least, in its unit: of a column that is held, any
departure to be seen counts fully. Ours."""
_SPEED_WINDOW = 0.01
"""Over which the speed of a column that is no joint is measured, in [s]. Ours: a step of one frame
is as fast as it is recorded up to 100 frames/s, and noise of finer recordings is no motion."""
_LONGEST = 300.0
"""Of a plan, in [s]. Ours: a hundred times the longest of our tasks, and three times the slowest
approach; the gate's memory grows by 60 kB a second and joint."""
_TEMPO = 0.5, 1.5
"""How fast a demonstration may be played, as a share of its own speed. Ours: every demonstration of
our tasks may be played so slow, and beyond 1.5 most break a limit of the Panda's."""
_NO_BOX = (
    "no box given, so the tool tip is not checked: set tool_tip, workspace_low and workspace_high "
    "in [gate]"
)
_NONE_SHOWN = "no demonstrations given"
_RATE = "{joint} at {value:.4g} {unit}, {percent:.0f} % of {limit:.4g}"
_AT = ", at {time:.3f} s"
_RESTS = ("rest at start", "rest at end")

Ends = Float[np.ndarray, " d"]
"""One number for each of d joints."""


def check_plan(
    plan: Plan,
    limits: RobotLimits,
    demonstrations: Demonstrations | None = None,
    settings: GateSettings | None = None,
    condition: Point | None = None,
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
        condition: What the plan was generated for, shape (k,), in the outcomes' units. Where the
            demonstrations have a symmetry, ranges and the distance from them are measured after
            moving them there, as the generator does.

    Returns:
        Nine lines: joints in the plan, position, velocity, acceleration, jerk, rest at either end,
        distance from the demonstrations, box for the tool tip. Two more where columns are no
        joints: their range and their speed. One more where demonstrations are moved: their tempo.

    Raises:
        InvalidPlanError: A joint in another unit than [rad], two columns that look like one joint,
            frames closer than the arm's cycles, a plan that takes longer than any does, or
            demonstrations of another format.
        ConfigurationError: `absent_joints` names no joint of the robot, or one that the plan moves;
            `ranges` names no column.
    """
    settings = settings or GateSettings()
    _check_formats(plan, demonstrations)
    shown = list[Plan]()
    if demonstrations is not None:
        shown = [Plan(frames, demonstrations.format) for frames in demonstrations.plans]
    columns = match_joints(plan.format, limits)
    moved, speed = shown, None
    if demonstrations is not None and demonstrations.symmetry is not None and condition is not None:
        moved, speed = _moved(demonstrations, condition, plan)
    lines = [_joints(plan, limits, columns, settings.absent_joints)]
    with np.errstate(all="ignore"):  # what is no number refuses
        if columns:
            lines += _motion(plan, limits, columns, shown, settings)
        else:
            why = f"the plan has no column named like {limits.joint_names[0]}"
            names = ("position", "velocity", "acceleration", "jerk", *_RESTS)
            lines += [_unchecked(name, why) for name in names]
        lines += _channels(plan, columns, shown, moved, settings)
        if speed is not None:
            lines.append(_tempo(speed))
        lines.append(_distance(plan, moved, settings))
        lines.append(_box(plan, limits, columns, settings))
    return LimitReport(limits.robot, limits.firmware, limits.source, tuple(lines))


def _check_formats(plan: Plan, demonstrations: Demonstrations | None) -> None:
    """InvalidPlanError if the plan's times or the demonstrations' columns cannot be right."""
    here, duration = plan.format, float(plan.times[-1])
    if here.dt < (1 - 1e-9) / RATE:
        raise InvalidPlanError(
            f"a frame every {here.dt:g} s is closer than a cycle of the arm ({1 / RATE:g} s), "
            "which would leave some out; give the plan fewer frames"
        )
    if not duration <= _LONGEST:
        raise InvalidPlanError(
            f"the plan takes {duration:g} s, no plan may take more than {_LONGEST:g} s; give dt "
            f"(now {here.dt:g}) in seconds, or a shorter motion"
        )
    there = here if demonstrations is None else demonstrations.format
    if (there.names, there.units) != (here.names, here.units):
        raise InvalidPlanError(
            f"the plan's columns {here.names} in {here.units} are not the demonstrations' "
            f"{there.names} in {there.units}; give the demonstrations it was learned from"
        )


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
    if unlike := other_quantities(plan.format, limits):
        text += f"; no positions by their names: {', '.join(unlike)} (if they are, rename them)"
    return LimitLine(
        check="joints",
        status="warn" if missing or unlike else "pass",
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
    shown: Sequence[Plan],
    settings: GateSettings,
) -> list[LimitLine]:
    """Position, velocity, acceleration, jerk, and rest at either end."""
    rows, picked = list(columns), list(columns.values())
    joints = [limits.joint_names[row] for row in rows]
    dt, warn = plan.format.dt, settings.warn_above
    spline = join_frames(plan.actions[:, picked], dt)
    t, end = (with_cycles if limits.envelopes else turns)(spline), float(plan.times[-1])
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
        ("acceleration", "rad/s^2", accelerations),
        ("jerk", "rad/s^3", jerks),
    ):
        published, warns, says = getattr(limits, name), warn, _RATE + _AT
        largest = largest if published is None else published
        limit = largest[rows]
        if published is None and not shown:
            says = f"no limit is known; {_RATE}, allowed without demonstrations{_AT}"
        elif published is None:
            splines = [join_frames(each.actions[:, picked], each.format.dt) for each in shown]
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
    plan: Plan,
    columns: dict[int, int],
    shown: Sequence[Plan],
    moved: Sequence[Plan],
    settings: GateSettings,
) -> list[LimitLine]:
    """Range and speed of columns that are no joints, each in its unit.

    Ranges are those of the settings, else the moved demonstrations' with a margin. Speeds, over
    `_SPEED_WINDOW`, are held against the demonstrations' largest as unpublished accelerations are.
    """
    form, names, units = plan.format, np.array(plan.format.names), np.array(plan.format.units)
    given = {name: (low, high) for name, low, high in settings.ranges}
    if unknown := given.keys() - {*form.names}:
        raise ConfigurationError(
            f"ranges names {', '.join(sorted(unknown))}, and columns are {', '.join(form.names)}"
        )
    others = ~np.isin(np.arange(len(names)), list(columns.values()))
    ranged = np.isin(names, list(given)) | (others & bool(moved))
    spline, lines = join_frames(plan.actions, form.dt), list[LimitLine]()
    low, high = np.zeros((2, len(names)))
    if moved:
        low, high = _ends(moved)
        margin = _RANGE_MARGIN * _span(low, high)
        low, high = low - margin, high + margin
    for name, ends in given.items():
        low[names == name], high[names == name] = ends
    if ranged.any():
        says = "{joint} at {value:.4g} {unit}, {margin:.3g} {within} its end {limit:.4g} ("
        says += f"of [gate] ranges, or as demonstrated and {_RANGE_MARGIN:.0%} more)"
        slack, t = 1e-9 * (high - low), turns(spline)  # a closed gripper stands at its end
        low, high, q = (low - slack)[ranged], (high + slack)[ranged], spline(t)[:, ranged]
        unit, own = units[ranged].tolist(), names[ranged].tolist()
        lines.append(_range("range", unit, own, t, q, low, high, says=says))
    elif others.any():
        lines.append(_unchecked("range", _NONE_SHOWN))
    if not others.any():
        return lines
    if not shown:
        return [*lines, _unchecked("speed", _NONE_SHOWN)]
    splines = [join_frames(each.actions, each.format.dt) for each in shown]
    most = np.max([speeds(each, _SPEED_WINDOW)[1].max(axis=0) for each in splines], axis=0)[others]
    allowed = _REFUSED_BEYOND_SHOWN * most
    held = _RANGE_MARGIN * _LEAST_RANGE / _SPEED_WINDOW
    over = f"{_RATE} over {1e3 * _SPEED_WINDOW:g} ms, "
    says_each = [
        f"{over}{_REFUSED_BEYOND_SHOWN:g} times what was demonstrated{_AT}"
        if speed > held
        else f"{over}demonstrations held it still{_AT}"
        for speed in allowed
    ]
    t, speed = speeds(spline, _SPEED_WINDOW)
    lines.append(
        worst_place(
            "speed",
            [f"{unit}/s" for unit in units[others]],
            says_each,
            names[others].tolist(),
            t,
            speed[:, others],
            np.maximum(allowed, held),
            _WARNED_BEYOND_SHOWN / _REFUSED_BEYOND_SHOWN,
        )
    )
    return lines


def _ends(motions: Sequence[Plan]) -> tuple[Ends, Ends]:
    """The lowest and the highest frame of each column."""
    lowest, highest = ([f(each.actions, axis=0) for each in motions] for f in (np.min, np.max))
    return np.min(lowest, axis=0), np.max(highest, axis=0)


def _span(low: Ends, high: Ends) -> Ends:
    return np.maximum(high - low, _LEAST_RANGE)


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


def _narrowest(bound: Samples) -> Samples:
    """The smallest of each bound and its neighbours', since it changes between two instants."""
    padded = np.concatenate([bound[:1], bound, bound[-1:]])
    return np.minimum(np.minimum(padded[:-2], padded[2:]), bound)


def _moved(
    demonstrations: Demonstrations, condition: Point, plan: Plan
) -> tuple[list[Plan], float]:
    """Demonstrations as a generator moves them to a plan's condition, and how much faster."""
    symmetry = demonstrations.symmetry
    assert symmetry is not None
    anchors = Anchors(symmetry, demonstrations.outcomes_seen, demonstrations.outcome_noise)
    each, w = anchors.moves(symmetry.chart.to(condition))
    moved = list[Plan]()
    for shown, by in zip(demonstrations.plans, each, strict=True):
        with suppress(OutOfReachError):  # a mixture with others may be in reach
            if np.all(np.isfinite(by)):
                frames = symmetry.toward(symmetry.endless.move(shown, by), plan.actions)
                moved.append(Plan(frames, demonstrations.format))
    return moved, symmetry.speed(w)


def _tempo(speed: float) -> LimitLine:
    """Whether demonstrations are played no faster and no slower than is taken for the same."""
    slowest, fastest = _TEMPO
    limit = slowest if speed < 1.0 else fastest
    within = slowest <= speed <= fastest
    return LimitLine(
        check="tempo",
        status="pass" if within else "refuse",
        value=speed,
        limit=limit,
        margin=min(speed - slowest, fastest - speed),
        unit="1",
        text=f"{speed:.2f} times as fast as demonstrated, allowed from {slowest} to {fastest}",
    )


def _distance(plan: Plan, shown: Sequence[Plan], settings: GateSettings) -> LimitLine:
    """How far beyond the band of the demonstrations a plan goes."""
    if not shown:
        return _unchecked("demonstrations", _NONE_SHOWN)
    beyond = beyond_band(plan, shown)
    says = "{joint} is {percent:.0f} % of its demonstrated range beyond the band" + _AT
    if not beyond.any():
        says = "within the band of the demonstrations at every frame"
    limit, names = max(settings.beyond_refuse, 1e-12), plan.format.names
    warn = settings.beyond_warn / limit
    return worst_place("demonstrations", "1", says, names, plan.times, beyond, limit, warn)


def beyond_band(plan: Plan, references: Sequence[Plan]) -> Samples:
    """How far each frame lies beyond a band of motions, as a share of each column's range there.

    The band is between the lowest and the highest of the references at the frame's time. Where one
    takes longer or shorter than the plan, by more than a frame, it is between the lowest and the
    highest frame of all.
    """
    form = plan.format
    references = [
        replace(each, actions=form.toward(each.actions, plan.actions[0])) for each in references
    ]
    low, high = _ends(references)
    span, duration = _span(low, high), plan.times[-1]
    frame = max(plan.format.dt, *(each.format.dt for each in references)) * (1 - 1e-9)
    if all(abs(each.times[-1] - duration) < frame for each in references):
        at = [np.minimum(plan.times, each.times[-1]) for each in references]
        splines = [join_frames(each.actions, each.format.dt) for each in references]
        there = np.stack([spline(t) for spline, t in zip(splines, at, strict=True)])
        low, high = there.min(axis=0), there.max(axis=0)
    beyond = np.maximum(low - plan.actions, plan.actions - high) / span
    return np.where(beyond > 1e-9, beyond, 0.0)  # a spline meets its frames to rounding


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
    t = with_cycles(spline)
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
