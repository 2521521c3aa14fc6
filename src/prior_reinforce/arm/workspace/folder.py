"""The folder of a workspace: recognised, and made."""

from __future__ import annotations

import difflib
from pathlib import Path

from prior_reinforce.arm.workspace.journal import JOURNAL_FILE
from prior_reinforce.arm.workspace.manifest import MANIFEST_FILE, parse_manifest
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.files import named_disk_errors, require_inside, sweep, write

RECORDINGS = "recordings"
"""Folder of what `record` takes, a numbered one for each time."""
_FOLDERS = ("demonstrations", "models", "plans", "executions", "pictures", "report")
_OWN = (MANIFEST_FILE, JOURNAL_FILE, *_FOLDERS, "demonstrations.png", "outcomes.csv")
"""What is read and written in the folder."""


def make_folder(folder: Path, manifest: str) -> None:
    """Make a folder with a manifest; nothing is made if a value in it is wrong.

    WorkspaceError if the folder holds something already, or cannot be written; else as
    `parse_manifest`.
    """
    parse_manifest(manifest, folder / MANIFEST_FILE)
    with named_disk_errors(folder):
        sweep(folder)
        require_new(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write(folder / MANIFEST_FILE, manifest)


def require_new(folder: Path) -> None:
    """Do nothing if a workspace can be made there: the folder is empty, or there is none.

    WorkspaceError if the folder holds something already.
    """
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise WorkspaceError(f"{folder} exists and is not empty; choose a new folder")


def check_folder(folder: Path) -> None:
    """Do nothing if a folder is a workspace, and no part of it a link out of it.

    WorkspaceError if it has no manifest, FileFormatError if a part leads out of it.
    """
    for name in _OWN:
        require_inside(folder / name, folder)
    if not (folder / MANIFEST_FILE).is_file():
        raise WorkspaceError(
            f"{folder} is not a workspace (it has no {MANIFEST_FILE}){_meant(folder)}"
        )


def _meant(folder: Path) -> str:
    """What to do where a folder is no workspace: another name beside it, or a new one."""
    there = [path.parent.name for path in folder.parent.glob(f"*/{MANIFEST_FILE}")]
    closest = difflib.get_close_matches(folder.name, there, n=1)
    if closest and not folder.exists():  # what exists is no misspelt name
        return f"; did you mean {folder.with_name(closest[0])}?"
    return "; name the workspace first, or make one with: prior-reinforce new WORKSPACE"
