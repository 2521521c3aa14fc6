"""How the shipped prior sets were made: `make demonstrations` makes them again.

On one kind of processor bit for bit. Another rounds otherwise: plans differ by 1e-13, outcomes by
1e-9, and of stones that are pushed round another by a millimetre.

One module a task; `python -m reproduction.demonstrations.NAME` makes its sets. A and B are as the
paper has them, and stand in the package. Those that are drawn, v00 to v19, stand here; they differ
as these two differ from each other, in aims, starts, tempi and postures, and in the pace within
each motion as well; like them they are demonstrated in physics, so that their outcomes are true.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

import prior_reinforce.simulation.tasks as tasks
from prior_reinforce.environment import Task
from prior_reinforce.plans.motions import Demonstrations

_OURS = Path(__file__).parent / "drawn"

DRAWN = tuple(f"v{number:02d}" for number in range(20))
"""Names of the sets that are drawn."""
_FIRST_SEED = 1000
_CANDIDATES = 20
"""Weighed for each aim: the one that is farthest from the others is taken; ours."""
_WARP, _WAVES = 0.03, 3
"""Standard deviation of each wave's relative change of pace, and their number; ours, of the size of
the differences of tempo."""


def prior_set(task: Task, name: str) -> Demonstrations:
    """Load a prior set, one that was drawn here or one that the task has, without a symmetry.

    The paper's method knows none; what a symmetry adds has recipes of its own.

    Raises:
        ConfigurationError: There is no such set.
    """
    drawn = _OURS / f"{getattr(task, 'recordings', task.name)}_{name}.npz"
    own = Demonstrations.load(drawn) if drawn.is_file() else task.demonstrations(name)
    return own.without_symmetry()


def write_sets(
    make: Callable[[str], Demonstrations], names: Iterable[str], recordings: str, about: str | None
) -> None:
    """Make prior sets, and write them as `<recordings>_<set>.npz` where the command line says."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--folder", type=Path, help="default: where each is shipped")
    folder = parser.parse_args().folder
    shipped = Path(tasks.__file__).parent / "demonstrations"
    for name in names:
        place = folder or (_OURS if name in DRAWN else shipped)
        make(name).save(place / f"{recordings}_{name}.npz")


def seed_and_aims(
    name: str, seeds: Mapping[str, int], aims: Mapping[str, Iterable[tuple[float, float]]]
) -> tuple[int, Float[np.ndarray, "N 2"]]:
    """The seed of a set and where its motions are aimed, (x, y) in [m].

    Of a drawn set, points far from each other in the box of the shipped ones.
    """
    if name in aims:
        return seeds[name], np.array(list(aims[name]))
    seed = _FIRST_SEED + DRAWN.index(name)
    rng = np.random.default_rng([seed, 1])
    both = np.array([point for of_set in aims.values() for point in of_set])
    low, high = both.min(axis=0), both.max(axis=0)
    taken = rng.uniform(low, high, (1, 2))
    for _ in range(len(both) // len(aims) - 1):
        candidates = rng.uniform(low, high, (_CANDIDATES, 2))
        distances = np.linalg.norm(candidates[:, None] - taken[None], axis=-1).min(axis=1)
        taken = np.vstack([taken, candidates[np.argmax(distances)]])
    return seed, taken


def warps(name: str, n: int) -> Float[np.ndarray, "n w"]:
    """Changes of pace within each of n motions, for `following.warped`; none in A and B."""
    if name not in DRAWN:
        return np.zeros((n, _WAVES))
    rng = np.random.default_rng([_FIRST_SEED + DRAWN.index(name), 2])
    return rng.normal(0.0, _WARP, (n, _WAVES))
