"""Work cut into units: each runs alone, gives the same result anywhere, and is written once.

A killed run goes on where it was, because a unit whose result is on disk is not run again; a
result is moved into place whole. Results do not depend on how many workers there are, because a
unit depends on nothing but its own fields: one thread, its own seeds.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.errors import PriorReinforceError
from prior_reinforce.files import sweep, write
from prior_reinforce.generators import GENERATORS
from prior_reinforce.perception import PERCEPTIONS
from prior_reinforce.registry import Registry, load_plugins
from prior_reinforce.simulation.tasks import TASKS
from reproduction.cluster import run_on_ray

_FAMILIES: tuple[Registry[Any], ...] = (GENERATORS, ADAPTERS, PERCEPTIONS, TASKS)


def source_digest(choice: str) -> str:
    """Hash of the file of a class that stands outside of the package; empty for others."""
    name = choice.partition(",")[0]
    for family in _FAMILIES:
        target = family.members[name].target if name in family.members else ""
        module = target.partition(":")[0] if isinstance(target, str) else target.__module__
        found = find_spec(module) if module and not module.startswith("prior_reinforce.") else None
        if found is not None and found.origin is not None:
            return hashlib.sha256(Path(found.origin).read_bytes()).hexdigest()
    return ""


class UnitFailedError(PriorReinforceError, RuntimeError):
    """A unit of an experiment failed; the message names it, and the others' results are kept."""


@dataclass(frozen=True)
class Unit(ABC):
    """A piece of work: a frozen dataclass of plain values; as text, what a progress line says."""

    @property
    def own_sources(self) -> tuple[str, ...]:
        """Hashes of the files of your own classes that its fields choose, or units among them.

        When one of these files is edited, the unit runs anew.
        """
        parts = vars(self).values()
        own = [source_digest(part) for part in parts if isinstance(part, str)]
        return (*own, *(s for part in parts if isinstance(part, Unit) for s in part.own_sources))

    @property
    def needs(self) -> tuple[Unit, ...]:
        """Units whose results or models it takes, to be run first."""
        return tuple(part for part in vars(self).values() if isinstance(part, Unit))

    @abstractmethod
    def run(self, folder: Path) -> Mapping[str, Any]:
        """Do it and return a JSON-able result; `folder` holds models shared between units."""

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """What it gave, as rows of the table of raw results (`results.py`)."""
        return []


_Outcome = tuple[Unit, str | None]
"""A unit, and why it failed; None where it did not."""


@dataclass(frozen=True)
class Workers:
    """Where units run."""

    count: int = 1
    """Processes on this machine."""
    ray: str | None = None
    """Address of a Ray cluster to run on instead; it decides how many units run at a time."""


