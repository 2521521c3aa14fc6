"""The manifest that `new` writes: every key with what it means, for a person to edit."""

from __future__ import annotations

TEMPLATE = """\
# A task for Prior Reinforce. Lengths are metres, angles radians, times seconds.

[task]
name = "{name}"

# What one frame of a plan means; dt is the time between two frames.
[plan]
names = {names}
units = {units}
dt = {dt}

# Where the object ends, measured in the table frame: x points from the robot's base over the
# table, y to its left. A goal is reached within the tolerance.
[outcome]
names = {outcome_names}
units = {outcome_units}
tolerance = {tolerance}

# Every plan is held against these limits before it is handed out. The model is "panda", "fr3",
# "given" (with the lists below, one number a joint) or "none". The firmware is that of an FR3's
# system image: ">=5.9", "<5.9" or "any".
[robot]
model = "{robot}"
firmware = "any"
# joint_names = ["joint1", "joint2"]
# lower = [-2.0, -2.0]            # [rad]
# upper = [2.0, 2.0]              # [rad]
# velocity = [2.0, 2.0]           # [rad/s]
# acceleration = [10.0, 10.0]     # [rad/s^2]
# jerk = [5000.0, 5000.0]         # [rad/s^3]

# The program's own lines beside the robot's; all optional.
[gate]
# tool_tip = [0.0, 0.0, 0.1]         # tool tip in the flange's frame [m]
# workspace_low = [0.2, -0.6, 0.0]   # box that the tool tip must stay in [m], base frame
# workspace_high = [0.9, 0.6, 1.2]
# absent_joints = ["joint1"]         # joints that plans leave still on purpose; all others must
#                                    # be among the names of [plan]
# beyond_refuse = 0.5                # how far beyond the demonstrations refuses, in joint ranges
"""
