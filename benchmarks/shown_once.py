"""Trials that a goal takes from few demonstrations that carry a symmetry, seen by eye.

    python benchmarks/shown_once.py TASK [--demonstrations 1] [--goals 4] [--seed 0] [--afternoon]
        [--bump 0.2] [--sets A B] [--most 6]

Each demonstration of a set alone (or each of `--most` drawn groups of them) is learned with `auto`;
`BayesianAdapter` adapts, with labels that are exact and words by eye. Single goals each begin with
nothing known; `--afternoon` is one sequence of goals a demonstration, nothing forgotten. `--bump`
shifts all outcomes of an afternoon by so many metres in x, unannounced, after two goals. Not
reached in ten trials counts eleven. Printed: mean N (demonstrations and trials), share within four
trials, P(hit) said and hit by bins, remarks of the adapter (false alarms, where nothing is wrong),
and the processor time of a reading with its proposal.
"""

from __future__ import annotations

import argparse
import itertools
import time
from dataclasses import replace

import numpy as np

import prior_reinforce as pr
from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading

TRIALS = 10
EYE = pr.Eye()


class Afternoon:
    """One adapter behind one generator, and what was measured of it."""

    def __init__(self, task: Task, demonstrations: Demonstrations, seed: list[int]) -> None:
        """Learn, and start adapting."""
        self.task = task
        self.generator = pr.make_generator("auto").fit(demonstrations, seed=0)
        self.demonstrations = demonstrations
        self.adapter = pr.BayesianAdapter()
        self.adapter.start(demonstrations)
        self.rng = np.random.default_rng(seed)
        self.said: list[tuple[float, bool]] = []
        self.milliseconds: list[float] = []
        self.remarks: list[str] = []

    def goal(self, goal: Point, shift: Point | float = 0.0) -> int:
        """Trials until it is hit."""
        tolerance = np.full(len(goal), self.task.tolerance)
        for trial in range(1, TRIALS + 1):
            start = time.process_time()
            condition = self.adapter.propose(goal)
            taken = time.process_time() - start
            expected = self.adapter.expect(condition, goal, tolerance)
            assert expected.p_hit is not None
            self.remarks.append(expected.remark)
            try:
                plan = self.generator.generate(condition[None])
                rollout = self.task.rollout(plan, self.rng)[0]
            except OutOfReachError:
                rollout = Rollout(goal, False)
            if not rollout.valid:
                self.said.append((expected.p_hit, False))
                lost = Reading.only(False, len(goal), lost=True)
                self.adapter.observe(condition, goal, lost.within(tolerance))
                continue
            rollout = replace(rollout, outcome=rollout.outcome + shift)
            hit = bool(np.linalg.norm(rollout.outcome - goal) <= self.task.tolerance)
            self.said.append((expected.p_hit, hit))
            reading = EYE.perceive(rollout, goal, self.rng).with_hit(hit).within(tolerance)
            start = time.process_time()
            self.adapter.observe(condition, goal, reading)
            self.milliseconds.append(1e3 * (taken + time.process_time() - start))
            if hit:
                return trial
        return TRIALS + 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--demonstrations", type=int, default=1)
    parser.add_argument("--goals", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--afternoon", action="store_true")
    parser.add_argument("--bump", type=float, default=0.0)
    parser.add_argument("--sets", nargs="+", default=["A", "B"])
    parser.add_argument("--most", type=int, default=6)
    given = parser.parse_args()
    task = pr.make_task(given.task)
    name = "basketball-v1" if given.task.startswith("basketball") else given.task
    trials, afternoons = [], []
    for which in given.sets:
        demonstrations = pr.make_task(name).demonstrations(which)
        groups = list(itertools.combinations(range(demonstrations.n), given.demonstrations))
        order = np.random.default_rng([given.seed, ord(which[0])]).permutation(len(groups))
        for group in (groups[i] for i in order[: given.most]):
            goals = task.sample_goals(given.goals, np.random.default_rng([given.seed, *group]))
            seed = [given.seed, ord(which[0]), *group]
            if given.afternoon:
                day = Afternoon(task, demonstrations.only(group), seed)
                bump = np.eye(len(task.outcome_format.names))[0] * given.bump
                trials.append([day.goal(goal, bump * (i >= 2)) for i, goal in enumerate(goals)])
                afternoons.append(day)
                continue
            for i, goal in enumerate(goals):
                day = Afternoon(task, demonstrations.only(group), [*seed, i])
                trials.append([day.goal(goal)])
                afternoons.append(day)
    counts, n = np.array(trials), given.demonstrations
    print(f"{given.task}, N = {n}, {len(counts)} {'afternoons' if given.afternoon else 'goals'}")
    error = counts.mean(axis=1).std() / np.sqrt(len(counts))
    print(
        f"  trials {counts.mean():.2f} +- {error:.2f}, N {n + counts.mean():.2f}, first throws "
        f"{np.mean(counts == 1):.2f}, within four {np.mean(counts <= 4):.3f}, not reached "
        f"{np.mean(counts > TRIALS):.3f}"
    )
    if given.afternoon:
        total = n + counts.sum(axis=1).mean()
        print(f"  executions in all {total:.2f}; trials of goals {counts.mean(axis=0).round(2)}")
    said = np.array([each for day in afternoons for each in day.said])
    print(f"  P(hit): Brier {np.mean((said[:, 0] - said[:, 1]) ** 2):.3f}", end="")
    for low, high in itertools.pairwise([0.0, 0.1, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.01]):
        of = said[(said[:, 0] >= low) & (said[:, 0] < high)]
        if len(of):
            print(f"; {of[:, 0].mean():.2f} {of[:, 1].mean():.2f} ({len(of)})", end="")
    remarks = [remark for day in afternoons for remark in day.remarks if remark]
    print(f"\n  remarks {len(remarks)} of {len(said)}: {sorted(set(remarks))}")
    times = [ms for day in afternoons for ms in day.milliseconds]
    late = [ms for day in afternoons for ms in day.milliseconds[10:]]
    print(
        f"  one reading and proposal: median {np.median(times):.1f} ms, of the eleventh and later "
        f"{np.median(late) if late else np.nan:.1f}, most {max(times):.1f}"
    )


if __name__ == "__main__":
    main()
