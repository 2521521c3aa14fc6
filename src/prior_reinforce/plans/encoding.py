"""What is in a plan's file.

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
from typing import Any, Literal

import numpy as np

from prior_reinforce.plans.interpolation import FineMotion, interpolate
from prior_reinforce.plans.motions import Plan, PlanFormat

PlanFileFormat = Literal["npz", "csv", "json"]
FILE_FORMAT = "prior-reinforce plan"
FILE_VERSION = 1


def encode_plan(plan: Plan, format: PlanFileFormat, *, rate: float | None = None) -> bytes:
    """The bytes of a plan's file, the same for the same plan."""
    fine = interpolate(plan.actions, plan.format.dt, rate=rate or 1 / plan.format.dt)
    if rate is None:
        # On the frames themselves the spline is exact to rounding; write them as they are.
        fine = FineMotion(plan.times, np.array(plan.actions), fine.dq, fine.ddq, fine.dddq)
    if format == "npz":
        return _as_npz(plan, fine, 1 / rate if rate else plan.format.dt)
    return _as_csv(plan.format, fine) if format == "csv" else _as_json(plan.format, fine)


def _as_npz(plan: Plan, fine: FineMotion, dt: float) -> bytes:
    metadata = {
        "file_format": FILE_FORMAT,
        "version": FILE_VERSION,
        "joint_names": plan.format.names,
        "units": plan.format.units,
        "dt": dt,
    }
    buffer = io.BytesIO()
    # numpy stamps every member with the same date, so the bytes depend on the plan alone.
    np.savez(
        buffer,
        t=fine.t,
        q=fine.q,
        dq=fine.dq,
        ddq=fine.ddq,
        metadata=np.array(json.dumps(metadata)),
    )
    return buffer.getvalue()


def _as_csv(format: PlanFormat, fine: FineMotion) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    prefixes = ("", "d_", "dd_")
    writer.writerow(["t", *(prefix + name for prefix in prefixes for name in format.names)])
    # repr of a float is the shortest text that reads back as the same number.
    writer.writerows(
        [repr(float(value)) for value in row]
        for row in np.column_stack([fine.t, fine.q, fine.dq, fine.ddq])
    )
    return text.getvalue().encode()


def _as_json(format: PlanFormat, fine: FineMotion) -> bytes:
    message: dict[str, Any] = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(format.names),
        "points": [
            {
                "positions": q.tolist(),
                "velocities": dq.tolist(),
                "accelerations": ddq.tolist(),
                "effort": [],
                "time_from_start": _duration(float(t)),
            }
            for t, q, dq, ddq in zip(fine.t, fine.q, fine.dq, fine.ddq, strict=True)
        ],
    }
    return (json.dumps(message, indent=1) + "\n").encode()


def _duration(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * 1e9)
    whole = math.floor(nanoseconds / 1_000_000_000)
    return {"sec": whole, "nanosec": nanoseconds - whole * 1_000_000_000}
