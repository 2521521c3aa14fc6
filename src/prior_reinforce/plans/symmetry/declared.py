"""Declare a symmetry by what a person knows of a task, and by the format of its plans.

- *The arm carries the object until it leaves*: turns about the base (`about="base"`).
- *It pushes or strikes an object that lies at (x, y)*: turns about that place (`about=(x, y)`).
- *The motion may happen anywhere on the table*: shifts (`distance="shift"`), of poses alone.
- *Neither*: `about=None`; one outcome is then reached by tempo or amplitude.
- *Only a turn is known* (`distance="learned"`): several demonstrations determine all the rest.

The names and units of plans distinguish joints of a known arm, poses (x and y in m, with rx, ry and
rz, or qw, qx, qy and qz, or yaw), and increments of poses (dx, dy, dyaw) along the table's axes.
Odometry, whose increments are along the robot's own axes, must be recorded as poses.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from typing import Literal, get_args

import numpy as np
from msgspec import UNSET

from prior_reinforce.arrays import is_positive
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.channels import is_coordinate, is_of_pose, is_tool_state
from prior_reinforce.plans.kinematics import UPRIGHT, Chain, first_axis, leaning
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry.moves import (
    NOMINAL_EXPONENT,
    Amplitude,
    AnyMove,
    Columns,
    Learned,
    Tempo,
    TurnIncrements,
    TurnJoint,
    TurnPath,
    TurnPoses,
)
from prior_reinforce.plans.symmetry.symmetry import Symmetry, scale_alone, shift, turn_and_scale
from prior_reinforce.plans.whole_turns import attitudes, euler_angles
from prior_reinforce.units import is_force, kind_of, per_time, rates

About = Literal["base"] | tuple[float, float] | None
Distance = Literal["tempo", "amplitude", "learned", "shift"]
_VECTOR, _QUATERNION = ("rx", "ry", "rz"), ("qw", "qx", "qy", "qz")
_ON_AXIS = 1e-3
"""Largest distance of a place on the first joint's axis, [m]. Ours: half a turn about the one or
the other then differs by 2 mm."""
_LEAD = 8
"""Frames of increments that lead the hand to its moved start (ours)."""


def declare_symmetry(
    form: PlanFormat,
    k: int,
    *,
    about: About = None,
    distance: Distance = "tempo",
    chain: Chain | None = None,
    joints: Sequence[int] = (),
    ranges: Sequence[tuple[float, float]] = (),
    start: tuple[float, float] = (0.0, 0.0),
    release_frame: float | None = None,
    steps: Sequence[str] = (),
    stays: Sequence[str] = (),
    exponent: float = NOMINAL_EXPONENT,
) -> Symmetry:
    """Make the declared symmetry of a task.

    Args:
        form: Of its plans.
        k: Components of its outcomes; x and y first if there are several.
        about: The axis about which the motion may be turned.
        distance: The scaling by which it reaches farther; `learned`: from several demonstrations,
            as then every further component of the outcome.
        chain: The arm, for plans of its joints; its base frame is the outcomes'.
        joints: Columns of the chain's joints, in its order.
        ranges: Their limits, [rad]; turned plans go the other way round if only that fits.
        start: (x, y) of the hand before increments, [m].
        release_frame: Frame of the release, if a clock releases and not the motion.
        steps: Names of grippers and triggers: neither turned nor enlarged, and interpolated
            linearly.
        stays: Names of columns that a turn or a shift leaves alone, but tempo and amplitude scale.
        exponent: p of distance ~ speed^p: 1 for a level throw from a height, whose fall takes the
            same time at any speed; 2 for a throw upwards and a slide; less by the share of the
            distance that the object is carried.

    Raises:
        ConfigurationError: Plans or outcomes do not permit it.
    """
    column = {name: index for index, name in enumerate(form.names)}
    for key, named in (("steps", steps), ("stays", stays)):
        if unknown := sorted(set(named) - set(column)):
            raise ConfigurationError(
                f"{key} names {unknown}, but plans have {', '.join(form.names)}"
            )
    if distance not in get_args(Distance):
        raise ConfigurationError(
            f"distance is one of {', '.join(get_args(Distance))}, got {distance!r}"
        )
    if not is_positive(abs(exponent)):  # negative where faster is less
        raise ConfigurationError(f"exponent must be a finite number and not 0, got {exponent!r}")
    if release_frame is not None and not release_frame >= 0:
        raise ConfigurationError(f"release_frame counts frames from 0, got {release_frame!r}")
    if release_frame is not None and distance != "tempo":
        raise ConfigurationError(
            f"release_frame says about which frame tempo plays a motion; distance is {distance!r}"
        )
    _refuse_unplayable(form, distance, steps)
    left = (*steps, *stays)
    speeds = rates(form.units)
    increments = tuple(sorted({*form.increments, *speeds}))
    if distance == "shift":
        place = _columns(column, ("x", "y")) or _columns(column, ("dx", "dy"))
        if len(place) != 2 or k != 2:
            raise ConfigurationError(
                "distance 'shift' needs plans with x and y (or dx and dy) and outcomes x and y; "
                f"plans have {', '.join(form.names)}, outcomes {k} components"
            )
        _refuse_rates(form, place, speeds)
        known = (*place, *speeds, *_named(column, ("z", "dx", "dy", "dz")))
        _refuse_left_behind(form, "shift", known, left, _places(form))
        return shift((place[0], place[1]), _LEAD if place[0] in increments else 0)
    stepped = tuple(column[name] for name in steps)
    scale: AnyMove = Amplitude(exponent, stepped, increments)
    others: tuple[AnyMove, ...] = ()
    if distance == "learned":
        scale, others = Learned(), (Learned(),) * max(k - 2, 0)
    elif distance == "tempo":
        clocked = release_frame is not None
        scale = Tempo(exponent, release_frame, clocked, stepped, increments)
    if about is None:
        if distance == "learned":
            raise ConfigurationError(
                "with distance 'learned' a turn is all that is known: say about what the motion "
                "may be turned, or leave the symmetry out"
            )
        if k != 1:
            raise ConfigurationError(
                f"an outcome of {k} components needs an axis to turn about, or shifts; say about "
                "what the motion may be turned, or leave the symmetry out"
            )
        return scale_alone(scale)
    if k < 2:
        raise ConfigurationError(
            "a turn moves outcomes x and y, but outcomes have one component; leave the turn out"
        )
    if k != 2 + len(others):
        raise ConfigurationError(
            f"a turn and {distance} move outcomes x and y, but outcomes have {k} components; say "
            "distance = 'learned' (several demonstrations tell all but the bearing), leave the "
            "symmetry out, or make one of moves for each (plans.symmetry)"
        )
    centre = _centre(about)
    if chain is not None and joints:
        _refuse_rates(form, joints, increments)
        _refuse_left_behind(form, "turn", joints, left)
        if about != "base" and not _on_first_axis(chain, centre):
            path = TurnPath(chain, centre, tuple(joints), tuple(ranges) or UNSET)
            return turn_and_scale(path, centre, scale, others)
        gain, centre = _first_joint(chain)
        first = TurnJoint(joints[0], gain, range=ranges[0] if ranges else UNSET)
        return turn_and_scale(first, centre, scale, others)
    if place := _columns(column, ("x", "y")):
        vector, quaternion = _columns(column, _VECTOR), _columns(column, _QUATERNION)
        for group in euler_angles(form.names, form.units):
            is_vector = {*group} == {*_VECTOR} and not {*group} <= {*form.periodic}
            if "yaw" not in group and not is_vector:
                raise ConfigurationError(
                    f"{', '.join(group)} are Euler angles, and of attitudes a turn knows rotation "
                    "vectors rx, ry, rz in radians, quaternions qw, qx, qy, qz, and yaw; record "
                    "one of these, or take [symmetry] out"
                )
        known = (*place, *vector, *quaternion, *_named(column, ("z", "yaw")))
        if "yaw" in column:  # about the vertical, no other of these angles changes
            known += _named(column, ("roll", "pitch"))
        _refuse_rates(form, known, speeds)
        _refuse_left_behind(form, "turn", known, left)
        turn: AnyMove = TurnPoses(
            centre, (place[0], place[1]), vector or None, quaternion or None, column.get("yaw")
        )
        return turn_and_scale(turn, centre, scale, others)
    if place := _columns(column, ("dx", "dy")):
        known = _named(column, ("dx", "dy", "dz", "dyaw"))
        _refuse_rates(form, known, speeds)
        _refuse_left_behind(form, "turn", known, left)
        turn = TurnIncrements(start, centre, (place[0], place[1]), column.get("dyaw"), _LEAD)
        return turn_and_scale(turn, centre, scale, others)
    raise ConfigurationError(
        f"plans of {', '.join(form.names)} cannot be turned: name the arm ([robot]; in Python "
        "chain=robot_limits('ur5e').chain, or arm.robots.urdf.read_urdf(path).chain, and the "
        "columns of its joints, joints=range(6)), or give poses x and y, or increments dx and dy"
    )


def _centre(about: object) -> tuple[float, float]:
    """Return the place about which a motion is turned, [m]; ConfigurationError if it is none."""
    if about == "base":
        return 0.0, 0.0
    place = np.empty(0)
    with suppress(TypeError, ValueError):
        place = np.array(about, dtype=np.float64)
    if place.shape != (2,) or not np.isfinite(place).all():
        raise ConfigurationError(
            f"about is 'base' (the arm carries the object), the place (x, y) in metres where the "
            f"object lies, or None (no turn), got {about!r}"
        )
    return float(place[0]), float(place[1])


def _columns(column: dict[str, int], names: Sequence[str]) -> Columns:
    """Return the columns of these names if all of them exist, else none."""
    found = _named(column, names)
    return found if len(found) == len(names) else ()


def _named(column: dict[str, int], names: Sequence[str]) -> Columns:
    """Return the columns of those of these names that exist."""
    return tuple(column[name] for name in names if name in column)


def _refuse_left_behind(
    form: PlanFormat,
    move: str,
    known: Collection[int],
    stays: Collection[str],
    among: Iterable[int] | None = None,
) -> None:
    """Refuse columns that a move would not change, unless they are openings or are named.

    A second place, a heading of another name or a velocity turns with the motion.
    """
    candidates = range(form.action_dim) if among is None else among
    left = [
        name
        for name in (form.names[i] for i in candidates if i not in known)
        if name not in stays and not _stays(form, name)
    ]
    if left:
        raise ConfigurationError(
            f"a {move} would leave {', '.join(left)} as recorded: it moves the arm's joints, or x, "
            "y, z, yaw, rx, ry, rz in radians, qw, qx, qy, qz, and increments dx, dy, dz, dyaw; "
            f"rename columns that are these, and of what is right so say stays = {left}"
        )


def _stays(form: PlanFormat, name: str) -> bool:
    """Whether a column is valid in any place: a tool's opening, or one number a plan."""
    return is_tool_state(name) or (name in form.per_plan and not is_of_pose(name))


