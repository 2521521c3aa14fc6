"""Few-trial adaptation beside its rivals, on measured displacement fields: thousands of goals.

    python benchmarks/adaptation_fields.py FOLDER [--tuning] [--conditions NAME ...]
        [--adapters LABEL ...] [--picture FILE.png]

A field is measured once in physics for each task and set of demonstrations (20 s each; aligned
interpolation, outcomes seen by eye), and kept in FOLDER, as the results are, so that a run goes on
where it ended. Sets are A, B and draws from both. Then every adapter works through the same
sequences of goals in each condition, on their own or with the trials of earlier goals. Printed are
trials a goal (goals 2 to 8 of a sequence; at most ten trials, a goal that is not reached counts
11), with 95 % intervals over sets and goals, and what the Bayesian adapter said of P(hit).

`--tuning`: labels of seed 10, goals and draws of seed 3001, on which settings are chosen. Without
it: labels of seeds 0 to 2, goals and draws of the reported seed.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from prior_reinforce.adapters import make_adapter
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.experiments.evaluation import GOAL_SEED
from prior_reinforce.experiments.fields import Change, Conditions, Field, FieldTask, measure
from prior_reinforce.experiments.protocol import perceive_demonstrations, run_sequences
from prior_reinforce.experiments.recipes.adaptation import TASKS
from prior_reinforce.experiments.statistics import Interval, bootstrap_mean, trials_counted
from prior_reinforce.generators import make_generator
from prior_reinforce.perception import make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.eye import Eye
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading
from prior_reinforce.report.style import (
    GOAL,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    save_png,
)
from prior_reinforce.rollouts import Rollout
from prior_reinforce.tasks import make_task
from prior_reinforce.tasks.base import Task

GENERATOR = "interpolation,timing=align"
TUNING_SEED = 3001
ROUNDS = 10
OURS = "Bayesian, earlier goals too"
RIVALS = "prior_reinforce.experiments.rivals"
ADAPTERS = {
    OURS: ("bayes", True),
    "Bayesian, each goal alone": ("bayes", False),
    "GP, m = 2, earlier goals too": ("gp", True),
    "GP, no forgetting, earlier goals too": ("gp-all", True),
    "GP, m = 2, each goal alone": ("gp", False),
    "GP of the paper, each goal alone": ("gp-one-term", False),
    "proportional, 0.8": ("proportional", False),
    "proportional, 0.7": ("proportional,gain=0.7", False),
    "mean offset": ("offset", False),
    "Broyden": ("broyden", False),
    "Newton on an interpolator": (f"{RIVALS}:NewtonAdapter", False),
    "norm-optimal learning control": (f"{RIVALS}:NormOptimalAdapter", False),
    "CMA-ES": (f"{RIVALS}:CmaEsAdapter", False),
    "Bayesian optimisation": (f"{RIVALS}:BayesianOptimisationAdapter", False),
}
"""By label: choice, and whether the trials of earlier goals serve it."""
_DRAWS = 50
"""Of demonstrations, until no two of them look the same."""
SEARCHES = ("CMA-ES", "Bayesian optimisation")
"""Far behind, and slow: tried where nothing is changed, and on changed hardware, alone."""


class HumanEye(Eye):
    """An observer who errs before rounding: 20 % in size, 5 degrees in direction."""

    def perceive(self, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        error = rollout.outcome - goal
        angle = np.deg2rad(5.0) * rng.normal()
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        wrong = (1.0 + 0.2 * rng.normal()) * turn @ error
        return super().perceive(replace(rollout, outcome=goal + wrong), goal, rng)


class Misreading(Eye):
    """An observer who takes long for short, or left for right, once in twenty trials."""

    def perceive(self, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        error = rollout.outcome - goal
        swap = np.where(np.arange(error.size) == rng.integers(error.size), -1.0, 1.0)
        wrong = np.where(rng.uniform() < 0.05, swap * error, error)
        return super().perceive(replace(rollout, outcome=goal + wrong), goal, rng)


@dataclass(frozen=True)
class Source:
    """What a field is measured of."""

    task: str
    demonstrations: str
    """A, B, or another letter: a draw from both."""
    labels: int
    """Seed of how their outcomes are seen."""
    count: int = 0
    """How many of a draw; 0 for as many as A has."""
    seen: str = "eye"
    """By eye, exact, or by an observer who errs (human)."""

    def field(self, folder: Path, tuning: bool) -> Field:
        """Measured now, or before."""
        name = f"{self.task}-{self.demonstrations}{self.count or ''}-{self.labels}-{self.seen}"
        path = folder / f"{name}.npz"
        if not path.exists():
            prior = self._seen(make_task(TASKS[self.task]), tuning)
            seed = GOAL_SEED + self.labels
            generator = make_generator(GENERATOR).fit(prior, seed=self.labels)
            measure(make_task(self.task), generator, prior, name, seed=seed).save(path)
            print(f"measured {name}", flush=True)
        return Field.load(path)

    def _seen(self, task: Task, tuning: bool) -> Demonstrations:
        """The demonstrations with their outcomes as they were seen.

        In a draw of which two look the same, another is taken, and the eye's words begin elsewhere.
        """
        for attempt in range(_DRAWS):
            seed = GOAL_SEED + self.labels + 1000 * attempt
            perception: Perception = (
                HumanEye() if self.seen == "human" else make_perception(self.seen, seed=seed)
            )
            prior = self._prior(task, tuning, attempt)
            try:
                return perceive_demonstrations(task, prior, perception, seed=seed)
            except InvalidDemonstrationsError:
                if not self.count or attempt == _DRAWS - 1:
                    raise
        raise AssertionError("range is empty")

    def _prior(self, task: Task, tuning: bool, attempt: int) -> Demonstrations:
        """The demonstrations as they were recorded."""
        if self.demonstrations in task.demonstration_sets:
            return task.demonstrations(self.demonstrations)
        both = [task.demonstrations(name) for name in task.demonstration_sets]
        pool = replace(
            both[0],
            plans=np.concatenate([d.plans for d in both]),
            outcomes_seen=np.concatenate([d.outcomes_seen for d in both]),
            outcome_noise=np.concatenate([d.outcome_noise for d in both]),
        )
        seed = TUNING_SEED if tuning else GOAL_SEED
        rng = np.random.default_rng([seed, ord(self.demonstrations), *[attempt] * (attempt > 0)])
        return pool.only(tuple(sorted(rng.permutation(pool.n)[: self.count or both[0].n])))


Rows = list[list[Source]]
"""A row a task, a column a set of demonstrations."""
Results = Sequence[Sequence[Mapping[str, Any]]]
"""Of one adapter, in the same rows."""


def own_sets(tuning: bool) -> Rows:
    """A, B, and draws; two outcomes of fishing's second draw look the same: it is left out."""
    sets = (("A", 10), ("B", 10), ("C", 10)) if tuning else (("A", 0), ("B", 1), ("C", 2), ("D", 0))
    return [
        [Source(task, name, labels) for name, labels in sets if (task, name) != ("fishing", "D")]
        for task in TASKS
    ]


