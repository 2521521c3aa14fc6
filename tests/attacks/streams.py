"""Streams that shake an arm, and what they ask of it by a computation that is not the gate's.

    python -m tests.attacks.streams 1000

Noise, bursts, spikes, saws, alternation, chirps and a few frames only, at 0.5 to 20 ms a frame, go
to every arm: as they are, at another rate, or from where an arm stands a little off them. What the
gate lets through is looked at as scipy's spline, as the plan files' own differences, and as a ROS 2
joint trajectory controller joins them, at 20 kHz. Nothing may be above 100 % of a limit.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from prior_reinforce.arm.executing.base import begin_at
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.arm.robots.plan_files import resample_plan, write_plan
from prior_reinforce.arm.robots.presets import PRESETS, robot_limits
from prior_reinforce.arm.robots.urdf import read_urdf
from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from tests.arm.robots.arms import ur5e, write_urdf

KINDS = ("noise", "bursts", "spikes", "saws", "alternation", "chirps", "brief")
FINE = 20_000.0
FULL_SPEED_WITHIN, FULL_ACCELERATION_WITHIN = 0.05, 0.002
"""In [s], as docs/robots.md says them of arms without published accelerations and jerks."""


def arms(folder: Path) -> dict[str, RobotLimits]:
    """Every preset, and an arm by its URDF, which has no accelerations."""
    path = write_urdf(folder / "arm.urdf", ur5e())
    return {name: robot_limits(name) for name in PRESETS} | {"urdf": read_urdf(path)}


def allowed(limits: RobotLimits) -> RobotLimits:
    """The limits, with those that nobody publishes filled in."""
    a = limits.velocity / FULL_SPEED_WITHIN if limits.acceleration is None else limits.acceleration
    j = a / FULL_ACCELERATION_WITHIN if limits.jerk is None else limits.jerk
    return replace(limits, acceleration=a, jerk=j)


def shaken(kind: str, limits: RobotLimits, rng: np.random.Generator) -> tuple[Plan, float]:
    """A plan of a kind, and how much of a limit its spline asks for: half of them near 100 %."""
    d, dt = len(limits.joint_names), float(rng.choice([0.5, 1, 1, 2, 3.3, 5, 10, 12.5, 20])) / 1000
    n = int(rng.integers(2, 9) if kind == "brief" else rng.integers(20, 20 + 0.4 / dt))
    t = np.arange(n) * dt
    s = np.linspace(0, 1, n)[:, None]
    swing = (10 * s**3 - 15 * s**4 + 6 * s**5) * rng.uniform(-1, 1, d)
    sign = (-1.0) ** np.arange(n)[:, None]
    if kind in ("noise", "brief"):
        shake = rng.standard_normal((n, d))
    elif kind == "bursts":
        shake = rng.standard_normal((n, d)) * (np.abs(s - rng.uniform(0.2, 0.8)) < 0.05)
    elif kind == "spikes":
        shake = np.zeros((n, d))
        shake[rng.integers(1, n - 1, 3), rng.integers(0, d, 3)] = rng.uniform(-1, 1, 3)
    elif kind == "saws":
        shake = (t[:, None] / rng.uniform(3 * dt, 0.2, d)) % 1.0 - 0.5
    elif kind == "alternation":
        shake = sign * rng.uniform(0, 1, d)
    else:
        top = min(0.5 / dt, 10 ** rng.uniform(0.5, 2.7))
        shake = np.sin(np.pi * top * t[:, None] ** 2 / t[-1] + rng.uniform(0, 6, d))
    calm = np.clip(np.minimum(s, 1 - s) * rng.uniform(4, 20), 0, 1) ** 3
    moved = 10 ** rng.uniform(-2, 0) * swing + 10 ** rng.uniform(-5, 0) * calm * shake
    middle = limits.lower + rng.uniform(0.3, 0.7, d) * (limits.upper - limits.lower)
    form = PlanFormat(limits.joint_names, ("rad",) * d, dt)
    share = asked(Plan(middle + moved, form), limits)
    if rng.random() < 0.5:
        moved *= rng.uniform(0.8, 1.2) / max(share, 1e-9)
        share = asked(Plan(middle + moved, form), limits)
    return Plan(middle + moved, form), share


def as_sent(plan: Plan, rng: np.random.Generator) -> Plan:
    """The plan itself, at another rate, or from up to 5 mrad off."""
    how = rng.integers(3)
    if how == 0:
        return resample_plan(plan, float(rng.choice([50, 100, 240, 250, 500, 997, 1000])))
    if how == 1:
        return begin_at(plan, plan.actions[0] + rng.uniform(-5e-3, 5e-3, plan.actions.shape[1]))
    return plan


def asked(plan: Plan, limits: RobotLimits, files: Path | None = None) -> float:
    """The largest share of a limit that a plan asks for, as its spline and as its files have it."""
    limits, dt = allowed(limits), plan.format.dt
    end = plan.times[-1]
    spline = CubicSpline(plan.times, plan.actions, bc_type="clamped")
    t = np.append(np.arange(0, end, 1 / FINE), end)
    shares = [
        position(spline(t), limits),
        velocity(spline(t), spline(t, 1), limits),
        np.abs(spline(t, 2) / limits.acceleration).max(),
        np.abs(spline(t, 3) / limits.jerk).max(),
        differences(spline(np.clip(np.arange(-0.01, end + 0.01, 1e-3), 0, end)), 1e-3, limits),
    ]
    if files is None:
        return float(max(shares))
    q, dq, ddq = points(write_plan(plan, files / "plan.json").path)
    shares.append(differences(q, dt, limits))
    joined, djoined, ddjoined = quintics(q, dq, ddq, dt)
    shares += [
        position(joined, limits),
        velocity(joined, djoined, limits),
        np.abs(ddjoined / limits.acceleration).max(),
    ]
    return float(max(shares))


def position(q: np.ndarray, limits: RobotLimits) -> float:
    """1 at a joint's end, 0 in the middle of its range."""
    middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
    return float((np.abs(q - middle) / half).max())


