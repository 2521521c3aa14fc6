"""Plans on disk: written once, read-only, known by their SHA-256 hash.

`npz` and `csv` hold t, q, dq, ddq; `json` has the field order of ROS 2's
trajectory_msgs/JointTrajectory. Velocities and accelerations go with the positions because a ROS 2
joint trajectory controller interpolates positions alone linearly, and all three by quintics
(control.ros.org, joint_trajectory_controller).
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast, get_args

import numpy as np

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidPlanError,
    WorkspaceError,
)
from prior_reinforce.files import as_cell, open_npz, sha256, write_once
from prior_reinforce.plans.interpolation import RATE, interpolate, join_frames
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat, stepped, summed
from prior_reinforce.units import NS_PER_S

PlanFileFormat = Literal["npz", "csv", "json"]
_FILE_FORMAT = "prior-reinforce plan"
_FILE_VERSION = 1
_LARGEST_CHANGE = 1e-4
"""By which a motion may change when fewer samples are written, in its units; ours: a twentieth of
the offset that moves a throw by a millimetre."""


@dataclass(frozen=True)
class PlanFile:
    """A plan that was written once and will never change."""

    path: Path
    """Where it lies."""
    sha256: str
    """Hash of the file's bytes, 64 hexadecimal digits."""

    def verify(self) -> bytes:
        """Return the file's bytes, if they are still what was written.

        FileFormatError if it is gone, unreadable, or its bytes have another hash.
        """
        try:
            content = self.path.read_bytes()
        except OSError as error:
            raise FileFormatError(
                f"cannot read the plan {self.path} ({error.strerror}); put the file back"
            ) from error
        if (found := sha256(content)) != self.sha256:
            raise FileFormatError(
                f"{self.path} has SHA-256 {found[:12]}..., expected {self.sha256[:12]}...; plans "
                "never change: put the original back, or void the trial"
            )
        return content


def write_plan(
    plan: Plan,
    path: str | os.PathLike[str],
    *,
    format: PlanFileFormat | None = None,
) -> PlanFile:
    """Write a plan, durable and read-only; the suffix gives the format unless `format` does.

    Nothing is held against a robot's limits: call `check_plan(plan, ...).require()` before. The
    same plan always gives the same bytes, and so the same hash.

    Args:
        plan: The plan.
        path: Where to; an existing file with the same content is kept, another one is an error.
        format: `npz` (t, q, dq, ddq), `csv`, or `json` in ROS 2 JointTrajectory's field order.

    Raises:
        ConfigurationError: An unknown format or suffix.
        FileFormatError: Another file is there already.
        WorkspaceError: The disk is full or the folder read-only; nothing is left behind.
    """
    path = Path(path)
    content = _encode(plan, check_plan_path(path, format=format))
    return PlanFile(write_once(path, content), sha256(content))


def check_plan_path(
    path: Path, *, format: PlanFileFormat | None = None, rate: float | None = None
) -> PlanFileFormat:
    """Return the format that `write_plan` would write; nothing is written.

    ConfigurationError for an unknown format or suffix, InvalidPlanError for a rate that no plan can
    be resampled at, WorkspaceError if there is no folder to write to.
    """
    kind = format or path.suffix.lower().removeprefix(".")
    if kind not in get_args(PlanFileFormat):
        raise ConfigurationError(
            f"cannot write a plan as {kind or path.name!r}; end the name in .npz, .csv or .json, "
            "or say the format"
        )
    if rate is not None:
        _check_rate(rate)
    if not path.parent.is_dir():
        raise WorkspaceError(f"cannot write {path}, there is no such folder; make the folder first")
    return cast(PlanFileFormat, kind)