def drawn(count: int) -> Callable[[bool], Rows]:
    """Of basketball: three of curling lose stones where they have to extrapolate.

    At most ten: of all twelve, two always look the same by eye.
    """
    return lambda tuning: [
        [Source("basketball-v1", name, 10 if tuning else 0, count) for name in "FGHIJKLMNO"]
    ]


def labelled(seen: str) -> Callable[[bool], Rows]:
    return lambda tuning: [
        [Source(task, name, 10 if tuning else 0, 0, seen) for name in "ABCD"]
        for task in ("basketball-v1", "basketball-v2")
    ]


@dataclass(frozen=True)
class Condition:
    """What is tried."""

    rows: Callable[[bool], Rows] = own_sets
    change: Change = field(default_factory=Change)
    perception: Callable[[], Perception] = Eye
    sequences: int = 1
    """Of goals, on each field."""
    goals: int = 8
    """In each."""
    searches: bool = False
    """Whether `SEARCHES` are tried too, on sets A and B."""


CONDITIONS = {
    "by eye": Condition(searches=True),
    "twenty goals": Condition(goals=20),
    "an eye that errs": Condition(perception=HumanEye),
    "amplified noise": Condition(perception=lambda: make_perception("amplified")),
    "exact": Condition(perception=lambda: make_perception("exact")),
    "5 % of trials lost": Condition(change=Change(lost=0.05)),
    "5 % of trials misread": Condition(perception=Misreading),
    "shifted by 6 cm": Condition(change=Change(shift=(-0.057, 0.019))),
    "stretched by 1.15": Condition(change=Change(stretch=1.15)),
    "shifted and stretched": Condition(
        change=Change(shift=(-0.057, 0.019), stretch=1.08), searches=True
    ),
    "labels exact": Condition(labelled("exact")),
    "labels by an eye that errs": Condition(labelled("human")),
    "3 demonstrations": Condition(drawn(3)),
    "4 demonstrations": Condition(drawn(4)),
    "8 demonstrations": Condition(drawn(8)),
    "10 demonstrations": Condition(drawn(10)),
}


