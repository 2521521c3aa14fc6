"""The `prior-reinforce` command: parse to a dataclass, call once, print.

Each command is a class in `commands/`; this file lists them. What a user did wrong is one line on
standard error and exit status 2.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Protocol

import tyro

from prior_reinforce.commands.importing import Import
from prior_reinforce.commands.learning import Learn
from prior_reinforce.commands.photographs import Calibrate, Look
from prior_reinforce.commands.reproduce import Reproduce
from prior_reinforce.commands.simulated import Adapt, Demo, Rollout
from prior_reinforce.commands.trials import Amend, Ask, Export, Tell, Void
from prior_reinforce.commands.workspace import Goal, Log, New, Report, Status
from prior_reinforce.errors import PriorReinforceError


class Command(Protocol):
    """A parsed command line."""

    def run(self) -> int | None:
        """Do it; the exit status, None for 0."""


COMMANDS: dict[str, type[Command]] = {
    "demo": Demo,
    "learn": Learn,
    "adapt": Adapt,
    "rollout": Rollout,
    "reproduce": Reproduce,
    "new": New,
    "import": Import,
    "goal": Goal,
    "ask": Ask,
    "tell": Tell,
    "void": Void,
    "amend": Amend,
    "status": Status,
    "log": Log,
    "report": Report,
    "export": Export,
    "calibrate": Calibrate,
    "look": Look,
}
_NOBODY_READS = 141
"""Exit status where the reader of our output left before the end: a shell's for SIGPIPE (128 + 13),
since what the command still had to do was not done."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        args: The command line without the program's name; None takes the process's own.

    Returns:
        The exit status: 0 done, 1 not solved, 2 wrong input, 130 interrupted, 141 nobody read on.
    """
    warnings.showwarning = _print_warning
    try:
        command = tyro.extras.subcommand_cli_from_dict(
            COMMANDS,  # type: ignore[arg-type]
            prog="prior-reinforce",
            description="Hit a goal a robot arm has never hit, in about ten real trials.",
            args=args,
        )
        status = command.run() or 0
        return status if _flushed() else _NOBODY_READS
    except BrokenPipeError:
        if _flushed():  # not our output's pipe
            raise
        return _NOBODY_READS
    except PriorReinforceError as error:
        print(f"prior-reinforce: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("prior-reinforce: interrupted", file=sys.stderr)
        return 130


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
