"""Trials a goal in an afternoon of eight: what remembering earlier goals is worth (ours).

One closed-form generator behind all, learned from demonstrations seen by eye; trials by eye, in
contact physics. Goals 2 to 8 count: before the first there is nothing to remember.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from prior_reinforce.lab.experiments.evaluation import GOAL_SEED, Training
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.sequences import Afternoons
from prior_reinforce.lab.experiments.statistics import (
    bootstrap_difference,
    bootstrap_mean,
    trials_counted,
)

TASKS = {
    "basketball-v1": "basketball-v1",
    "curling": "curling",
    "fishing": "fishing",
    "basketball-v2": "basketball-v1",
    "basketball-v3": "basketball-v1",
}
"""Where it is tried, and whose demonstrations are learned from."""
RULES = (
    ("bayes", True, "Bayesian, earlier goals too"),
    ("bayes", False, "Bayesian, each goal alone"),
    ("gp", True, "GP, m = 2, earlier goals too"),
    ("gp-all", True, "GP, no forgetting, earlier goals too"),
    ("gp", False, "GP, m = 2, each goal alone"),
    ("offset", False, "mean offset, each goal alone"),
    ("proportional", False, "proportional, 0.8"),
    ("proportional,gain=0.6", False, "proportional, 0.6"),
    ("broyden", False, "Broyden, 0.8"),
    ("frozen", False, "no adapter"),
)
"""The adapters compared, whether earlier goals' trials serve them, and what each is called."""
_OURS, _OURS_ALONE = "Bayesian, earlier goals too", "Bayesian, each goal alone"
_GOALS = 8
_ALONE = "each goal alone, all rules"
_DASHES = ("--", ":", "-.")
"""Of the lines of rivals that remember, all in one grey."""
_BINS = (0.0, 0.1, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)
"""Of the reliability table."""


@dataclass(frozen=True)
class Adaptation(Measurement):
    """Trials a goal of every rule on every task."""

    generator: str = "interpolation,timing=align"
    """Behind every adapter."""
    perception: str = "eye"
    """Through which demonstrations and trials are seen."""
    tasks: tuple[str, ...] = tuple(TASKS)
    """Where it is tried."""
    seed: int = GOAL_SEED
    """Of the goals."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """One for each task with demonstrations, prior set and seed of its labels."""
        learned_on = dict.fromkeys(TASKS[task] for task in self.tasks)
        return [training for name in learned_on for training in self._trainings(name, scale)]

    def run(self, run: Run) -> dict[str, Any]:
        """Work through the same afternoons with every rule."""
        scale = run.scale
        run.learn(self.trainings(scale))
        rules = [*RULES, *((choice, True, choice) for choice in run.include)]
        sequences = max(scale.goals // _GOALS, 1)
        units = [
            Afternoons(
                training, task, adapter, self.perception, carried, sequences, _GOALS,
                scale.rounds, self.seed,
            )
            for adapter, carried, _ in rules
            for task in self.tasks
            for training in self._trainings(TASKS[task], scale)
        ]  # fmt: skip
        results = run.results(units)
        shape = len(rules), len(self.tasks), scale.trainings, sequences, _GOALS
        solved = np.array([result["solved_at"] for result in results]).reshape(shape)
        trials = trials_counted(solved[..., 1:], scale.rounds)
        # A row a training, a column a goal of all afternoons.
        flat = trials.reshape(*shape[:3], sequences * (_GOALS - 1))
        overall = flat.mean(axis=1)
        names = [label for _, _, label in rules]
        ours, alone = names.index(_OURS), names.index(_OURS_ALONE)
        by_place = trials_counted(solved, scale.rounds).mean(axis=(1, 2, 3))
        said = [
            row
            for unit, result in zip(units, results, strict=True)
            if unit.adapter == "bayes"
            for row in said_and_came(result, scale.rounds)
        ]
        return {
            "tasks": list(self.tasks),
            "trainings": scale.trainings,
            "sequences": sequences,
            "trials": {
                name: {
                    **{
                        task: bootstrap_mean(flat[i, j], within=(1, scale.rounds + 1))
                        for j, task in enumerate(self.tasks)
                    },
                    "mean": bootstrap_mean(overall[i], within=(1, scale.rounds + 1)),
                }
                for i, name in enumerate(names)
            },
            "ours_minus": {
                name: bootstrap_difference(overall[ours], overall[i])
                for i, name in enumerate(names)
                if i != ours
            },
            "alone_minus": {
                name: bootstrap_difference(overall[alone], overall[i])
                for i, (_, carried, name) in enumerate(rules)
                if i != alone and not carried
            },
            "by_place": {name: by_place[i].tolist() for i, name in enumerate(names)},
            "p_hit": reliability(np.array(said)),
        }

    def _trainings(self, task: str, scale: Scale) -> list[Training]:
        return [
            Training(task, name, self.generator, seed, perception=self.perception)
            for name in scale.sets
            for seed in scale.seeds
        ]


def said_and_came(result: Mapping[str, Any], rounds: int) -> list[tuple[float, float, float]]:
    """P(hit) as it was said before each trial, whether it hit, and the trials to go, this one too.

    Args:
        result: What a unit of afternoons gave.
        rounds: Trials a goal at most; a goal that was not reached would have taken one more.
    """
    said = iter(result["expected"])
    rows = []
    for solved_at in np.ravel(result["solved_at"]):
        needed = int(trials_counted(np.array(solved_at), rounds))
        for before in range(min(needed, rounds)):
            p_hit, hit = next(said)
            rows.append((p_hit, float(hit), float(needed - before)))
    return rows


def reliability(said: Float[np.ndarray, "n 3"]) -> dict[str, Any]:
    """What was said of P(hit) and came of it; Brier score beside the base rate's."""
    p_hit, hit, to_go = said.T
    which = np.clip(np.digitize(p_hit, _BINS) - 1, 0, len(_BINS) - 2)
    return {
        "n": len(said),
        "brier": float(np.mean((p_hit - hit) ** 2)),
        "base_rate": float(hit.mean() * (1 - hit.mean())),
        "bins": [
            {
                "said": float(p_hit[which == b].mean()),
                "hit": float(hit[which == b].mean()),
                "to_go": float(to_go[which == b].mean()),
                "n": n,
            }
            for b in range(len(_BINS) - 1)
            if (n := int(np.sum(which == b)))
        ],
    }


