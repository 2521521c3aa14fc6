"""What generated plans owe to each threshold whose value nothing fixes: halve it, and double it.

    python benchmarks/threshold_sensitivity.py [--sets 1] [--goals 20] [--seed 0]
        [--kinds KIND-COUNT ...] [--only NAME ...]

`auto` is fitted to sets of the zoo's development tasks with one threshold changed at a time. A row
a threshold: for its half and for its double, how many sets generate other plans than with its value
(by more than 1e-9 of a channel's range), and the share of first throws that hit, less that with
its value. Integers are halved upwards. Closed form only: no network is trained.
"""

from __future__ import annotations

import argparse
import importlib
import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prior_reinforce.generators import make_generator
from prior_reinforce.lab.experiments.protocol import is_hit
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.lab.tasks.zoo import DEVELOPED_ON
from prior_reinforce.plans.timeline import decompose

THRESHOLDS = (
    "plans.registration.CONVERGED",
    "plans.registration._NEWTON_STEPS",
    "plans.registration._SEARCHED",
    "plans.registration._COMPARED",
    "plans.registration._FINE",
    "plans.registration._TEMPO_SCALE",
    "plans.registration._EVALUATIONS",
    "plans.signals.MAX_LEVELS",
    "plans.signals._ACTIVE",
    "plans.signals._ACTIVE_NOISE",
    "plans.signals._STEP_SHARE",
    "plans.signals._FEWEST_FRAMES",
    "plans.signals._POSE_NOISE",
    "plans.signals._POSE_SHARE",
    "plans.extrapolation.END_SPEED",
    "plans.extrapolation._SLOPE_FRAMES",
    "plans.timeline._OVERSAMPLING",
    "plans.timeline._FEW_FRAMES",
    "generators.patterns._TOLD",
    "generators.timing_evidence._MAX_USEFUL_ERROR",
    "generators.timing_evidence._FEWEST",
    "generators.timing_evidence._BEST",
    "generators.timing_evidence._RIDGE",
    "generators.timing_evidence._EQUALLY_GOOD",
)
KINDS = ("mixed-8", "jitter-6")


@dataclass(frozen=True)
class Case:
    """A set of demonstrations, and goals."""

    task: Any
    demonstrations: Any
    goals: NDArray[np.float64]

    def plans(self, seed: int) -> NDArray[np.float64]:
        """For the goals, with the thresholds as they are now."""
        self.demonstrations.__dict__.pop("signals", None)
        return make_generator("auto").fit(self.demonstrations, seed=seed).generate(self.goals)

    def hits(self, plans: NDArray[np.float64], seed: int) -> float:
        """Share of the goals that these plans hit."""
        thrown = self.task.rollout(plans, np.random.default_rng(seed))
        hits = [is_hit(r, g, self.task.tolerance) for r, g in zip(thrown, self.goals, strict=True)]
        return float(np.mean(hits))

    def same(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        """Whether plans differ by no more than 1e-9 of a channel's range."""
        ranges = np.ptp(self.demonstrations.plans, axis=(0, 1))
        off = np.abs(one - other).max(axis=(0, 1))
        return bool(np.all(off <= 1e-9 * np.where(ranges > 0, ranges, 1.0)))


def changed(value: Any, factor: float) -> Any:
    """A threshold times a factor."""
    if isinstance(value, tuple):  # ways to sample: only the coarsest, or finer ones as well
        return value[:1] if factor < 1 else (*value, 2 * value[-1])
    return math.ceil(value * factor) if isinstance(value, int) else value * factor


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--only", nargs="+", default=THRESHOLDS)
    parser.add_argument("--sets", type=int, default=1)
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    cases = []
    for name in DEVELOPED_ON:
        task = make_task(name)
        for kind in arguments.kinds:
            for number in range(arguments.sets):
                goals = task.sample_goals(arguments.goals, np.random.default_rng([7, number]))
                cases.append(Case(task, task.demonstrations(f"{kind}-{number}"), goals))
    usual = [case.plans(arguments.seed) for case in cases]
    hits = [case.hits(plans, arguments.seed) for case, plans in zip(cases, usual, strict=True)]
    print(f"{len(cases)} sets; first throws that hit {np.mean(hits):.3f}\n")
    print("| threshold | value | half: other plans | first throws | double: other plans | |")
    print("|---|---|---|---|---|---|")
    for name in arguments.only:
        module_name, _, attribute = name.rpartition(".")
        module = importlib.import_module(f"prior_reinforce.{module_name}")
        value = getattr(module, attribute)
        cells = []
        for factor in (0.5, 2.0):
            setattr(module, attribute, changed(value, factor))
            decompose.cache_clear()
            differ, gain = 0, 0.0
            for case, known, hit in zip(cases, usual, hits, strict=True):
                plans = case.plans(arguments.seed)
                if not case.same(plans, known):
                    differ += 1
                    gain += case.hits(plans, arguments.seed) - hit
            setattr(module, attribute, value)
            cells += [str(differ), f"{gain / len(cases):+.3f}" if differ else ""]
        print(f"| `{name}` | {value} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