def velocity(q: np.ndarray, dq: np.ndarray, limits: RobotLimits) -> float:
    low, high = limits.velocity_bounds(q)
    bound = np.where(dq < 0, -low, high)
    return float(np.where(np.abs(dq) < 1e-6, 0, np.abs(dq) / np.maximum(bound, 1e-9)).max())


def differences(q: np.ndarray, step: float, limits: RobotLimits) -> float:
    """What a controller sees that takes differences of set points, held before and after."""
    held = np.concatenate([np.repeat(q[:1], 4, axis=0), q, np.repeat(q[-1:], 4, axis=0)])
    # Rounding of positions around 3 rad, which differences multiply.
    rounding = 2 * np.finfo(float).eps * np.abs(q).max()
    dq, ddq, dddq = (np.diff(held, order, axis=0) / step**order for order in (1, 2, 3))
    low, high = limits.velocity_bounds(held)
    high, low = np.maximum(high[1:], high[:-1]), np.minimum(low[1:], low[:-1])
    bound = np.where(dq < 0, -low, high)
    shares = [
        np.where(np.abs(dq) < 1e-6, 0, np.abs(dq) / np.maximum(bound, 1e-9)).max(),
        ((np.abs(ddq) - 4 * rounding / step**2) / limits.acceleration).max(),
        ((np.abs(dddq) - 8 * rounding / step**3) / limits.jerk).max(),
    ]
    return float(max(shares))


def points(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations of a trajectory_msgs/JointTrajectory."""
    message = json.loads(path.read_text())["points"]
    keys = ("positions", "velocities", "accelerations")
    q, dq, ddq = (np.array([point[key] for point in message]) for key in keys)
    return q, dq, ddq


def quintics(
    q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations between points, as control.ros.org joins them."""
    power = np.arange(6)

    def row(u: float, order: int) -> np.ndarray:
        factor = np.prod([power - i for i in range(order)], axis=0) if order else np.ones(6)
        return factor * u ** np.maximum(power - order, 0)

    ends = np.array([row(u, order) for u in (0.0, 1.0) for order in range(3)])
    at = [part * h**order for order, part in enumerate((q, dq, ddq))]
    known = np.stack([*(x[:-1] for x in at), *(x[1:] for x in at)])
    c = np.tensordot(np.linalg.inv(ends), known, axes=1)
    inside = np.linspace(0, 1, max(2, round(h * FINE) + 1))
    found = []
    for order in range(3):
        rows = np.array([row(u, order) for u in inside])
        found.append(np.tensordot(rows, c, axes=1).reshape(-1, q.shape[1]) / h**order)
    return found[0], found[1], found[2]


def attack(arm: str, limits: RobotLimits, kind: str, seed: int) -> tuple[bool, float]:
    """Whether the gate refuses a stream, and what it asks for; in all of its forms if it passes."""
    rng = np.random.default_rng([seed, *f"{arm} {kind}".encode()])
    plan, share = shaken(kind, limits, rng)
    try:
        if (sent := as_sent(plan, rng)) is not plan:
            plan, share = sent, asked(sent, limits)
        if check_plan(plan, limits).refused:
            return True, share
    except InvalidPlanError:  # closer frames than the arm's cycles, or another motion
        return True, share
    with tempfile.TemporaryDirectory() as files:
        return False, asked(plan, limits, Path(files))


def main(cases: int) -> int:
    """Print a table by arm and kind; the exit status counts what may not have passed."""
    broken = 0
    with tempfile.TemporaryDirectory() as folder:
        print("arm      kind         refused  (below 95 %)   within  above      worst")
        known = arms(Path(folder))
        each = -(-cases // (len(known) * len(KINDS)))
        for arm, limits in known.items():
            for kind in KINDS:
                seen: Counter[str] = Counter()
                worst = 0.0
                for seed in range(each):
                    refused, share = attack(arm, limits, kind, seed)
                    seen["refused" if refused else "within" if share <= 1 else "above"] += 1
                    seen["wrongly"] += refused and share < 0.95
                    worst = worst if refused else max(worst, share)
                broken += seen["above"]
                counts = "".join(
                    f"{seen[key]:{width}}"
                    for key, width in (("refused", 8), ("wrongly", 13), ("within", 9), ("above", 7))
                )
                print(f"{arm:8} {kind:12}{counts} {100 * worst:9.3f} %", flush=True)
    return broken


if __name__ == "__main__":
    sys.exit(min(main(int(sys.argv[1])), 100))