def labels_of(condition: Condition, chosen: Sequence[str]) -> Iterator[str]:
    for label in chosen or ADAPTERS:
        if label not in SEARCHES or condition.searches:
            yield label


def tried(
    source: Source, condition: Condition, choice: str, carry: bool, folder: Path, tuning: bool
) -> Mapping[str, object]:
    """One adapter on one field."""
    measured = source.field(folder, tuning)
    task = FieldTask(measured, condition.change)
    seed = TUNING_SEED if tuning else GOAL_SEED
    goals = task.sample_goals(
        condition.sequences * condition.goals, np.random.default_rng(seed)
    ).reshape(condition.sequences, condition.goals, -1)
    if "Optimisation" in choice:  # 0.2 s a proposal
        goals = goals[:1, :4]
    results = run_sequences(
        task,
        Conditions().fit(task.demonstrations("own"), seed=0),
        lambda: make_adapter(choice),
        condition.perception(),
        task.demonstrations("own"),
        goals,
        carry_over=carry,
        rounds=ROUNDS,
        seed=seed + source.labels,
    )
    return {
        "solved_at": [[goal.solved_at or 0 for goal in of_one] for of_one in results],
        "expected": [
            [
                [t.p_hit, t.expected_trials, t.hit, len(goal.trials) - place]
                for place, t in enumerate(goal.trials)
                if t.p_hit is not None
            ]
            for of_one in results
            for goal in of_one
            if goal.solved_at
        ],
    }


def run(name: str, labels: Sequence[str], folder: Path, tuning: bool) -> dict[str, Results]:
    """Results of one condition by label: a row a task, a column a set; kept in the folder."""
    condition = CONDITIONS[name]
    path = folder / f"{name.replace(' ', '-').replace('%', 'percent')}.json"
    kept = json.loads(path.read_text()) if path.exists() else {}
    rows = condition.rows(tuning)
    for label in labels:
        choice, carry = ADAPTERS[label]
        if label not in kept:
            kept[label] = [
                [
                    tried(source, condition, choice, carry, folder, tuning)
                    for source in (row[:2] if label in SEARCHES else row)
                ]
                for row in rows
            ]
            path.write_text(json.dumps(kept))
    return {label: kept[label] for label in labels}


def trials_of(results: Results) -> list[np.ndarray]:
    """Trials on goals 2 to the last, an array of shape (sets, goals) for each task."""
    return [
        np.array([trials_counted(np.array(of["solved_at"])[:, 1:], ROUNDS).ravel() for of in row])
        for row in results
    ]


def interval(rows: Sequence[np.ndarray]) -> Interval:
    """Of the mean of all tasks: sets and goals are drawn anew within each, tasks are not.

    Bootstraps over few sets are too narrow: deviations are widened as for a variance of so few, and
    to Student's tails for all sets together.
    """
    rng, deviation = np.random.default_rng(0), np.zeros(2000)
    for row in rows:
        m, n = row.shape
        sets, goals = rng.integers(m, size=(2000, m, 1)), rng.integers(n, size=(2000, 1, n))
        drawn = row[sets, goals].mean(axis=(1, 2)) - row.mean()
        deviation += np.sqrt(m / max(m - 1, 1)) * drawn / len(rows)
    freedom = max(sum(len(row) - 1 for row in rows), 1)
    tails = stats.t.ppf(0.975, freedom) / stats.norm.ppf(0.975)
    low, high = tails * np.quantile(deviation, [0.025, 0.975])
    value = float(np.mean([row.mean() for row in rows]))
    return Interval(value, value + float(low), value + float(high))


