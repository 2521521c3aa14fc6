"""Learn from six demonstrations and reach a new goal of the simulated task, throw by throw.

    python examples/ten_lines.py

As the README's ten lines, but with `diffusion`, which takes half a minute to learn, an eye that
rounds what it sees, and options.
"""

from __future__ import annotations

import argparse

import numpy as np

import prior_reinforce as pr


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--training-steps", type=int, default=pr.DiffusionConfig().training_steps)
    parser.add_argument("--goal", type=float, nargs=2, default=[1.05, 0.10], help="x y, in [m]")
    parser.add_argument("--rounds", type=int, default=10, help="throws at most")
    options = parser.parse_args()

    task = pr.make_task("basketball-v1")
    demos = task.demonstrations("A")
    diffusion = pr.make_generator(f"diffusion,training_steps={options.training_steps}")
    generator = diffusion.fit(demos, seed=0)
    session = pr.Session(
        generator, pr.BayesianAdapter(), demos, goal=options.goal, tolerance=task.tolerance
    )
    eye, rng = pr.Eye(), np.random.default_rng(0)
    while not session.solved and session.n_trials < options.rounds:
        trial = session.ask()
        rollout = task.rollout(trial.plan[None], rng)[0]
        seen = eye.perceive(rollout, session.goal, rng)
        hit = np.linalg.norm(rollout.outcome - session.goal) <= task.tolerance  # what anyone sees
        session.tell(trial.number, seen, hit=hit)
        long, left = 100 * seen.error_seen
        print(f"throw {trial.number}: seen {long:+.0f} cm long, {left:+.0f} cm left")
    outcome = "reached" if session.solved else "not reached"
    print(f"{outcome}, N = {demos.n} demonstrations + {session.n_trials} throws")
    return 0 if session.solved else 1


if __name__ == "__main__":
    raise SystemExit(main())
