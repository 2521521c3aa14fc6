"""The `prior-reinforce` command: parse to a dataclass, call once, print.

Each command is a class in `commands/`; this file lists them, and imports the one that is called.
What a user did wrong is one line on standard error and exit status 2.
"""

from __future__ import annotations

import os
import pkgutil
import sys
import warnings
from collections.abc import Sequence
from typing import Protocol

import tyro

from prior_reinforce.errors import PriorReinforceError


class Command(Protocol):
    """A parsed command line."""

    def run(self) -> int | None:
        """Do it; the exit status, None for 0."""


_HERE = "prior_reinforce.commands"
COMMANDS = {
    "demo": f"{_HERE}.simulated:Demo",
    "learn": f"{_HERE}.learning:Learn",
    "adapt": f"{_HERE}.simulated:Adapt",
    "rollout": f"{_HERE}.simulated:Rollout",
    "reproduce": f"{_HERE}.reproduce:Reproduce",
    "new": f"{_HERE}.workspace:New",
    "import": f"{_HERE}.importing:Import",
    "goal": f"{_HERE}.workspace:Goal",
    "ask": f"{_HERE}.trials:Ask",
    "tell": f"{_HERE}.trials:Tell",
    "void": f"{_HERE}.trials:Void",
    "amend": f"{_HERE}.trials:Amend",
    "status": f"{_HERE}.workspace:Status",
    "log": f"{_HERE}.workspace:Log",
    "report": f"{_HERE}.workspace:Report",
    "export": f"{_HERE}.trials:Export",
    "calibrate": f"{_HERE}.photographs:Calibrate",
    "look": f"{_HERE}.photographs:Look",
}
"""Where each command's class is: only the one that is called is imported."""
_NOBODY_READS = 141
"""Exit status where the reader of our output left before the end: a shell's for SIGPIPE (128 + 13),
since what the command still had to do was not done."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        args: The command line without the program's name; None takes the process's own.

    Returns:
        The exit status: 0 done, 1 not all of it, 2 wrong input and nothing changed, 130
        interrupted, 141 nobody read on.
    """
    warnings.showwarning = _print_warning
    try:
        command = _parse(list(sys.argv[1:] if args is None else args))
        status = command.run() or 0
        return status if _flushed() else _NOBODY_READS
    except BrokenPipeError:
        if _flushed():  # not our output's pipe
            raise
        return _NOBODY_READS
    except PriorReinforceError as error:
        stays = "; what was recorded before stays" if error.changed else ""
        print(f"prior-reinforce: {error}{stays}", file=sys.stderr)
        return 1 if error.changed else 2
    except KeyboardInterrupt as error:
        print(f"prior-reinforce: interrupted{f'; {error}' if error.args else ''}", file=sys.stderr)
        return 130


def _parse(args: list[str]) -> Command:
    """Make the command that was called; all of them are imported only to list them."""
    name = args[0] if args else ""
    if name in COMMANDS:
        kind = pkgutil.resolve_name(COMMANDS[name])
        command: Command = tyro.cli(kind, prog=f"prior-reinforce {name}", args=args[1:])
        return command
    kinds = {name: pkgutil.resolve_name(target) for name, target in COMMANDS.items()}
    chosen: Command = tyro.extras.subcommand_cli_from_dict(
        kinds,
        prog="prior-reinforce",
        description="Hit a goal a robot arm has never hit, in about ten real trials.",
        args=args,
    )
    return chosen


def _flushed() -> bool:
    """Whether our output's reader is there to take the rest, as it is not after `log hoop | head`.

    Otherwise what Python would still write when it exits goes nowhere.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"prior-reinforce: warning: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