def compare(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> Interval:
    """Ours minus theirs, pair by pair, on the sequences that both were tried on."""
    goals = min(ours[0].shape[1], theirs[0].shape[1])
    return interval([a[: len(b), :goals] - b[:, :goals] for a, b in zip(ours, theirs, strict=True)])


def show(name: str, results: Mapping[str, Results]) -> None:
    """One table."""
    tasks = [row[0].task for row in CONDITIONS[name].rows(True)]
    goals = {label: trials_of(of) for label, of in results.items()}
    n = sum(row.size for row in next(iter(goals.values())))
    print(f"\n{name} ({n} goals each)\n| adapter | {' | '.join(tasks)} | mean | ours minus it |")
    print("|---" * (len(tasks) + 3) + "|")
    for label, trials in goals.items():
        each = " | ".join(f"{bootstrap_mean(row):.2f}" for row in trials)
        against = f"{compare(goals[OURS], trials):+.2f}" if label != OURS and OURS in goals else ""
        print(f"| {label} | {each} | {interval(trials):.2f} | {against} |")


def show_expectations(results: Results) -> None:
    """What was said of P(hit) and of trials to go, and what came of it."""
    said = np.array(
        [trial for row in results for of in row for goal in of["expected"] for trial in goal]
    )
    p, expected, hit, to_go = said.T
    base = hit.mean()
    print(
        f"{len(p)} trials; Brier {np.mean((p - hit) ** 2):.3f}, base rate's {base * (1 - base):.3f}"
    )
    print("| P(hit) said | hit | trials to go said | took | trials |\n|---|---|---|---|---|")
    edges = [0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0]
    for low, high in itertools.pairwise(edges):
        here = (p >= low) & (p < high if high < 1 else p <= 1)
        if here.any():
            print(f"| {p[here].mean():.2f} | {hit[here].mean():.2f} | {expected[here].mean():.2f} "
                  f"| {to_go[here].mean():.2f} | {here.sum()} |")  # fmt: skip


DRAWN = {
    OURS: (GOAL, "o"),
    "Bayesian, each goal alone": (GOAL, "D"),
    "GP, no forgetting, earlier goals too": ("#56b4e9", "v"),
    "GP, m = 2, each goal alone": ("#16406f", "s"),
    "proportional, 0.8": (INK_SOFT, "^"),
}
"""Colour and mark of the adapters in the picture."""


def draw(results: Mapping[str, Mapping[str, Results]], path: Path) -> None:
    """Trials a goal by condition, a row each, with intervals."""
    with drawing():
        figure = new_figure(7.5, 0.55 * len(results) + 1.1)
        axes = figure.subplots()
        calm_axes(axes)
        axes.grid(visible=False, axis="y")
        for row, of_label in enumerate(results.values()):
            for place, (label, (colour, mark)) in enumerate(DRAWN.items()):
                if label not in of_label:
                    continue
                y, mean = row + 0.17 * (place - 2), interval(trials_of(of_label[label]))
                axes.plot([mean.low, mean.high], [y, y], color=colour, linewidth=1.5)
                fill = colour if label != "Bayesian, each goal alone" else "white"
                axes.plot(
                    mean.value, y, mark, color=colour, markerfacecolor=fill, markersize=6,
                    label=label if row == 0 else None,
                )  # fmt: skip
        axes.set_yticks(range(len(results)), list(results))
        axes.invert_yaxis()
        axes.set_xlabel("trials a goal, with 95 % intervals over sets of demonstrations and goals")
        figure.legend(
            loc="outside upper center", ncols=2, frameon=False, fontsize=9, labelcolor=INK_SOFT
        )
    save_png(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--conditions", nargs="*", default=list(CONDITIONS), choices=CONDITIONS)
    parser.add_argument("--adapters", nargs="*", default=[])
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    everything = {}
    for name in arguments.conditions:
        labels = list(labels_of(CONDITIONS[name], arguments.adapters))
        results = run(name, labels, arguments.folder, arguments.tuning)
        show(name, results)
        everything[name] = results
        for label in (OURS, "Bayesian, each goal alone"):
            if label in results:
                print(f"\n{label}:", end=" ")
                show_expectations(results[label])
    if arguments.picture:
        draw(everything, arguments.picture)


if __name__ == "__main__":
    main()