def table(figures: Figures) -> Table:
    """One row a rule."""
    tasks = [*figures["tasks"], "mean"]
    return Table(
        ("adapter", *tasks, "ours minus it, mean"),
        tuple(
            (
                name,
                *(str(of_task[task]) for task in tasks),
                f"{figures['ours_minus'][name]:+.2f}" if name in figures["ours_minus"] else "",
            )
            for name, of_task in figures["trials"].items()
        ),
    )


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Means with their intervals, and how they go from goal to goal."""
    from prior_reinforce.report.style import GOAL, INK_SOFT, calm_axes, drawing, new_figure
    from prior_reinforce.report.style import save_figure as save

    with drawing():
        figure = new_figure(10.5, 4.4)
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        carried = {label: remembers for _, remembers, label in RULES}
        shown = {n: of["mean"] for n, of in figures["trials"].items()}
        for axes in (left, right):
            calm_axes(axes)
        for place, (name, mean) in enumerate(shown.items()):
            colour = GOAL if name == _OURS else INK_SOFT
            left.plot([mean.low, mean.high], [place, place], color=colour, linewidth=2)
            left.plot([mean.value], [place], "o", color=colour)
            curve = figures["by_place"][name]
            places = range(1, _GOALS + 1)
            if carried.get(name, True):  # what was included is
                style = {"linewidth": 2.5} if name == _OURS else {"linestyle": _DASHES[place % 3]}
                right.plot(places, curve, color=colour, label=name, **style)
            elif min(curve) < 2 * min(figures["by_place"][_OURS]):
                first = not any(line.get_label() == _ALONE for line in right.lines)
                label = _ALONE if first else None
                right.plot(places, curve, color=INK_SOFT, alpha=0.35, linewidth=1, label=label)
        left.set_yticks(range(len(shown)), list(shown))
        left.invert_yaxis()
        left.set_xscale("log")
        left.set_xticks([1.5, 2, 3, 5, 10], ["1.5", "2", "3", "5", "10"])
        left.minorticks_off()
        left.set_xlabel("trials a goal, goals 2 to 8, mean of the tasks")
        right.set_xticks(range(1, _GOALS + 1))
        right.legend(
            frameon=False, fontsize=8.5, labelcolor=INK_SOFT, loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
        )  # fmt: skip
        right.set_xlabel("goal of the afternoon")
        right.set_ylabel("trials")
    caption = (
        "Left: mean trials a goal on goals 2 to 8 of an afternoon, by eye, in the mean of the "
        "tasks, with 95 % intervals over trainings and goals. Right: the mean by place of the "
        "goal, for rules whose best is within twice ours."
    )
    return [Picture(save(figure, folder / "adaptation.png"), caption)]


def remarks(figures: Figures) -> list[str]:
    """Who is ahead where nothing is remembered, and how far what is said can be trusted."""
    alone = "; ".join(
        f"{name.removesuffix(', each goal alone')} {of:+.2f}"
        for name, of in figures["alone_minus"].items()
    )
    return [
        f"Each goal alone, the Bayesian adapter minus: {alone}.",
        reliability_in_words(figures["p_hit"]),
    ]


def reliability_in_words(p: Mapping[str, Any]) -> str:
    """A reliability table in a sentence."""
    bins = "; ".join(
        f"{b['said']:.2f}: {b['hit']:.2f} of {b['n']}, {b['to_go']:.2f}" for b in p["bins"]
    )
    return (
        f"P(hit), as the Bayesian adapter said it before each of {p['n']} trials: Brier score "
        f"{p['brier']:.3f}, that of the base rate {p['base_rate']:.3f}. Said, the share that hit, "
        f"and the mean of trials to go, this one included: {bins}."
    )


RECIPE = Recipe(
    "adaptation", "Trials from goal to goal", "not in the paper",
    Adaptation(), table, draw, remarks=remarks, family="adapter",
)  # fmt: skip
