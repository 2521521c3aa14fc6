"""Work cut into units: each runs alone, gives the same result anywhere, and is written once.

A killed run goes on where it was, because a unit whose result is on disk is not run again; a
result is moved into place whole. Results do not depend on how many workers there are, because a
unit depends on nothing but its own fields: one thread, its own seeds.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import joblib

from prior_reinforce.errors import MissingExtraError


class Unit(Protocol):
    """A piece of work: a frozen dataclass of plain values."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Do it and return a JSON-able result; `folder` holds models shared between units."""


@dataclass(frozen=True)
class Workers:
    """Where units run."""

    count: int = 1
    """Processes on this machine."""
    ray: str | None = None
    """Address of a Ray cluster to run on instead."""


def run_units(
    units: Sequence[Unit],
    folder: Path,
    workers: Workers,
    progress: Callable[[int, int, str], None],
) -> list[Mapping[str, Any]]:
    """Run what is not done yet, and return every unit's result in order.

    Args:
        units: What to do.
        folder: Where results and shared models lie; on a cluster, a folder that all nodes share.
        workers: Where to do it.
        progress: Called with units done, units in all, and the label of the last one.

    Raises:
        MissingExtraError: A Ray address was given and Ray is not installed.
    """
    folder = folder.resolve()
    (folder / "units").mkdir(parents=True, exist_ok=True)
    left = [unit for unit in units if not result_path(folder, unit).is_file()]
    done = len(units) - len(left)
    progress(done, len(units), "found on disk" if done else "")
    with _backend(workers):
        parallel = joblib.Parallel(n_jobs=workers.count, return_as="generator_unordered")
        for label in parallel(joblib.delayed(_run)(unit, folder) for unit in left):
            done += 1
            progress(done, len(units), label)
    return [json.loads(result_path(folder, unit).read_text()) for unit in units]


def result_path(folder: Path, unit: Unit) -> Path:
    """Where a unit's result lies: named by its kind and a hash of its fields."""
    fields = json.dumps(asdict(unit), sort_keys=True, default=str)  # type: ignore[call-overload]
    digest = hashlib.sha256(fields.encode()).hexdigest()[:16]
    return folder / "units" / f"{type(unit).__name__.lower()}-{digest}.json"


def write_atomically(path: Path, text: str) -> None:
    """Put a text in place whole or not at all, durable."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _run(unit: Unit, folder: Path) -> str:
    result = unit.run(folder)
    fields = asdict(unit)  # type: ignore[call-overload]
    text = json.dumps({"unit": fields, "result": result}, default=str, allow_nan=False)
    write_atomically(result_path(folder, unit), text)
    return unit.label


def _backend(workers: Workers) -> Any:
    if workers.ray is None:
        return joblib.parallel_config(backend="loky", inner_max_num_threads=1)
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError as error:
        raise MissingExtraError(
            'a Ray cluster needs Ray; install it with: pip install "prior-reinforce[ray]"'
        ) from error
    ray.init(address=workers.ray, ignore_reinit_error=True, log_to_driver=False)
    register_ray()  # type: ignore[no-untyped-call]
    return joblib.parallel_config(backend="ray")
