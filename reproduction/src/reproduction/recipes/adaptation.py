"""Trials a goal in an afternoon of eight: what remembering earlier goals is worth (ours).

One closed-form generator behind all, learned from demonstrations seen by eye; trials by eye, in
contact physics. Goals 2 to 8 count: before the first there is nothing to remember.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Columns, Table, mean_of
from reproduction.results import TRIALS, Results
from reproduction.sequences import Afternoons

TASKS = {
    "basketball-v1": "basketball-v1",
    "curling": "curling",
    "fishing": "fishing",
    "basketball-v2": "basketball-v1",
    "basketball-v3": "basketball-v1",
}
"""Where it is tried, and whose demonstrations are learned from."""
RIDGE = "reproduction.affine:RidgeAdapter"
RULES = (
    ("bayes", True, "Bayesian, earlier goals too"),
    ("bayes", False, "Bayesian, each goal alone"),
    ("gp-two-term", True, "GP of two terms, m = 2, earlier goals too"),
    ("gp-two-term-all", True, "GP of two terms, no forgetting, earlier goals too"),
    ("gp-two-term", False, "GP of two terms, m = 2, each goal alone"),
    ("offset", False, "mean offset, each goal alone"),
    ("proportional", False, "proportional, 0.8"),
    ("proportional,gain=0.6", False, "proportional, 0.6"),
    ("broyden", False, "Broyden, 0.8"),
    ("frozen", False, "no adapter"),
    (RIDGE, True, "ridge on the spline's weights, earlier goals too"),
)
"""The adapters compared, whether earlier goals' trials serve them, and what each is called."""
GENERATOR = "interpolation,timing=align"
"""Behind every adapter."""
OURS, OURS_ALONE = "Bayesian, earlier goals too", "Bayesian, each goal alone"
GOALS = 8
"""Of an afternoon; the first does not count."""
_ALONE = "each goal alone, all rules"
_DASHES = ("--", ":", "-.")
"""Of the lines of rivals that remember, all in one grey."""
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.01)
_LEAST = 50
"""Bins of P(hit), the same wherever it is shown, and trials below which a bin is not shown."""
_WORTH, _OFF = 0.95, 0.1
"""P(hit) is worthless where its Brier score is above this part of the base rate's, and calibrated
where no bin shown is off by more (ours)."""


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same afternoons with every rule."""
    return afternoons(scale, [*RULES, *((choice, True, choice) for choice in include)])


def afternoons(
    scale: Scale,
    rules: Sequence[tuple[str, bool, str]],
    generator: str = GENERATOR,
    tasks: Sequence[str] = tuple(TASKS),
    sequences: int | None = None,
) -> list[Planned]:
    """Afternoons of every rule on every task; None: as many as the scale's goals fill, or one."""
    sequences = max(scale.goals // GOALS, 1) if sequences is None else sequences
    return [
        (
            Afternoons(
                training, task, sequences, adapter=adapter, carry_over=carried, goals=GOALS,
                rounds=scale.rounds,
            ),
            {"method": label},
        )
        for adapter, carried, label in rules
        for task in tasks
        for training in scale.trainings(generator, TASKS[task], perception="eye")
    ]  # fmt: skip


def later(results: Results) -> Results:
    """The goals that count: all but the first of an afternoon."""
    if results.empty:
        return results
    return replace(results, frame=results.frame[results.frame["goal"] > 0])


def said_and_came(results: Results) -> pd.DataFrame:
    """P(hit) predicted before each trial, the trial's `number` from 0, and whether it `hit`."""
    told = results.having("p_hit").frame
    said = told["p_hit"].str.split()
    lengths = said.str.len().to_numpy(dtype=int)
    number = np.concatenate([np.zeros(0), *map(np.arange, lengths)])
    return pd.DataFrame(
        {
            "p_hit": np.array(said.explode(), dtype=float),
            "number": number,
            "hit": np.repeat(told["solved_at"].to_numpy(), lengths) == number + 1,
        }
    )


def reliability(results: Results) -> str:
    """What P(hit) is worth, in a sentence: its Brier score beside that of the base rate."""
    brier, base, n = _brier(said_and_came(results))
    return (
        f"P(hit), as the Bayesian adapter predicted it before each of {n} trials: Brier score "
        f"{brier:.3f}, that of the base rate {base:.3f}."
    )


def _brier(said: pd.DataFrame) -> tuple[float, float, int]:
    """Brier score, that of who always says the share that hits, and the number of trials."""
    base = said["hit"].mean()
    return ((said["p_hit"] - said["hit"]) ** 2).mean(), base * (1 - base), len(said)


def p_hit_table(results: Results) -> Table:
    """Predicted and observed, by variant, task, and first trial of a goal or later."""
    rows = {
        (method, task, trial): said
        for method, of_method in results.having("p_hit").by("method").items()
        for task, of in of_method.by("task").items()
        for trial, said in _first_and_later(said_and_came(of))
    }

    def within(said: pd.DataFrame, low: float) -> str:
        of = _binned(said).get(low)
        return "" if of is None else f"{of['p_hit'].mean():.2f}: {of['hit'].mean():.2f}"

    columns: Columns = {
        "trials": len,
        **{
            f"{low:g} to {min(high, 1):g}": partial(within, low=low)
            for low, high in pairwise(_BINS)
        },
        "Brier": lambda said: f"{_brier(said)[0]:.3f}",
        "base rate's": lambda said: f"{_brier(said)[1]:.3f}",
        "so it is": _worth,
    }
    return Table.of(("adapter", "task", "trial"), rows, columns)


def _first_and_later(said: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    yield "first", said[said["number"] == 0]
    yield "later", said[said["number"] > 0]


def _binned(said: pd.DataFrame) -> dict[float, pd.DataFrame]:
    """Trials by the lower end of their bin, where there are enough."""
    bins = pd.cut(said["p_hit"], _BINS, right=False, labels=_BINS[:-1])
    groups = said.groupby(bins, observed=True)
    return {float(low): of for low, of in groups if len(of) >= _LEAST}


def _worth(said: pd.DataFrame) -> str:
    brier, base, _ = _brier(said)
    off = [abs(of["p_hit"].mean() - of["hit"].mean()) for of in _binned(said).values()]
    word = "calibrated" if max(off, default=0.0) <= _OFF else "off"
    return f"{word}, worthless" if brier > _WORTH * base else word


def table(results: Results) -> Table:
    """One row a rule."""
    counted = later(results)
    methods = counted.by("method")
    columns: Columns = {
        **{task: mean_of(TRIALS, task=task) for task in counted.by("task")},
        "mean": mean_of(TRIALS),
        "ours minus it, mean": lambda of: methods[OURS].beside(of),
    }
    return Table.of(("adapter",), methods, columns)


def draw(results: Results, folder: Path) -> list[Picture]:
    """Means with their intervals, and how they go from goal to goal."""
    from prior_reinforce.report.style import GOAL, INK_SOFT, calm_axes, drawing, new_figure
    from prior_reinforce.report.style import save_figure as save

    methods = results.by("method")
    means = {name: later(of).mean(TRIALS) for name, of in methods.items()}
    curves = {
        name: [of.where(goal=j).mean(TRIALS).value for j in range(GOALS)]
        for name, of in methods.items()
    }
    places, dashes = range(1, GOALS + 1), cycle(_DASHES)
    with drawing():
        figure = new_figure(10.5, 5.2)
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        for axes in (left, right):
            calm_axes(axes)
        for row, (name, of) in enumerate(methods.items()):
            mean, colour = means[name], GOAL if name == OURS else INK_SOFT
            left.plot([mean.low, mean.high], [row, row], color=colour, linewidth=2)
            left.plot([mean.value], [row], "o", color=colour)
            if of.first("remembers"):
                style = {"linewidth": 2.5} if name == OURS else {"linestyle": next(dashes)}
                right.plot(places, curves[name], color=colour, label=name, **style)
            elif min(curves[name]) < 2 * min(curves[OURS]):
                first = not any(line.get_label() == _ALONE for line in right.lines)
                faint = {"alpha": 0.35, "linewidth": 1, "label": _ALONE if first else None}
                right.plot(places, curves[name], color=INK_SOFT, **faint)
        left.set_yticks(range(len(methods)), list(methods))
        left.invert_yaxis()
        left.set_xscale("log")
        most = max(mean.value for mean in means.values())
        ticks = [tick for tick in (1.5, 2, 2.5, 3, 5, 10) if tick < 1.2 * most]
        left.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        left.minorticks_off()
        left.set_xlabel("trials a goal, goals 2 to 8, mean of the tasks")
        right.set_xticks(places)
        figure.legend(
            *right.get_legend_handles_labels(), frameon=False, fontsize=8.5, labelcolor=INK_SOFT,
            loc="outside lower center", ncols=3, title="right", alignment="left",
        )  # fmt: skip
        right.set_xlabel("goal of the afternoon")
        right.set_ylabel("trials")
    caption = (
        "Left: mean trials a goal on goals 2 to 8 of an afternoon, by eye, in the mean of the "
        "tasks, with 95 % intervals over sets and goals. Right: the mean by place of the "
        "goal, for rules whose best is within twice ours."
    )
    return [Picture(save(figure, folder / f"{results.first('recipe')}.png"), caption)]


def remarks(results: Results) -> list[str]:
    """Who is ahead where nothing is remembered, and how far what is said can be trusted."""
    methods = later(results).by("method")
    alone = "; ".join(
        f"{name} {methods[OURS_ALONE].beside(of)}"
        for name, of in methods.items()
        if name != OURS_ALONE and not of.first("remembers")
    )
    return [
        f"Each goal alone, the Bayesian adapter minus: {alone}. V2 and V3 are in-sample for it: "
        "the size of a change of hardware in its prior was taken from fields of theirs "
        "(reproduction/docs/decisions-adapter.md).",
        reliability(results),
    ]


def behind_networks(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The rules that remember, and two of each goal alone, with a network shared with `trials`."""
    rules = [rule for rule in RULES if rule[1] or rule[0] in ("bayes", "gp-two-term")]
    return afternoons(scale, rules, "diffusion")


RECIPE = Recipe(
    "adaptation", "Trials from goal to goal", "not in the paper", units, table, draw, remarks,
    family="adapter",
)  # fmt: skip
NETWORK = Recipe(
    "adaptation-network", "Trials from goal to goal, behind a network alone", "not in the paper",
    behind_networks, table, draw, remarks, apart=True,
)  # fmt: skip
