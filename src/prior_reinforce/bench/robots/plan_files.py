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
import os
from dataclasses import dataclass
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
from prior_reinforce.plans.interpolation import interpolate
from prior_reinforce.plans.motions import Plan, PlanFormat

PlanFileFormat = Literal["npz", "csv", "json"]
_FILE_FORMAT = "prior-reinforce plan"
_FILE_VERSION = 1
_LARGEST_CHANGE = 1e-4
"""By which a motion may change when fewer samples are written, in its units; ours: a twentieth of
the offset that moves a throw by a millimetre."""
_HIGHEST_RATE = 1e5
"""Samples a second; ours: a hundred times what the fastest arms are sent, in a file still small."""


@dataclass(frozen=True)
class PlanFile:
    """A plan that was written once and will never change."""

    path: Path
    """Where it lies."""
    sha256: str
    """Hash of the file's bytes, 64 hexadecimal digits."""

    def verify(self) -> bytes:
        """Return the file's bytes, if they are still what was written.

        Raises:
            FileFormatError: It is gone, unreadable, or its bytes have another hash.
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
    rate: float | None = None,
) -> PlanFile:
    """Write a plan, durable and read-only; the suffix gives the format unless `format` does.

    Nothing is held against a robot's limits: call `check_plan(plan, ...).require()` before. The
    same plan always gives the same bytes, and so the same hash.

    Args:
        plan: The plan.
        path: Where to; an existing file with the same content is kept, another one is an error.
        format: `npz` (t, q, dq, ddq), `csv`, or `json` in ROS 2 JointTrajectory's field order.
        rate: Samples a second; None writes the plan's own frames.

    Raises:
        ConfigurationError: An unknown format or suffix.
        FileFormatError: Another file is there already.
        InvalidPlanError: A rate that is not a positive number, or at which it is another motion.
        WorkspaceError: The disk is full or the folder read-only; nothing is left behind.
    """
    path = Path(path)
    kind = check_plan_path(path, format=format, rate=rate)
    if rate is not None:
        _check_rate(plan, rate)
    content = _encode(plan, kind, rate)
    return PlanFile(write_once(path, content), sha256(content))


def check_plan_path(
    path: Path, *, format: PlanFileFormat | None = None, rate: float | None = None
) -> PlanFileFormat:
    """Return the format that `write_plan` would write; nothing is written.

    Raises:
        ConfigurationError: An unknown format or suffix.
        InvalidPlanError: A rate that no plan can be sampled at.
        WorkspaceError: There is no folder to write to.
    """
    kind = format or path.suffix.lower().removeprefix(".")
    if kind not in get_args(PlanFileFormat):
        raise ConfigurationError(
            f"cannot write a plan as {kind or path.name!r}; end the name in .npz, .csv or .json, "
            "or say the format"
        )
    if rate is not None and not 0 < rate <= _HIGHEST_RATE:
        raise InvalidPlanError(
            f"rate must be a number of samples a second up to {_HIGHEST_RATE:g}, got {rate}"
        )
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


def _check_rate(plan: Plan, rate: float) -> None:
    """Refuse a rate whose samples, joined as frames are, give another motion than was checked."""
    same = interpolate(plan.actions, plan.format.dt)
    samples = interpolate(plan.actions, plan.format.dt, rate=rate).q
    again = interpolate(samples, 1 / rate)
    n = min(len(same.q), len(again.q))
    off = float(np.abs(again.q[:n] - same.q[:n]).max())
    if not off <= _LARGEST_CHANGE:
        raise InvalidPlanError(
            f"at {rate:g} samples a second the plan is another motion, {off:.2g} off the one that "
            f"was checked; give a multiple of {1 / plan.format.dt:g}"
        )


def _encode(plan: Plan, format: PlanFileFormat, rate: float | None) -> bytes:
    """The bytes of a plan's file, the same for the same plan."""
    dt = 1 / rate if rate else plan.format.dt
    fine = interpolate(plan.actions, plan.format.dt, rate=rate or 1 / plan.format.dt)
    t, q, dq, ddq = fine.t, fine.q, fine.dq, fine.ddq
    if rate is None:
        # On the frames themselves the spline is exact to rounding; write them as they are.
        t, q = plan.times, plan.actions
    names = plan.format.names
    if format == "npz":
        metadata = {"file_format": _FILE_FORMAT, "version": _FILE_VERSION, "joint_names": names}
        metadata |= {"units": plan.format.units, "dt": dt}
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
    times = [divmod(round(seconds * 1e9), 10**9) for seconds in t.tolist()]
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