def _places(form: PlanFormat) -> list[int]:
    """Return the columns of a length, or named as a coordinate, as units may have been guessed."""
    turned = (*form.attitudes, *attitudes(form.names), *euler_angles(form.names, form.units))
    coords = {n for n in form.names if is_coordinate(n)}.difference(*turned)
    each = enumerate(zip(form.names, form.units, strict=True))
    return [i for i, (n, u) in each if kind_of(u) == "length" or (n in coords and not is_force(u))]


def _refuse_rates(form: PlanFormat, moved: Iterable[int], rates: Collection[int]) -> None:
    """Refuse rates among the columns to which a move would add an angle or a displacement."""
    if wrong := [form.names[i] for i in moved if i in rates]:
        raise ConfigurationError(
            f"{', '.join(wrong)} are no positions, to which an angle or a displacement could be "
            "added; record positions of joints, poses x and y in m, or increments dx and dy in m, "
            "or take [symmetry] out"
        )


def _refuse_unplayable(form: PlanFormat, distance: Distance, steps: Sequence[str]) -> None:
    """Refuse columns that would be wrong in a motion that is played faster or enlarged."""
    if distance not in ("tempo", "amplitude"):
        return
    each = [*zip(form.names, form.units, strict=True)]
    wrong = [n for n, u in each if (per_time(u) > 1 or is_force(u)) and not _stays(form, n)]
    if distance == "tempo":
        wrong += [name for name, unit in each if kind_of(unit) == "time"]
    else:
        groups = {*form.attitudes, *attitudes(form.names)}
        quaternions = {name for group in groups if len(group) == 4 for name in group}
        wrong += [name for name in form.names if name in quaternions]
    if wrong := [name for name in wrong if name not in steps]:
        raise ConfigurationError(
            f"{distance} scales positions and rates, and {', '.join(wrong)} would not be right; "
            f"say another distance, or where they are right as recorded, steps = {wrong}"
        )


def _first_joint(chain: Chain) -> tuple[float, tuple[float, float]]:
    """Return the sense of the first joint, 1 or -1, and (x, y) of its axis.

    ConfigurationError if the axis is not vertical.
    """
    along, (x, y) = first_axis(chain)
    lean = leaning(along)
    if lean > UPRIGHT:
        raise ConfigurationError(
            f"the first joint's axis leans by {np.degrees(lean):.3g} degrees from the vertical (z "
            "of the base frame), and no turn of that joint leaves the physics unchanged; mend the "
            "lean if the arm stands upright, or leave the symmetry out and give demonstrations all "
            'around, or, with six joints, turn the whole motion about the base: --symmetry "0 0"'
        )
    return float(np.sign(along[2])), (x, y)


def _on_first_axis(chain: Chain, place: tuple[float, float]) -> bool:
    """Whether a place lies on the first joint's vertical axis; turning that joint is then exact."""
    along, _ = first_axis(chain)
    offset = np.cross(np.subtract((*place, 0.0), chain.origins[0][:3]), along)
    return leaning(along) <= UPRIGHT and bool(np.linalg.norm(offset) <= _ON_AXIS)
