"""Trajectory messages of ROS: via points, joined as ros2_control joins them.

It takes cubics through stated velocities, quintics through accelerations too, else straight lines.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_numbers
from prior_reinforce.arm.recordings.clock import clock_of
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import Recording, recorded

_PERIOD = 0.01
"""Between frames of a motion that is made of via points, in [s]; points that lie closer are its
frames. Ours: controllers run at 100 Hz and more."""


def read_trajectory(path: Path, episode: str, message: Any, options: ReadOptions) -> Recording:
    """One trajectory_msgs/JointTrajectory as an episode; FileFormatError if it lasts too long."""
    points, joints = message.points, tuple(message.joint_names)
    times = np.array([p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in points])
    positions = np.array([p.positions for p in points], dtype=float).reshape(len(times), -1)
    stated = [positions]
    for derivative in ("velocities", "accelerations"):
        rows = [getattr(point, derivative) for point in points]
        if any(len(row) != len(joints) for row in rows) or not np.all(np.isfinite(rows)):
            break
        stated.append(np.array(rows, dtype=float))
    remarks = []
    steps = np.diff(times)
    if len(stated) > 1 and len(steps) and steps.min() > 0 and np.median(steps) > 2.01 * _PERIOD:
        from scipy.interpolate import BPoly

        frames = math.ceil((times[-1] - times[0]) / _PERIOD - 1e-6) + 1
        check_numbers(path, episode, (frames, len(joints)))
        curve = BPoly.from_derivatives(times, np.stack(stated, axis=1))
        degree = "cubics through their velocities" if len(stated) == 2 else "quintics"
        remarks.append(f"{len(times)} via points joined by {degree}, as a controller joins them")
        times = np.linspace(times[0], times[-1], frames)
        positions = curve(times)
    clock = clock_of(episode, len(times), options, stamps=times, name="time_from_start", unit="s")
    return recorded(episode, clock, positions, joints, remarks=remarks)
