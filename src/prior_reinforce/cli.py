"""The `prior-reinforce` command: parse to a dataclass, call once, print.

Each command is a class in `commands/`; this file lists them, and imports the one that is called.
What a user did wrong is one line on standard error and exit status 2.
"""

from __future__ import annotations

import io
import os
import pkgutil
import re
import select
import sys
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Protocol

import tyro

from prior_reinforce.errors import ConfigurationError, PriorReinforceError
from prior_reinforce.extras import missing_extra
from prior_reinforce.wording import plain


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
    "advise": f"{_HERE}.advice:Advise",
    "export": f"{_HERE}.trials:Export",
    "console": f"{_HERE}.console:Console",
    "calibrate": f"{_HERE}.photographs:Calibrate",
    "look": f"{_HERE}.photographs:Look",
}
"""Where each command's class is: only the one that is called is imported."""
_LARGEST_WHOLE = 2**32 - 1
"""Of a whole number on the command line: numpy's and torch's largest common seed, and no sensible
size reaches it."""
_LONGEST = 1000
"""Characters of a message; ours: twelve lines of a terminal."""
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
    _open_streams()
    try:
        command = _parse(list(sys.argv[1:] if args is None else args))
        status = command.run() or 0
        return status if _flushed() else _NOBODY_READS
    except BrokenPipeError:
        if _flushed() and not _reader_left():  # not our output's pipe
            raise
        return _NOBODY_READS
    except PriorReinforceError as error:
        return _refuse(str(error), error)
    except ImportError as error:
        missing = missing_extra(error)
        if missing is None:
            raise
        return _refuse(str(missing), error)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        what = f"{where}{error.strerror or error}"
        return _refuse(f"{what}; check the path, its permissions and the room on the disk", error)
    except (MemoryError, RecursionError) as error:
        return _refuse(f"too much for this machine ({error or 'no memory'}); give less", error)
    except KeyboardInterrupt as error:
        _complain(f"interrupted{f'; {error}' if error.args else ''}")
        return 130


def _parse(args: list[str]) -> Command:
    """Make the command that was called; all of them are imported only to list them."""
    name = args[0] if args else ""
    with _in_one_line():
        if name in COMMANDS:
            kind = pkgutil.resolve_name(COMMANDS[name])
            command: Command = tyro.cli(kind, prog=f"prior-reinforce {name}", args=args[1:])
        else:
            kinds = {name: pkgutil.resolve_name(target) for name, target in COMMANDS.items()}
            command = tyro.extras.subcommand_cli_from_dict(
                kinds,
                prog="prior-reinforce",
                description="Hit a goal a robot arm has never hit, in about ten trials "
                "(simulated so far).",
                args=args,
            )
    _check_values(command)
    return command


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Say in one line what is wrong with a command line; tyro draws a box.

    Raises:
        ConfigurationError: It is wrong.
    """
    box = io.StringIO()
    try:
        with redirect_stderr(box):
            yield
    except SystemExit as end:
        if end.code != 2:
            raise
        words = re.sub(r"\u256d.*|[\u2502\u2570\u256f\s]+", " ", box.getvalue())
        parts = [" ".join(part.split()) for part in re.split("\u2500+", words)]
        said = [part for part in parts if part and "helptext:" not in part]
        raise ConfigurationError("; ".join(said) or "wrong; see --help") from None
    except (ValueError, OverflowError) as error:  # numbers of hundreds of digits
        raise ConfigurationError(f"cannot read the command line ({error}); see --help") from error
    else:
        sys.stderr.write(box.getvalue())


def _check_values(given: object, name: str = "") -> None:
    """Refuse numbers that no seed, number of trials or size can be, and paths that move the cursor.

    Raises:
        ConfigurationError: One is given.
    """
    if is_dataclass(given):
        for each in fields(given):
            _check_values(getattr(given, each.name), each.name)
    elif isinstance(given, tuple):
        for each in given:
            _check_values(each, name)
    elif isinstance(given, Path):
        if any(unicodedata.category(char) == "Cc" for char in str(given)):
            raise ConfigurationError(f"the path {given} holds control characters; rename it")
    elif isinstance(given, int):
        low = 0 if name == "seed" else -_LARGEST_WHOLE
        if not low <= given <= _LARGEST_WHOLE:
            shown = f"{given}" if abs(given) < 10**30 else "a number of many digits"
            raise ConfigurationError(
                f"--{name.replace('_', '-')} must be a whole number from {low} to "
                f"{_LARGEST_WHOLE}, got {shown}"
            )


def _open_streams() -> None:
    """Have all three, closed or not, and able to print whatever a file is called."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None or stream.closed:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  (as long as the program)
        elif mode == "w" and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _refuse(message: str, error: BaseException) -> int:
    """Print why nothing more is done; the exit status says whether something was before."""
    changed = getattr(error, "changed", False)
    _complain(f"{message}{'; what was recorded before stays' if changed else ''}")
    try:
        sys.stdout.flush()
    except OSError:  # a full disk: what Python would still write when it exits goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1 if changed else 2


def _complain(message: str) -> None:
    """One line on standard error that can be read, whatever names and reasons hold."""
    line = plain(message)
    if len(line) > _LONGEST:  # what is wrong stands at the beginning, the remedy at the end
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 3 :]}"
    print(f"prior-reinforce: {line}", file=sys.stderr)


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


def _reader_left() -> bool:
    """Whether the other end of our output's pipe is closed; unbuffered, flushing says nothing."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    _complain(f"warning: {message}")


if __name__ == "__main__":
    sys.exit(main())
