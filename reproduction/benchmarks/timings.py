"""Can trials choose between timings that leave-one-out evidence leaves open? Trials a goal.

    python reproduction/benchmarks/timings.py [--tasks developed|reported|NAME ...] \
        [--sets KIND-COUNT-N ...]
        [--pack DIRECTORY] [--open 1.5] [--taken none] [--least 0.7]
        [--goals 8] [--afternoons 1] [--seed 9200]

A set is open where another timing that `choose_timing` allows misses left-out outcomes by at most
`--open` times as much as the one that `auto` takes. A row an open set: trials a goal in afternoons
of `--goals` goals (the Bayesian adapter, nothing forgotten; at most 8, else 9) of

    auto      the timing that the evidence takes
    NAME      another one alone
    promise   one generator and adapter a timing; each throw is of the one that promises most,
              P(hit) times the ratio of the errors where that is below 1
    turns     the same, but the first goals go to each timing in turn

Then differences to `auto` with 95 % intervals over sets, on all open ones and on all (a closed set
has none). `known` is the timing that takes fewest trials at every second goal, judged at the
others: what somebody would gain who knew the better one beforehand. `--pack` adds tasks in the
folder of a harness for foreign tasks (`tasks.py`, `harness.py`, `ours.py`), success seen, errors
noisy; on the zoo readings are exact. `--taken` keeps to sets for which `auto` takes that timing,
`--least` to those where it misses by so much at least: from 0.7 on it tells little more than the
mean outcome, which misses by 1. `--goals 1 --afternoons 30` are thirty goals, each alone.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from scipy.stats import t as student

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.formats import in_tolerances
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.patterns import patterns
from prior_reinforce.generators.timing.evidence import _CLOCK_SPREAD, choose_timing
from prior_reinforce.generators.timing.timeline import decompose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import DEVELOPED_ON, REPORTED

SETS = ("mixed-8-0", "tempo-6-0", "warped-8-0", "cut-6-0", "scattered-6-0", "mixed-8-1",
        "tempo-6-1", "scattered-6-1")  # fmt: skip
ROUNDS = 8
Rows = dict[str, list[int]]


@dataclass
class World:
    """Demonstrations, and what throws them."""

    name: str
    demonstrations: Demonstrations
    tolerance: np.ndarray
    goals: Callable[[int, int], np.ndarray]
    """Number and seed to goals."""
    throw: Callable[[np.ndarray, np.random.Generator], tuple[np.ndarray, bool]]
    """Plan and noise to outcome, and whether it is valid."""
    read: Callable[[np.ndarray, np.random.Generator], Reading]
    """True error and noise to reading."""


def of_the_zoo(name: str, key: str) -> World:
    """A set of a simulated task, read exactly."""
    task = make_task(name)
    prior = task.demonstrations(key).without_symmetry()

    def throw(plan: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, bool]:
        rollout = task.rollout(plan[None], rng)[0]
        return rollout.outcome, rollout.valid

    tolerance = prior.outcome_format.within(task.tolerance).half_axes
    return World(
        f"{name} {key}",
        prior,
        np.broadcast_to(tolerance, prior.outcome_dim),
        lambda n, seed: task.sample_goals(n, np.random.default_rng(seed)),
        throw,
        lambda error, _: Reading.measured(error),
    )


def of_a_pack(tasks: Any, perceive: Any, units: Any, name: str) -> Iterator[World]:
    """The three groups of a foreign task: success is seen, errors are noisy."""
    task = tasks.make(name)
    for group in range(3):
        plans, outcomes = task.demonstrations(group)
        named = tuple(f"a{i}" for i in range(plans.shape[2]))
        known = units.get((plans.shape[2], outcomes.shape[1], task.dt), ("rad",) * len(named))
        prior = Demonstrations(
            plans=plans,
            outcomes_seen=outcomes,
            format=PlanFormat(names=named, units=known, dt=task.dt),
        )
        tolerance = np.full(prior.outcome_dim, float(task.tolerance))

        def throw(plan: np.ndarray, _: np.random.Generator) -> tuple[np.ndarray, bool]:
            return task.rollout(plan), True

        def read(error: np.ndarray, rng: np.random.Generator) -> Reading:
            seen = perceive(error, task.tolerance, "seen", rng)
            return Reading.estimated(seen, np.full(len(seen), float(task.tolerance) / 3))

        yield World(f"{name} {group}", prior, tolerance, task.goals, throw, read)


def candidates(world: World, most: float) -> dict[str, float]:
    """Timings that are open, the one that `auto` takes first, and the error of each."""
    prior = world.demonstrations
    choice = choose_timing(prior)
    taken, errors = choice.decomposition.timeline.kind, choice.errors
    if not errors or len(patterns(prior)) > 1:
        return {}
    usual = decompose(prior, "start")
    length = float(np.median(np.ptp(prior.signals.spans, axis=1)))
    clocked = np.std(usual.numbers[:, 0]) <= _CLOCK_SPREAD * length and not usual.by_step
    others = [k for k in errors if k != taken and (k != "none" or clocked)]
    kept = [k for k in others if errors[k] <= most * errors[taken]]
    return {k: errors[k] for k in (taken, *kept)}


def afternoon(
    world: World, generators: dict[str, Any], weights: dict[str, float], seed: list[int],
    goals: np.ndarray, turns: bool,
) -> list[int]:  # fmt: skip
    """Trials of each goal, by whichever timing promises most."""
    adapters = {k: BayesianAdapter() for k in generators}
    for adapter in adapters.values():
        adapter.start(world.demonstrations)
    took, names = [], list(generators)
    for i, goal in enumerate(goals):
        noise, eye = (np.random.default_rng([*seed, i, stream]) for stream in (1, 2))
        asked = names[i : i + 1] if turns and i < len(names) else names
        for used in range(1, ROUNDS + 2):
            best, most = ("", goal), -1.0
            for k in asked:
                condition, p_hit = adapters[k].propose(goal), 1.0
                if len(asked) > 1:
                    p_hit = adapters[k].p_hit(condition[None], goal[None], world.tolerance)[0]
                if weights[k] * p_hit > most:
                    best, most = (k, condition), weights[k] * p_hit
            if used > ROUNDS:
                break
            k, condition = best
            outcome, valid = world.throw(generators[k].generate(condition[None])[0], noise)
            error = outcome - goal
            hit = bool(valid and in_tolerances(error, world.tolerance) <= 1.0)
            reading = world.read(error, eye).with_hit(hit).within(world.tolerance)
            adapters[k].observe(condition, goal, reading)
            if hit:
                break
        took.append(used)
    return took


def compared(world: World, errors: dict[str, float], args: argparse.Namespace) -> Rows:
    """Trials of each goal, of each way to choose."""
    generators = {
        k: make_generator(f"interpolation,timing={k}").fit(world.demonstrations, seed=0)
        for k in errors
    }
    taken = next(iter(errors))
    weights = {k: min(1.0, errors[taken] / max(e, 1e-9)) for k, e in errors.items()}
    ways = {("auto" if k == taken else k): ({k: g}, False) for k, g in generators.items()}
    ways |= {"promise": (generators, False), "turns": (generators, True)}
    rows: Rows = {way: [] for way in ways}
    for day in range(args.afternoons):
        goals = world.goals(args.goals, args.seed + day)
        for way, (kept, turns) in ways.items():
            rows[way] += afternoon(world, kept, weights, [args.seed, day], goals, turns)
    return rows


def known(rows: Rows) -> float:
    """Trials less those of `auto`, of the timing that is better at every second goal."""
    alone = np.array([took for way, took in rows.items() if way not in ("promise", "turns")])
    parts = [alone[:, ::2], alone[:, 1::2]]
    chosen = [parts[1 - i][np.argmin(parts[i].mean(axis=1))] - parts[1 - i][0] for i in (0, 1)]
    return float(np.concatenate(chosen).mean())


def interval(values: np.ndarray) -> str:
    """Mean with its 95 % interval over sets."""
    if len(values) < 2:
        return ""
    half = student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return f"{values.mean():+.2f} ± {half:.2f}"


def main() -> None:
    """Print a row a set, and differences."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tasks", nargs="*", default=["developed"])
    parser.add_argument("--sets", nargs="+", default=SETS)
    parser.add_argument("--pack")
    parser.add_argument("--open", type=float, default=1.5)
    parser.add_argument("--taken", choices=("none", "start", "tempo"))
    parser.add_argument("--least", type=float, default=0.0)
    parser.add_argument("--goals", type=int, default=8)
    parser.add_argument("--afternoons", type=int, default=1)
    parser.add_argument("--seed", type=int, default=9200)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    named = {"developed": DEVELOPED_ON, "reported": REPORTED}
    names = [n for given in args.tasks for n in named.get(given, (given,))]
    pack: tuple[Any, Any, Any] | None = None
    if args.pack:
        sys.path.insert(0, args.pack)
        tasks, harness, ours = map(import_module, ("tasks", "harness", "ours"))
        pack = (tasks, harness.perceive, ours.UNITS)
    worlds = (
        world
        for name in names
        for world in (
            (of_the_zoo(name, key) for key in args.sets)
            if pack is None or name.startswith("zoo-")
            else of_a_pack(*pack, name)
        )
    )
    found: list[dict[str, float]] = []
    closed = 0
    for world in worlds:
        errors = candidates(world, args.open)
        taken, error = next(iter(errors.items()), ("", np.inf))
        if args.taken not in (None, taken) or error < args.least:
            continue
        if len(errors) < 2:
            closed += 1
            print(f"{world.name}: closed", flush=True)
            continue
        rows = compared(world, errors, args)
        base = float(np.mean(rows["auto"]))
        found.append(
            {way: float(np.mean(rows[way])) - base for way in ("promise", "turns")}
            | {"known": known(rows)}
        )
        told = ", ".join(f"{k} {e:.2f}" for k, e in errors.items())
        means = ", ".join(f"{way} {np.mean(took):.2f}" for way, took in rows.items())
        gain = f"known {found[-1]['known']:+.2f}"
        print(f"{world.name}: errors {told}; trials {means}; {gain}", flush=True)
    for way in ("known", "promise", "turns"):
        off = np.array([row[way] for row in found])
        everywhere = np.concatenate([off, np.zeros(closed)])
        print(f"{way} less auto: open ({len(off)}) {interval(off)}; "
              f"all ({len(everywhere)}) {interval(everywhere)}")  # fmt: skip


if __name__ == "__main__":
    main()
