"""What commands share: which workspace and which trial their words are about, JSON, colour."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Collection
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec
import tyro

from prior_reinforce.arm.workspace.manifest import workspace_around
from prior_reinforce.arm.workspace.text import call, next_step
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.files import check_path
from prior_reinforce.terminal import GREEN, RED, YELLOW, coloured, plain

Words = Annotated[tuple[str, ...], tyro.conf.Positional]
"""Positional words of a command on a workspace; see `find_workspace`."""
Json = Annotated[bool, tyro.conf.arg(help="Print JSON for programs (docs/workspace.md).")]
_COLOURS = {"REFUSE": RED, "WARN": YELLOW, "ok": GREEN}
"""Of the words that begin a line of the gate."""


@dataclass(frozen=True)
class OnWorkspace:
    """A command on a workspace."""

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE]")] = ()
    """Folder of the workspace; the one that the current folder is in if not given."""

    takes_words: ClassVar[bool] = False
    """Whether the command takes words beside the workspace."""

    def run(self) -> int | None:
        """Open the workspace and do it there; the exit status, None for 0."""
        folder, words = find_workspace(self.words)
        if words and not self.takes_words:
            raise ConfigurationError(
                f"{words[0]!r} is no workspace, and this command takes nothing else; drop it"
            )
        with Workspace(folder) as workspace:
            return self._run_on(workspace, words)

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> int | None:
        """What the command does, with the words beside the workspace."""
        raise NotImplementedError


def find_workspace(words: tuple[str, ...]) -> tuple[Path, tuple[str, ...]]:
    """Return a workspace's folder and the words that are not its name.

    Within a workspace the words are about it, unless the first one names another; a number never
    does (a folder that is called 3 is `./3`). Elsewhere the first word is the folder.
    ConfigurationError if none is named, and the current folder is in none.
    """
    here = workspace_around(Path())
    if words and (here is None or _names_workspace(words[0])):
        return check_path(Path(words[0])), words[1:]
    if here is None:
        raise ConfigurationError(
            "name the workspace, or change into its folder; make one with: prior-reinforce new "
            "WORKSPACE"
        )
    return here, words


def _names_workspace(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return workspace_around(Path(word), above=False) is not None
    return False


def trial_and_rest(
    workspace: Workspace, words: tuple[str, ...], *, told: bool = False
) -> tuple[int, tuple[str, ...]]:
    """Return the trial that the first word numbers, and the other words.

    Where it is no number, the trial that waits; or, with `told`, the latest that was told.
    ConfigurationError if none is numbered, and there is no such trial.
    """
    if words and re.fullmatch(r"-?\d{1,9}", words[0], re.ASCII):
        return int(words[0]), words[1:]
    state, folder = workspace.state, workspace.folder
    latest = next((trial for trial in reversed(state.trials) if trial.amendable), None)
    trial = latest if told else state.open_trial
    if trial is not None:
        return trial.number, words
    ask = call(folder, "ask")
    if told:
        raise ConfigurationError(f"no trial was told yet; tell one, or get a plan: {ask}")
    others = "" if latest is None else f"; to correct a told one: {call(folder, 'amend', 'N')} ..."
    raise ConfigurationError(
        f"no trial waits; get the next plan: {ask}{others}; or put a trial's number first"
    )


def options_of(given: Any, without: Collection[str] = ()) -> list[str]:
    """The options of a command as they are typed, each with its values; defaults are left out."""
    said = []
    for each in fields(given):
        value = getattr(given, each.name)
        if each.name not in without and value != each.default:
            name = f"--{'no-' if value is False else ''}{each.name.replace('_', '-')}"
            values = value if isinstance(value, tuple) else (value,)
            words = [str(v) for v in values if not isinstance(v, bool)]
            if "UseAppendAction" in str(each.type):
                said += [shlex.join([name, word]) for word in words]
            else:
                said.append(shlex.join([name, *words]))
    return said


def print_next(workspace: Workspace) -> None:
    """Say which command comes next."""
    print(f"next: {next_step(workspace.standing)}")


def print_json(record: object) -> None:
    """Print records of `arm.workspace.view`; what is not finite is null."""
    print(msgspec.json.format(msgspec.json.encode(record)).decode())


def print_checked(text: str) -> None:
    """Print what the gate says, its verdicts in colour where a terminal shows them."""
    print(
        re.sub(
            rf"^( *)({'|'.join(_COLOURS)})\b",
            lambda found: found[1] + coloured(found[2], _COLOURS[found[2]], sys.stdout),
            plain(text, keep="\n"),
            flags=re.MULTILINE,
        )
    )
