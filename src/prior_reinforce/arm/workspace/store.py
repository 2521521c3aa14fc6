"""The files of a workspace that events name: written whole, durable, and never changed.

    demonstrations/<hash>.npz   one file an import
    models/<hash>/              one folder a training
    plans/trial-NNN-<hash>.npz  one file a trial
    adapter.npz                 what the adapter knew last; no event names it, and it may be deleted

An event that names a file is appended only once the file is on the disk, so that a power cut
leaves at worst a file that nothing names.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from prior_reinforce.adapters.base import State
from prior_reinforce.arm.robots.plan_files import PlanFile, read_plan, write_plan
from prior_reinforce.arm.workspace.events import KeptPlan
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from prior_reinforce.files import (
    in_place,
    named_disk_errors,
    require_inside,
    sha256,
    sha256_of_folder,
    sweep,
)
from prior_reinforce.plans.motions import Demonstrations, Plan

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter
    from prior_reinforce.generators.base import Generator

_ADAPTER = "adapter.npz"
_DIGITS = 16
"""Of a hash in a name: no two of a workspace's files will ever share 64 bits."""


class Store:
    """Where the files lie.

    WorkspaceError if the disk is full, or the folder read-only; FileFormatError if a file is
    missing, damaged, another one, or led to by a link out of the workspace.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, *parts: str) -> Path:
        """A place in the workspace."""
        return require_inside(self._folder.joinpath(*parts), self._folder)

    def save_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Keep demonstrations under their hash."""
        path = self.path("demonstrations", f"{demonstrations.sha256[:_DIGITS]}.npz")
        with named_disk_errors(self._folder), in_place(path) as unfinished:
            demonstrations.save(unfinished)

    def demonstrations(self, sha256: str) -> Demonstrations:
        """Read what was kept."""
        path = self.path("demonstrations", f"{sha256[:_DIGITS]}.npz")
        with suppress(FileFormatError, InvalidDemonstrationsError):
            found = Demonstrations.load(path)
            if sha256 == found.sha256:
                return found
        what = "is not what was imported" if path.exists() else "is missing"
        raise FileFormatError(
            f"{path} {what}; restore it from a copy, or bring the recordings in again: "
            f"prior-reinforce import {self._folder} RECORDINGS"
        )

    def save_model(self, generator: Generator) -> str:
        """Keep a fitted generator; its hash is the name of its folder."""
        models = self._folder / "models"
        with named_disk_errors(self._folder):
            models.mkdir(exist_ok=True)
            sweep(models)
            with tempfile.TemporaryDirectory(dir=models, prefix=".new-") as scratch:
                saved = Path(scratch) / "model"
                generator.save(saved)
                model = sha256_of_folder(saved)[:_DIGITS]
                kept = self.path("models", model)
                if not _is_model(kept, model):  # nothing can read it, and this mends it
                    if kept.is_dir():
                        shutil.rmtree(kept)
                    else:
                        kept.unlink(missing_ok=True)
                with in_place(kept) as unfinished:
                    shutil.copytree(saved, unfinished)
        return model

    def model(self, model: str) -> Generator:
        """Load the generator that was kept under a hash."""
        from prior_reinforce.generators import load_generator

        folder = self.path("models", model)
        if not _is_model(folder, model):
            raise FileFormatError(
                f"the model in {folder} is not the one that was learned; restore it from a copy, "
                f"or run: prior-reinforce learn {self._folder}"
            )
        return load_generator(folder)

    def save_adapter(self, adapter: Adapter) -> None:
        """Keep what an adapter knows, if it is one to which it takes long to be told."""
        state = adapter.state()
        if state is not None:
            with named_disk_errors(self._folder), in_place(self.path(_ADAPTER)) as unfinished:
                state.save(unfinished)

    def adapter(self) -> State | None:
        """State of the adapter that was kept last; None where none can be read."""
        with suppress(FileFormatError):
            return State.load(self.path(_ADAPTER))
        return None

    def save_plan(self, plan: Plan, number: int, named: Collection[str] = ()) -> PlanFile:
        """Keep a trial's plan.

        `named` are the plans that events name: any other file is what a crash left before its
        event, and is replaced.
        """
        path = self.path("plans", f"trial-{number:03d}-{sha256(plan.actions.tobytes())[:8]}.npz")
        with named_disk_errors(self._folder):
            path.parent.mkdir(exist_ok=True)
            if path.name not in named:
                path.unlink(missing_ok=True)
        return write_plan(plan, path)

    def plan_file(self, kept: KeptPlan) -> PlanFile:
        """A plan's file, as the journal knows it."""
        return PlanFile(self.path("plans", kept.file), kept.sha256)

    def plan(self, kept: KeptPlan) -> Plan:
        """Read a plan."""
        file = self.plan_file(kept)
        return read_plan(file.path, sha256=file.sha256)

    def names_of_plans(self, kept: Iterable[KeptPlan]) -> tuple[str, ...] | None:
        """Names of the columns of plans, by the first that can be read; None where none can."""
        for each in kept:
            with suppress(FileFormatError):
                return self.plan(each).format.names
        return None

    def make_execution_folder(self, plan: str) -> Path:
        """Make an empty folder for what a command writes while it executes the plan of a file."""
        with named_disk_errors(self._folder):
            attempt = 1
            while True:
                folder = self.execution_folder(f"{Path(plan).stem}-{attempt}")
                try:
                    folder.mkdir(parents=True)
                except FileExistsError:
                    attempt += 1
                else:
                    return folder

    def execution_folders(self, plan: str) -> list[Path]:
        """Such folders that are there: a plan's name says which trial and which plan."""
        return sorted((self._folder / "executions").glob(f"{Path(plan).stem}-*"))

    def execution_folder(self, name: str) -> Path:
        """Where such a folder lies."""
        return self.path("executions", Path(name).name)


def _is_model(folder: Path, model: str) -> bool:
    """Whether a folder holds the model that its name says, and nothing else."""
    try:
        return folder.is_dir() and sha256_of_folder(folder)[:_DIGITS] == model
    except FileFormatError:
        return False