def run_units(
    units: Sequence[Unit], folder: Path, workers: Workers, progress: Callable[[int, int, str], None]
) -> list[Mapping[str, Any]]:
    """Run what is not done yet, and return what is kept of every unit, in order.

    A result on disk is taken whatever commit made it: the caller is told which one did.

    Args:
        units: What to do.
        folder: Where results and shared models lie; on a cluster, a folder that all nodes share.
        workers: Where to do it.
        progress: Called with units done, units in all, and the label of the last one.

    Returns:
        The unit's fields (`unit`), the code that ran it (`commit`), what it gave (`result`).

    Raises:
        UnitFailedError: Some units failed, or a worker process was killed. All others' results
            are on disk, and running again goes on from there.
        MissingExtraError: A Ray address was given and Ray is not installed.
        ConfigurationError: No Ray cluster answers at the address.
    """
    folder = folder.resolve()
    for part in ("units", "failures"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    left = [unit for unit in units if not result_path(folder, unit).is_file()]
    done = len(units) - len(left)
    progress(done, len(units), "found on disk" if done else "")
    failed: list[tuple[Unit, str]] = []
    for unit, reason in _outcomes(left, folder, workers):
        if reason is None:
            done += 1
            progress(done, len(units), str(unit))
        else:
            failed.append((unit, reason))
    if failed:
        unit, reason = failed[0]
        more = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
        raise UnitFailedError(
            f"{str(unit)!r} failed: {reason}{more}; {done} of {len(units)} results are kept, mend "
            f"it and run again (what happened: {_failure_path(folder, unit)})"
        )
    return [json.loads(result_path(folder, unit).read_text()) for unit in units]


def result_of(folder: Path, unit: Unit) -> Mapping[str, Any]:
    """What a unit gave, within another one: kept, or run now and kept."""
    (kept,) = run_units([unit], folder, Workers(), lambda done, total, label: None)
    result: Mapping[str, Any] = kept["result"]
    return result


def result_path(folder: Path, unit: Unit) -> Path:
    """Where a unit's result lies: named by its kind, and a hash of its fields and own code."""
    return folder / "units" / f"{_name(unit)}.json"


def digest_of(unit: Unit) -> str:
    """What tells a unit from others of its kind: its fields, and your own code behind it."""
    told = json.dumps(asdict(unit), sort_keys=True) + "".join(unit.own_sources)
    return hashlib.sha256(told.encode()).hexdigest()[:16]


@lru_cache(maxsize=1)
def commit() -> str:
    """The checkout's commit when first asked, and a hash of what was changed since.

    Returns:
        As `git describe --dirty` gives it, with the hash of the difference where there is one;
        `not a checkout` where the package is in none, or there is no git.
    """
    try:
        _git("ls-files", "--error-unmatch", Path(__file__).name)
        described = _git("describe", "--always", "--dirty")
        if not described.endswith("-dirty"):
            return described
        return f"{described}-{hashlib.sha256(_git('diff', 'HEAD').encode()).hexdigest()[:8]}"
    except (OSError, subprocess.CalledProcessError):
        return "not a checkout"


def _git(*arguments: str) -> str:
    command = ["git", *arguments]
    here = Path(__file__).parent
    done = subprocess.run(command, capture_output=True, text=True, cwd=here, check=True)
    return done.stdout.strip()


def _outcomes(units: Sequence[Unit], folder: Path, workers: Workers) -> Iterator[_Outcome]:
    """Run units and yield what became of each, as they come."""
    if not units:
        return
    if workers.ray is not None:
        lost = partial(_keep_failure, folder)
        yield from run_on_ray(partial(_run, folder), units, workers.ray, lost=lost)
        return
    import joblib

    parallel = joblib.Parallel(n_jobs=workers.count, return_as="generator_unordered")
    try:
        yield from parallel(joblib.delayed(_run)(folder, unit) for unit in units)
    except BrokenProcessPool as error:
        raise UnitFailedError(
            "a worker process was killed, mostly for want of memory; the results so far are kept, "
            "run again with fewer --workers"
        ) from error


def _run(folder: Path, unit: Unit) -> _Outcome:
    """Run a unit and keep its result; or keep how it failed."""
    # Loads torch before any unit can: joblib would take it for a memory leak, and stop the worker.
    from prior_reinforce.generators.network.threads import torch_threads  # isort: skip
    from threadpoolctl import threadpool_limits

    load_plugins()  # a unit's digest is of its own sources, wherever it is taken
    sweep(folder / "units")
    sweep(folder / "models")
    made_by = commit()  # before the work: a commit made meanwhile is not what ran
    try:
        # The last digits of a sum depend on how many threads share it.
        with threadpool_limits(1), torch_threads(1):
            result = unit.run(folder)
        kept = {"unit": asdict(unit), "commit": made_by, "result": result}
        text = json.dumps(kept, allow_nan=False)
    except Exception as error:
        return _keep_failure(folder, unit, error)
    write(result_path(folder, unit), text)
    _failure_path(folder, unit).unlink(missing_ok=True)
    return unit, None


def _keep_failure(folder: Path, unit: Unit, error: Exception) -> _Outcome:
    write(_failure_path(folder, unit), "".join(traceback.format_exception(error)))
    first_line = str(error).partition("\n")[0]
    return unit, f"{type(error).__name__}: {first_line}"


def _failure_path(folder: Path, unit: Unit) -> Path:
    return folder / "failures" / f"{_name(unit)}.txt"


def _name(unit: Unit) -> str:
    return f"{type(unit).__name__.lower()}-{digest_of(unit)}"
