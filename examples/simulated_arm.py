"""A stand-in for an arm on another machine: throws one plan in simulation, and calls the landing.

    prior-reinforce ask hoop --yes --run "python examples/simulated_arm.py {plan} --goal 1.05 -0.10"

It knows nothing of workspaces: it gets a plan file (NPZ with t, q, dq, ddq), lets the simulated
Panda throw the ball with the disturbances of a real arm, and says where the ball came down as an
operator at the table would, in words and to half a centimetre; a ball that never comes down at the
hoop's height is "lost". `--call FILE` writes the same words to a file, so that they can be told
without being typed.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

import prior_reinforce as pr

CALLED_TO = 0.005
"""What an eye can tell apart, in [m]."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", type=Path, help="NPZ file with t [s], q [rad], dq, ddq")
    parser.add_argument("--goal", type=float, nargs=2, required=True, help="where the hoop is [m]")
    parser.add_argument("--task", default="basketball-v1", help="hardware: basketball-v1, -v2, -v3")
    parser.add_argument("--call", type=Path, help="write what the operator calls to this file")
    parser.add_argument("--seed", type=int, default=0, help="of the disturbances")
    options = parser.parse_args()

    task = pr.make_task(options.task)
    rollout = throw(task, options.plan, options.seed)
    error = rollout.outcome - options.goal
    if not rollout.valid:
        called, where = "lost", "never came down at the hoop's height:"
    elif np.linalg.norm(error) <= task.tolerance:
        called, where = "hit", "went through the hoop:"
    else:
        called, where = pr.to_words(np.round(error / CALLED_TO) * CALLED_TO), "came down"
    if options.call is not None:
        options.call.write_text(called + "\n")
    print(f"the ball {where} {called}")
    return 0


def throw(task, path, seed):
    """Execute a plan file; every plan meets disturbances of its own."""
    with np.load(path) as plan:
        t, q, dq = plan["t"], plan["q"], plan["dq"]
    # The task's controller takes frames at its own rate, whatever rate the file has.
    frames = np.arange(0.0, t[-1] + task.format.dt / 2, task.format.dt)
    actions = CubicHermiteSpline(t, q, dq)(np.minimum(frames, t[-1]))
    digest = int.from_bytes(hashlib.sha256(q.tobytes()).digest()[:4], "little")
    return task.rollout(actions[None], np.random.default_rng([seed, digest]))[0]


if __name__ == "__main__":
    raise SystemExit(main())