def read_plan(path: str | os.PathLike[str], *, sha256: str | None = None) -> Plan:
    """Read an NPZ plan, and check its hash where one is given.

    Raises:
        FileFormatError: Missing, damaged, or not what the hash says.
        InvalidPlanError: It holds no plan that could be executed.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(f"no plan at {path}; give the path of an .npz plan file")
    if sha256 is not None:
        PlanFile(path, sha256).verify()
    with open_npz(path, "it must be a plan file; write one with write_plan or `export`") as archive:
        q, metadata = np.array(archive["q"]), json.loads(str(archive["metadata"]))
        if metadata["file_format"] != _FILE_FORMAT or metadata["version"] != _FILE_VERSION:
            raise ValueError(f"written as {metadata['file_format']} {metadata['version']}")
        names, units = tuple(metadata["joint_names"]), tuple(metadata["units"])
        return Plan(q, PlanFormat(names, units, float(metadata["dt"])))


def resample_plan(plan: Plan, rate: float, *, within: float = _LARGEST_CHANGE) -> Plan:
    """The plan with so many frames a second: nearly the same motion, and checked as one of its own.

    Args:
        plan: The plan.
        rate: Frames a second, at most one a cycle of the arm: finer ones could not be checked.
        within: By which the motion may change, in the plan's units.

    Raises:
        InvalidPlanError: Another rate, or one at which it is another motion.
    """
    _check_rate(rate)
    if math.isclose(rate * plan.format.dt, 1):
        return plan
    increments = plan.format.increments
    poses = summed(plan.actions, increments) if increments else plan.actions
    fine = interpolate(poses, plan.format.dt, rate=rate).q
    again = Plan(
        stepped(fine, increments) if increments else fine, replace(plan.format, dt=1 / rate)
    )
    t = np.arange(0, plan.times[-1], 1 / RATE)
    one, other = (
        join_frames(each, dt)(t) for each, dt in ((poses, plan.format.dt), (fine, 1 / rate))
    )
    if not (off := float(np.abs(one - other).max())) <= within:
        raise InvalidPlanError(
            f"at {rate:g} samples a second the plan is another motion, {off:.2g} off the one that "
            f"was learned; give a multiple of {1 / plan.format.dt:g}, up to {RATE:g}"
        )
    return again


def _check_rate(rate: float) -> None:
    if not 0 < rate <= RATE * (1 + 1e-9):
        raise InvalidPlanError(
            f"rate must be a number of samples a second up to {RATE:g}, got {rate}"
        )


def _encode(plan: Plan, format: PlanFileFormat) -> bytes:
    """The bytes of a plan's file, the same for the same plan."""
    # A quintic through q, dq and ddq, as ROS 2 joins them, is the spline that the gate looks at.
    t, q, spline = plan.times, plan.actions, join_frames(plan.actions, plan.format.dt)
    dq, ddq = spline(t, 1), spline(t, 2)
    names = plan.format.names
    if format == "npz":
        metadata = {"file_format": _FILE_FORMAT, "version": _FILE_VERSION, "joint_names": names}
        metadata |= {"units": plan.format.units, "dt": plan.format.dt}
        npz = io.BytesIO()
        # numpy stamps every member with the same date, so the bytes depend on the plan alone.
        np.savez(npz, t=t, q=q, dq=dq, ddq=ddq, metadata=np.array(json.dumps(metadata)))
        return npz.getvalue()
    if format == "csv":
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        heads = (prefix + name for prefix in ("", "d_", "dd_") for name in names)
        writer.writerow(["t", *map(as_cell, heads)])
        # Each number is the shortest text that reads back as the same one.
        writer.writerows(np.column_stack([t, q, dq, ddq]).tolist())
        return text.getvalue().encode()
    times = [divmod(round(seconds * NS_PER_S), NS_PER_S) for seconds in t.tolist()]
    points = [
        {
            "positions": q[k].tolist(),
            "velocities": dq[k].tolist(),
            "accelerations": ddq[k].tolist(),
            "effort": [],
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        }
        for k, (sec, nanosec) in enumerate(times)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    message = {"header": header, "joint_names": names, "points": points}
    return (json.dumps(message, indent=1) + "\n").encode()
