"""Checks of where a plan goes: how far from what was demonstrated, and out of which box."""

from __future__ import annotations

import math

import numpy as np

from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.interpolation import FineMotion
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.robots.kinematics import tool_tip
from prior_reinforce.robots.limits import RobotLimits
from prior_reinforce.robots.report import LimitLine, Status, unchecked
from prior_reinforce.robots.settings import GateSettings


def check_demonstrations(
    plan: Plan, demonstrations: Demonstrations | None, settings: GateSettings
) -> LimitLine:
    """Distance from the demonstrations' envelope, as a share of each column's demonstrated range.

    The envelope is the band between the lowest and the highest demonstration at each frame; for a
    plan of another horizon or time step, the range over all frames.

    Raises:
        InvalidPlanError: The demonstrations have other columns than the plan.
    """
    check = "demonstrations"
    if demonstrations is None:
        return unchecked(check, "no demonstrations given")
    if demonstrations.format.names != plan.format.names:
        raise InvalidPlanError(
            f"the plan's columns {plan.format.names} are not the demonstrations' "
            f"{demonstrations.format.names}; give the demonstrations it was learned from"
        )
    shown = demonstrations.plans
    low, high = shown.min(axis=(0, 1)), shown.max(axis=(0, 1))
    span = high - low
    if demonstrations.horizon == plan.horizon and math.isclose(
        demonstrations.format.dt, plan.format.dt
    ):
        low, high = shown.min(axis=0), shown.max(axis=0)
    beyond = np.maximum(np.maximum(low - plan.actions, plan.actions - high), 0.0)
    # A channel that was shown constant has no range; any visible departure from it counts fully.
    share = beyond / np.maximum(span, 1e-3)
    frame, column = np.unravel_index(int(np.argmax(share)), share.shape)
    value, time = float(share[frame, column]), float(frame * plan.format.dt)
    status: Status = "pass"
    if value > settings.beyond_refuse:
        status = "refuse"
    elif value > settings.beyond_warn:
        status = "warn"
    name, unit = plan.format.names[column], plan.format.units[column]
    if value == 0:
        text = "within the band of the demonstrations at every frame"
        return LimitLine(
            check,
            status,
            0.0,
            settings.beyond_refuse,
            settings.beyond_refuse,
            "1",
            None,
            None,
            text,
        )
    text = (
        f"{name} is {beyond[frame, column]:.3g} {unit} beyond the band, {100 * value:.0f} % of its "
        f"demonstrated range, at {time:.3f} s"
    )
    margin = settings.beyond_refuse - value
    return LimitLine(check, status, value, settings.beyond_refuse, margin, "1", name, time, text)


def check_workspace(
    columns: dict[int, int], limits: RobotLimits, fine: FineMotion, settings: GateSettings
) -> LimitLine:
    """Whether the tool tip stays in the box, through forward kinematics at 1 kHz."""
    check = "workspace"
    if settings.workspace_low is None or settings.workspace_high is None:
        return unchecked(check, "no box given")
    if limits.chain is None:
        return unchecked(check, f"the kinematics of {limits.robot} are not known")
    if len(columns) < len(limits.joint_names):
        return unchecked(check, f"it needs all {len(limits.joint_names)} joints")
    order = [columns[joint] for joint in range(len(limits.joint_names))]
    tip = tool_tip(limits.chain, fine.q[:, order], settings.tool_tip)
    low, high = np.array(settings.workspace_low), np.array(settings.workspace_high)
    distance = np.minimum(tip - low, high - tip)
    sample, axis = np.unravel_index(int(np.argmin(distance)), distance.shape)
    margin, value = float(distance[sample, axis]), float(tip[sample, axis])
    limit = float(low[axis] if value - low[axis] < high[axis] - value else high[axis])
    name, time = "xyz"[axis], float(fine.t[sample])
    text = (
        f"tool tip at {name} = {value:.3f} m, {abs(margin):.3f} "
        f"{'beyond' if margin <= 0 else 'within'} the box's {limit:.3f}, at {time:.3f} s"
    )
    status: Status = "refuse" if margin <= 0 else "pass"
    return LimitLine(check, status, value, limit, margin, "m", name, time, text)
