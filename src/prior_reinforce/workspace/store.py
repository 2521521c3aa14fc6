"""The files of a workspace that events name: written whole, durable, and never changed.

    demonstrations/<hash>.npz   one file an import
    models/<hash>/              one folder a training
    plans/trial-NNN-<hash>.npz  one file a trial

An event that names a file is appended only once the file is on the disk, so that a power cut
leaves at worst a file that nothing names.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.generators import Generator, load_generator
from prior_reinforce.motions import Demonstrations, Plan
from prior_reinforce.workspace.plan_files import PlanFile, read_plan, write_plan

_DIGITS = 16
"""Of a hash in a name: no two of a workspace's files will ever share 64 bits."""


class Store:
    """Where the files lie."""

    def __init__(self, folder: Path) -> None:
        """Remember the workspace's folder."""
        self._folder = folder

    def save_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Keep demonstrations under their hash.

        Raises:
            WorkspaceError: The disk is full, or the folder read-only.
        """
        path = self._demonstrations_path(demonstrations.sha256)
        with named_disk_errors(self._folder), _unfinished(path.parent) as unfinished:
            demonstrations.save(unfinished / path.name)
            _settle(unfinished)
            os.replace(unfinished / path.name, path)
            _sync(path.parent)

    def demonstrations(self, sha256: str) -> Demonstrations:
        """Read what was kept.

        Raises:
            FileFormatError: The file is missing, damaged, or another one.
        """
        path = self._demonstrations_path(sha256)
        found = Demonstrations.load(path)
        if found.sha256 != sha256:
            raise FileFormatError(
                f"{path} is not what was imported; restore it from a copy, or import again"
            )
        return found

    def save_model(self, generator: Generator) -> str:
        """Keep a fitted generator; its hash is the name of its folder.

        Raises:
            WorkspaceError: The disk is full, or the folder read-only.
        """
        models = self._folder / "models"
        with named_disk_errors(self._folder), _unfinished(models) as unfinished:
            generator.save(unfinished / "model")
            _settle(unfinished / "model")
            model = _hash_folder(unfinished / "model")
            if not (models / model).exists():
                os.replace(unfinished / "model", models / model)
                _sync(models)
        return model

    def model(self, model: str, kind: type[Generator] | None = None) -> Generator:
        """Load a generator that was kept.

        Args:
            model: Its hash.
            kind: Its class, where it is none of ours. It is never taken from the folder: a model
                is data, and names no code to run.

        Raises:
            FileFormatError: Its files are missing, damaged, or others.
        """
        folder = self._folder / "models" / model
        if not folder.is_dir() or _hash_folder(folder) != model:
            raise FileFormatError(
                f"the model in {folder} is not the one that was learned; restore it from a copy, "
                f"or run: prior-reinforce learn {self._folder}"
            )
        return load_generator(folder) if kind is None else kind.load(folder)

    def save_plan(self, plan: Plan, number: int) -> PlanFile:
        """Keep a trial's plan.

        Raises:
            WorkspaceError: The disk is full, or the folder read-only.
        """
        digest = hashlib.sha256(plan.actions.tobytes()).hexdigest()[:8]
        path = self.plan_path(f"trial-{number:03d}-{digest}.npz")
        with named_disk_errors(self._folder):
            path.parent.mkdir(exist_ok=True)
        return write_plan(plan, path)

    def plan_path(self, name: str) -> Path:
        """Where a plan lies."""
        return self._folder / "plans" / name

    def plan(self, name: str, sha256: str) -> Plan:
        """Read a plan that was handed out.

        Raises:
            FileFormatError: The file is missing, or not what was handed out.
        """
        return read_plan(self.plan_path(name), sha256=sha256)

    def _demonstrations_path(self, sha256: str) -> Path:
        return self._folder / "demonstrations" / f"{sha256[:_DIGITS]}.npz"


@contextmanager
def named_disk_errors(folder: Path) -> Iterator[None]:
    """Turn a full disk or a read-only folder into one line."""
    try:
        yield
    except OSError as error:
        raise WorkspaceError(
            f"cannot write to {folder} ({error.strerror}); free some disk space, or make the "
            "folder writable; what was told before is safe"
        ) from error


@contextmanager
def _unfinished(folder: Path) -> Iterator[Path]:
    """A folder beside the final place; gone afterwards, whatever happens."""
    folder.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=folder, prefix=".unfinished-"))
    try:
        yield temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _settle(folder: Path) -> None:
    """Wait until a folder and the files in it are on the disk."""
    for path in folder.iterdir():
        _sync(path)
    _sync(folder)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _hash_folder(folder: Path) -> str:
    digest = hashlib.sha256()
    try:
        for path in sorted(folder.iterdir()):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    except OSError as error:
        raise FileFormatError(
            f"cannot read {error.filename} ({error.strerror}); restore it from a copy"
        ) from error
    return digest.hexdigest()[:_DIGITS]
