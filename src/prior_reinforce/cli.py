"""The `prior-reinforce` command: parse to a dataclass, call once, print.

Each command is a class in `commands/`; this file lists them. What a user did wrong is one line on
standard error and exit status 2.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from typing import Protocol

import tyro

from prior_reinforce.commands.importing import Import
from prior_reinforce.commands.learning import Learn
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
}


def main(args: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        args: The command line without the program's name; None takes the process's own.

    Returns:
        The exit status: 0 done, 1 not solved, 2 wrong input, 130 interrupted.
    """
    warnings.showwarning = _print_warning
    try:
        command = tyro.extras.subcommand_cli_from_dict(
            COMMANDS,  # type: ignore[arg-type]
            prog="prior-reinforce",
            description="Hit a goal a robot arm has never hit, in about ten real trials.",
            args=args,
        )
        return command.run() or 0
    except PriorReinforceError as error:
        print(f"prior-reinforce: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("prior-reinforce: interrupted", file=sys.stderr)
        return 130


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"prior-reinforce: warning: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
