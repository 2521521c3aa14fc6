"""A command as it is typed, `mycontroller {plan}`, and as it is started: program and arguments.

No shell ever sees it: nothing in a path can become a second command.
"""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from pathlib import Path

from prior_reinforce.arrays import is_positive
from prior_reinforce.errors import ConfigurationError

PLAN, RESULT = "{plan}", "{result}"
"""What stands in a command for the plan's file, and for the folder of what the driver says."""
_PLACE = re.compile(f"{re.escape(PLAN)}|{re.escape(RESULT)}")


def split(command: str) -> list[str]:
    """Split a text as a shell would; ConfigurationError if quotes do not match."""
    try:
        return shlex.split(command)
    except ValueError as error:
        raise ConfigurationError(
            f"cannot split the command {command!r} ({error}); close its quotes"
        ) from error


def split_command(command: str, plan: Path, result: Path = Path("result")) -> tuple[str, ...]:
    """Program and arguments, `{plan}` and `{result}` replaced by paths within one argument.

    ConfigurationError if quotes do not match, or there is no program or no `{plan}`.
    """
    arguments = split(command)
    if not any(PLAN in argument for argument in arguments[1:]):
        raise ConfigurationError(
            f"the command {command!r} must name a program and hold {PLAN} where the plan's path "
            'goes, for instance "mycontroller {plan}"'
        )
    paths = {PLAN: str(plan.resolve()), RESULT: str(result.resolve())}
    return tuple(_PLACE.sub(lambda found: paths[found[0]], word) for word in arguments)


def without_arguments(command: str) -> str:
    """A command for the journal: its program, and where it takes the plan and the result.

    No other argument is kept: any of them may be a password.
    """
    program, *arguments = split(command)
    places = ["".join(_PLACE.findall(word)) or "..." for word in arguments]
    return shlex.join([program]) + "".join(f" {place}" for place in places)


def check_command(command: str, *, time_limit: float) -> None:
    """Do nothing if a command and its limit could be used; arguments as in `run_command`.

    ConfigurationError if it cannot be split, names no program that can run, or lacks `{plan}`; the
    limit is not a positive number; or this is not Linux.
    """
    if not is_positive(time_limit):
        raise ConfigurationError(f"the time limit must be a positive number, got {time_limit!r} s")
    program, *_ = split_command(command, Path("plan"))
    if not sys.platform.startswith("linux"):
        raise ConfigurationError(
            "a command is run on Linux only, where all that it starts is found again; write the "
            "plan with --out and execute it yourself"
        )
    if "\0" in command or shutil.which(program) is None:
        raise ConfigurationError(
            f"cannot start {program!r}; give the path of a program that can run"
        )
