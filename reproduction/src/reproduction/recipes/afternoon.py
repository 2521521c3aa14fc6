"""An afternoon of eight goals from one demonstration: executions in all (ours).

What trials of earlier goals told serves the later ones. Beside it, on A, B and six drawn sets: the
same from nine moved copies of the demonstration, and from the whole set without a symmetry.
Outcomes of demonstrations are exact, trials are seen by eye, and each set has goals of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

from reproduction.demonstrations import DRAWN
from reproduction.evaluation import GOAL_SEED
from reproduction.recipes.adaptation import TASKS, later
from reproduction.recipes.base import Planned, Recipe, Scale
from reproduction.recipes.once import COPIES, NONE, OURS, SHOWN, Declared, Shown, generator_of
from reproduction.recipes.tables import Columns, Table, mean_of
from reproduction.results import FIRST, ROUNDS, TRIALS, Measure, Results
from reproduction.sequences import Afternoons

GOALS = 8
"""Of an afternoon."""
_BESIDE = 8
"""Sets on which the others are tried."""
_MOST = 13
"""Executions in all, the demonstration included, that were not to be exceeded (set before)."""
IN_ALL = Measure(
    lambda rows: (
        # Where all of a set were shown, their number is left out.
        rows["count"].fillna(rows["learned_on"].map(SHOWN)).to_numpy(dtype=float)
        + GOALS * TRIALS.of(rows)
    ),
    (1 + GOALS, 8 + GOALS * (ROUNDS + 1)),
)
"""Demonstrations, and the trials of all goals of an afternoon."""
_METHODS: tuple[tuple[str, Declared], ...] = ((OURS, "own"), (COPIES, "copies"), (NONE, "none"))


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """One afternoon a set with every method; a quick run of ours on the shipped ones."""
    sets = (*scale.sets, *DRAWN) if scale.variants else scale.sets
    methods = _METHODS if scale.variants else _METHODS[:1]
    return [
        (_afternoon(scale, declared, task, name, adapter), {"method": label})
        for number, name in enumerate(sets)
        for label, declared, adapter in (
            *((label, declared, "bayes") for label, declared in methods),
            *((f"{OURS}, {choice}", methods[0][1], choice) for choice in include),
        )
        for task in TASKS
        if label == OURS or number < _BESIDE
    ]


def _afternoon(scale: Scale, declared: Declared, task: str, name: str, adapter: str) -> Afternoons:
    of_set = ("A", "B", *DRAWN).index(name)
    subset = None if declared == "none" else (of_set % SHOWN[TASKS[task]],)
    training = Shown(TASKS[task], name, generator_of(declared), of_set, subset, symmetry=declared)
    return Afternoons(
        training, task, 1, adapter=adapter, carry_over=True, goals=GOALS, rounds=scale.rounds,
        seed=GOAL_SEED + of_set,
    )  # fmt: skip


def table(results: Results) -> Table:
    """One row a task and method."""
    rows = {
        (task, method): of
        for task, of_task in results.by("task").items()
        for method, of in of_task.by("method").items()
    }
    columns: Columns = {
        "executions in all": mean_of(IN_ALL),
        "trials of the first goal": mean_of(TRIALS, goal=0),
        "of a later one": lambda of: later(of).mean(TRIALS),
        "first trials that hit, later goals": lambda of: later(of).mean(FIRST),
        "goals not reached": lambda of: f"{(of.frame['solved_at'] == 0).sum()} of {len(of.frame)}",
    }
    return Table.of(("task", "method"), rows, columns)


def remarks(results: Results) -> list[str]:
    """A verdict a task, in a sentence."""
    said = []
    for task, of in results.by("task").items():
        methods = of.by("method")
        total = methods[OURS].mean(IN_ALL)
        met = "met" if total.value <= _MOST else "missed"
        sentence = f"{task}: {total} executions in all ({met}, at most {_MOST})"
        if COPIES in methods:
            sentence += (
                f"; {COPIES} {methods[OURS].minus(methods[COPIES], IN_ALL):+.1f} (ours minus it)"
            )
        if NONE in methods:
            sentence += f"; all of a set shown, {NONE}: {methods[NONE].mean(IN_ALL)}"
        said.append(f"{sentence}.")
    return said


RECIPE = Recipe(
    "afternoon", "An afternoon of one demonstration", "not in the paper", units, table,
    remarks=remarks, family="adapter", apart=True,
)  # fmt: skip
