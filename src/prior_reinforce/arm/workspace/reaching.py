"""What the moved demonstrations of a workspace can reach, and what they are turned about."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.arm.robots.limits import RobotLimits, match_joints
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.generators.reach import (
    Check,
    Reach,
    farthest_between,
    goals_around,
    reach,
    refusal,
)
from prior_reinforce.parsing import as_place
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Polar, Symmetry, find_axis, hand_paths
from prior_reinforce.wording import in_words, say_place

if TYPE_CHECKING:
    from prior_reinforce.arm.workspace.workspace import Workspace


def require_reach(workspace: Workspace, goal: ArrayLike) -> None:
    """Do nothing if moved demonstrations can reach a goal within the robot's limits of now.

    Nothing is known of it before a model of ours is learned, or without symmetry or robot.
    OutOfReachError, with the nearest goal that they can reach, if they cannot.
    """
    training, form = workspace.state.training, workspace.manifest.outcome_format
    if training is None or workspace.state.stale or workspace.manifest.robot is None:
        return
    shown = workspace.demonstrations
    place = as_place(goal, form, shown.outcomes_seen)
    if shown.symmetry is None:
        return
    generator, check = workspace.model, reach_check(workspace)

    def said(goal: Point) -> Point:
        return as_place(say_place(goal, form), form) if in_words(form) else goal

    if why := refusal(generator, place, check):
        straight = _same_direction(shown, shown.symmetry, place)
        if refusal(generator, straight, check):
            possible = reach(generator, goals_around(shown), check)
            nearest = possible.nearest(generator, place, check, said)
        else:
            nearest = farthest_between(generator, straight, place, check, said)
        raise OutOfReachError(
            f"goal {say_place(place, form)} is out of reach: {why}; the nearest that can be "
            f"reached is {say_place(nearest, form)}; demonstrate closer to the goal"
        )


def region_of(workspace: Workspace) -> Reach | None:
    """Which goals can be reached with the model in use, as far as motions may be moved.

    None where no demonstration is moved, or no robot's limits are known.
    """
    shown = workspace.demonstrations
    if shown.symmetry is None or workspace.manifest.robot is None:
        return None
    return reach(workspace.model, goals_around(shown), reach_check(workspace))


def reach_picture(folder: Path, model: str) -> Path:
    """Where in a workspace the picture of that region lies, for a model."""
    return folder / "pictures" / f"reach-{model}.png"


def reach_check(workspace: Workspace) -> Check:
    """What decides whether a goal can be reached: how far motions may be moved, and the gate."""
    shown = workspace.demonstrations
    # A learned distance has no such bound: there `check_goal` warns of extrapolation.
    moved = shown.symmetry if shown.symmetry and not shown.symmetry.learned.any() else None

    def check(plan: Frames, goal: Point) -> str:
        if moved is not None and np.any(shown.far_outside(goal)):
            return f"it is nearer or farther than motions are moved ({moved.name})"
        verdict = workspace.gate(plan, goal)
        return "" if verdict is None else verdict.refusals

    return check


def _same_direction(shown: Demonstrations, symmetry: Symmetry, goal: Point) -> Point:
    """Return the goal's bearing or shift at the distance of the nearest demonstration."""
    z, aim = symmetry.chart.to(shown.outcomes_seen), symmetry.chart.to(goal)
    apart = np.linalg.norm(np.where(symmetry.exact, 0.0, z - aim), axis=1)
    return np.asarray(symmetry.chart.back(np.where(symmetry.exact, aim, z[np.argmin(apart)])))


def axis_of(demonstrations: Demonstrations, robot: RobotLimits | None) -> list[str]:
    """What several demonstrations say of the axis that motions are turned about, in a line."""
    symmetry = demonstrations.symmetry
    if symmetry is None or not isinstance(symmetry.chart, Polar):
        return []
    columns = [] if robot is None else [*match_joints(demonstrations.format, robot).values()]
    chain = None if robot is None else robot.chain
    paths = hand_paths(symmetry, demonstrations.plans, chain, columns)
    seen = demonstrations.outcomes_seen
    found = None if paths is None else find_axis(paths, seen, symmetry.chart)
    return [] if found is None else [str(found)]
