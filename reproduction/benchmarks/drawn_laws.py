"""P(hit) of `BayesianAdapter` from one demonstration, where distances follow drawn laws.

    python reproduction/benchmarks/drawn_laws.py [--afternoons 120]

No physics: an outcome is where the symmetry moves the demonstration's to, in its chart, but for a
law of distance of a drawn exponent and curvature, offsets that stay, and executions that vary by an
eighth of the tolerance. Three kinds of worlds: an arm as it was demonstrated with, whose law is
almost as stated; the same with any law; and another day. Demonstrations are those of set A of
Basketball Shot. Three goals an afternoon, at 0.7 to 1.4 times the demonstrated distance and up to
23 degrees beside it, seen by eye. Printed for each kind: trials of each goal, and P(hit) said, hit,
and how many, for first trials of the first, the second and the third goal.
"""

from __future__ import annotations

import argparse
import itertools
from collections import defaultdict

import numpy as np

import prior_reinforce as pr
from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.plans.motions import Demonstrations

TOLERANCE = np.full(2, 0.05)
GOALS, TRIALS = 3, 10
BINS = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.01)
SPREADS = {
    "a law nearly as stated": ((0.85, 1.15), 0.05, (0.01, 0.01)),
    "any law": ((0.6, 1.5), 0.1, (0.0, 0.0)),
    "any law on another day": ((0.7, 1.4), 0.1, (0.05, 0.03)),
}
"""Range of the true exponent by the stated one, and sds of curvature and of the offsets."""


class World:
    """A law of distance, and where it lets plans come down."""

    def __init__(self, kind: str, shown: Demonstrations, rng: np.random.Generator) -> None:
        """Draw one."""
        assert shown.symmetry is not None
        (low, high), curvature, offsets = SPREADS[kind]
        self.chart, self.rng = shown.symmetry.chart, rng
        self.z = self.chart.to(shown.outcomes_seen)[0]
        self.gain, self.curvature = rng.uniform(low, high), rng.normal(0.0, curvature)
        self.offset = rng.normal(0.0, offsets)

    def goal(self) -> Point:
        """Return one that is not far from the demonstration."""
        return self.chart.back(self.z + self.rng.uniform([-0.35, -0.4], [0.35, 0.4]))

    def outcome(self, condition: Point) -> Point:
        """Return where the plan for a condition comes down."""
        w = self.chart.to(condition) - self.z
        moved = np.array([self.gain * w[0] + self.curvature * w[0] ** 2, w[1]])
        at = self.chart.back(self.z + moved + self.offset)
        return np.asarray(at + self.rng.normal(0.0, TOLERANCE / 8))


def afternoon(world: World, shown: Demonstrations) -> list[list[tuple[float, bool]]]:
    """P(hit) said and hits of the trials of each goal."""
    adapter, eye = pr.BayesianAdapter(), pr.Eye()
    adapter.start(shown)
    said: list[list[tuple[float, bool]]] = []
    for goal in (world.goal() for _ in range(GOALS)):
        said.append([])
        for _ in range(TRIALS):
            condition = adapter.propose(goal)
            expected = adapter.expect(condition, goal, TOLERANCE)
            assert expected.p_hit is not None
            outcome = world.outcome(condition)
            hit = bool(np.linalg.norm((outcome - goal) / TOLERANCE) <= 1.0)
            said[-1].append((expected.p_hit, hit))
            reading = eye.perceive(Rollout(outcome, True), goal, world.rng).with_hit(hit)
            adapter.observe(condition, goal, reading.within(TOLERANCE))
            if hit:
                break
    return said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--afternoons", type=int, default=120)
    afternoons = parser.parse_args().afternoons
    all_shown = pr.make_task("basketball-v1").demonstrations("A")
    for kind in SPREADS:
        trials, first = [], defaultdict(list)
        for seed in range(afternoons):
            rng = np.random.default_rng([0, seed])
            shown = all_shown.only([int(rng.integers(all_shown.n))])
            day = afternoon(World(kind, shown, rng), shown)
            trials.append([len(goal) for goal in day])
            for number, goal in enumerate(day, start=1):
                first[number].append(goal[0])
        print(f"{kind}: trials of goals {np.mean(trials, axis=0).round(2)}")
        for number, rows in first.items():
            said = np.array(rows)
            print(f"  goal {number}, first trial: {said.mean(axis=0).round(2)}", end="")
            for low, high in itertools.pairwise(BINS):
                of = said[(said[:, 0] >= low) & (said[:, 0] < high)]
                if len(of):
                    print(f"; {of[:, 0].mean():.2f} {of[:, 1].mean():.2f} ({len(of)})", end="")
            print()


if __name__ == "__main__":
    main()
