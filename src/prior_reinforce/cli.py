"""The `prior-reinforce` command: parse to a dataclass, call once, print.

Each command is a class in `commands/`, which lists them; only the one that is called is imported,
and what reads its options: `--version` and `--help` answer at once.
What a user did wrong is one line on standard error and exit status 2.
"""

from __future__ import annotations

import io
import os
import re
import select
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from dataclasses import fields, is_dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Protocol, TypeVar

import prior_reinforce
from prior_reinforce.commands import COMMANDS, GROUPS, complain, warn
from prior_reinforce.errors import ConfigurationError, PriorReinforceError
from prior_reinforce.extras import missing_extra
from prior_reinforce.registry import load_plugins


class Command(Protocol):
    """A parsed command line."""

    def run(self) -> int | None:
        """Do it; the exit status, None for 0."""


AnyCommand = TypeVar("AnyCommand", bound=Command)

_QUIET = {"-q", "--quiet"}
_TRACEBACK = "--traceback"
_PLUGINS = "--plugins"
_COMPLETION = ("--tyro-print-completion", "--tyro-write-completion")
_LARGEST_WHOLE = 2**32 - 1
"""Of a whole number on the command line: numpy's and torch's largest common seed, and no sensible
size reaches it."""
_EMPTY_DEFAULT = re.compile(
    r"(?:\x1b\[\d+m)*\(default:(?:[\s\u2502]|\x1b\[\d*m)*(?:None|True|False|)\)(?:\x1b\[\d*m)*"
)
_ONLY_BLANKED = re.compile(r"(?:[ \u2502]|\x1b\[\d*m)*\0(?:[\0 \u2502]|\x1b\[\d*m)*$")
_HELP = """\
usage: prior-reinforce [-h] [-V] [-q] COMMAND ...

Hit a goal a robot arm has never hit, in about ten trials (simulated so far).

{commands}
WORKSPACE may be left out within its folder, and TRIAL for the one that waits.
-q, --quiet prints warnings and errors only; -V, --version the version.
--plugins MODULE (or the variable PRIOR_REINFORCE_PLUGINS) imports a module that registers classes
of your own; --traceback shows where an error was raised.
examples: prior-reinforce COMMAND --help"""
_NOBODY_READS = 141
"""Exit status where the reader of our output left before the end: a shell's for SIGPIPE (128 + 13),
since what the command still had to do was not done."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one command; its exit status, see `run`."""
    return run(_parse, args)


def run(parse: Callable[[list[str]], Command | None], args: Sequence[str] | None = None) -> int:
    """Run a program of commands: parse a line, call once, say what went wrong.

    `args` are the command line without the program's name, the process's own if None. What `parse`
    makes of them is called; None where there is nothing more to do. The exit status is 0 if done, 1
    if not all of it, 2 for wrong input by which nothing changed, 130 if interrupted, 141 if nobody
    read on.
    """
    warnings.showwarning = warn
    _open_streams()
    shown = _TRACEBACK in (sys.argv[1:] if args is None else args)
    try:
        given = list(sys.argv[1:] if args is None else args)
        load_plugins(*_take_plugins(given))
        quiet = bool(_QUIET & {*given})
        command = parse([arg for arg in given if arg not in {*_QUIET, _TRACEBACK}])
        # JSON is printed though everything else is not.
        nowhere = quiet and not getattr(command, "json", False)
        with redirect_stdout(io.StringIO()) if nowhere else nullcontext():
            status = (command.run() or 0) if command is not None else 0
        return status if _flushed() else _NOBODY_READS
    except BrokenPipeError:
        if _flushed() and not _reader_left():  # not our output's pipe
            raise
        return _NOBODY_READS
    except PriorReinforceError as error:
        return _refuse(str(error), error, shown)
    except ImportError as error:
        missing = missing_extra(error)
        if missing is None:
            raise
        return _refuse(str(missing), error, shown)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        what = f"{where}{error.strerror or error}"
        what += "; check the path, its permissions and the room on the disk"
        return _refuse(what, error, shown)
    except (MemoryError, RecursionError) as error:
        what = f"too much for this machine ({error or 'no memory'}); give less"
        return _refuse(what, error, shown)
    except KeyboardInterrupt as error:
        complain(f"interrupted{f'; {error}' if error.args else ''}")
        return 130


def _parse(args: list[str]) -> Command | None:
    """Make the command that was called; None where only help or the version was asked for."""
    name = args[0] if args else "--help"
    if name in ("-h", "--help"):
        print(_help())
        return None
    if name in ("-V", "--version"):
        print(f"prior-reinforce {prior_reinforce.__version__}")
        return None
    if name in _COMPLETION:
        import tyro

        kinds = {name: resolve_name(target) for name, target in COMMANDS.items()}
        with _without_line_breaks():
            tyro.extras.subcommand_cli_from_dict(kinds, prog="prior-reinforce", args=args)
    if name not in COMMANDS:
        kind = "option" if name.startswith("-") else "command"
        raise ConfigurationError(
            f"there is no {kind} {name}{_suggested(name, [*COMMANDS, '--help', '--version'])}; "
            "prior-reinforce --help lists them all"
        )
    return read(resolve_name(COMMANDS[name]), f"prior-reinforce {name}", args[1:])


def read(kind: type[AnyCommand], program: str, args: list[str]) -> AnyCommand:
    """Make one command of what was typed after the program's name, which help and messages say.

    ConfigurationError for an option that it does not have, or a value that cannot be.
    """
    import tyro

    # Else the usage lacks the words that are there already.
    rest = ["--help"] if {"-h", "--help"} & {*args} else args
    with _in_one_line(program), _without_line_breaks():
        command = tyro.cli(
            kind,
            prog=program,
            args=rest,
            config=(tyro.conf.DisallowNone, tyro.conf.FlagCreatePairsOff),
        )
    _check_values(command)
    _refuse_twice(command, [arg.partition("=")[0].replace("_", "-") for arg in args])
    return command


def _take_plugins(args: list[str]) -> list[str]:
    """Take every `--plugins MODULE` out of a command line, and return the modules.

    ConfigurationError if the last one names none.
    """
    modules = []
    while _PLUGINS in args:
        at = args.index(_PLUGINS)
        if at + 1 == len(args):
            raise ConfigurationError(f"{_PLUGINS} needs a module; write {_PLUGINS} MODULE")
        modules.append(args[at + 1])
        del args[at : at + 2]
    return modules


def _help() -> str:
    """All commands, by what they are for."""
    groups = []
    for group, commands in GROUPS.items():
        lines = [f"  {name:<12}{what}" for name, (_, what) in commands.items()]
        groups += [f"{group}:", *lines, ""]
    return _HELP.format(commands="\n".join(groups))


def _suggested(word: str, known: Iterable[str]) -> str:
    import difflib

    closest = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean {closest[0]}?" if closest else ""


@contextmanager
def _in_one_line(program: str) -> Iterator[None]:
    """Say in one line what is wrong with a command line; tyro draws a box. Help is shown tidied.

    ConfigurationError if it is wrong.
    """
    box, shown = io.StringIO(), io.StringIO()
    shown.isatty = sys.stdout.isatty  # type: ignore[method-assign]
    try:
        with redirect_stderr(box), redirect_stdout(shown):
            yield
    except SystemExit as end:
        if end.code != 2:
            print(_tidied(shown.getvalue()), end="")
            raise
        if found := re.search(r"Unrecognized options: ([^\s,]+)", box.getvalue()):
            known = re.findall(r"(?<![\w-])--[a-z][\w-]*", box.getvalue()[found.end() :])
            raise ConfigurationError(
                f"{program} has no {found[1]}{_suggested(found[1], known)}; see {program} --help"
            ) from None
        words = re.sub(r"\u256d.*|[\u2502\u2570\u256f\s]+", " ", box.getvalue())
        parts = [" ".join(part.split()) for part in re.split("\u2500+|-{9,}", words)]
        said = [part for part in parts if part and "helptext:" not in part]
        raise ConfigurationError("; ".join(said) or "wrong; see --help") from None
    except (ValueError, OverflowError) as error:  # numbers of hundreds of digits
        raise ConfigurationError(f"cannot read the command line ({error}); see --help") from error
    else:
        sys.stderr.write(box.getvalue())


@contextmanager
def _without_line_breaks() -> Iterator[None]:
    """Let tyro see descriptions of options in one line each.

    docstring_parser leaves later lines indented, and tyro then breaks lines there. At every call,
    not for help alone: tyro keeps what it has read of a class, and errors read it too.
    """
    import docstring_parser
    from docstring_parser import Docstring, DocstringStyle

    parse = docstring_parser.parse_from_object

    def joined(obj: object, style: DocstringStyle = DocstringStyle.AUTO) -> Docstring:
        parsed = parse(obj, style)
        for option in parsed.params:
            option.description = " ".join((option.description or "").split())
        return parsed

    docstring_parser.parse_from_object = joined
    try:
        yield
    finally:
        docstring_parser.parse_from_object = parse


def _tidied(shown: str) -> str:
    """Help in its box, without defaults that say nothing, such as `(default: None)`."""
    blanked = _EMPTY_DEFAULT.sub(lambda said: re.sub(r"[^\s\u2502]", "\0", said[0]), shown)
    lines = [line for line in blanked.splitlines(keepends=True) if not _ONLY_BLANKED.match(line)]
    return "".join(lines).replace("\0", " ")


def _refuse_twice(given: object, said: Sequence[str]) -> None:
    """Refuse an option of several values that was said twice: tyro keeps the last alone.

    ConfigurationError if one was.
    """
    for each in fields(given) if is_dataclass(given) else ():
        value, option = getattr(given, each.name), f"--{each.name.replace('_', '-')}"
        _refuse_twice(value, said)
        several = isinstance(value, tuple) and "UseAppendAction" not in str(each.type)
        if several and said.count(option) > 1:
            raise ConfigurationError(f"{option} is given twice; put all its values behind one")


def _check_values(given: object, name: str = "") -> None:
    """Refuse numbers that no seed, number of trials or size can be, and paths that move the cursor.

    ConfigurationError if one is given.
    """
    if is_dataclass(given):
        for each in fields(given):
            _check_values(getattr(given, each.name), each.name)
    elif isinstance(given, tuple):
        for each in given:
            _check_values(each, name)
    elif isinstance(given, Path):
        from prior_reinforce.files import check_path

        check_path(given)
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


def _refuse(message: str, error: BaseException, traceback_too: bool) -> int:
    """Print why nothing more is done; the exit status says whether something was before."""
    if traceback_too:
        traceback.print_exception(error)
    changed = getattr(error, "changed", False)
    complain(f"{message}{'; what was recorded before stays' if changed else ''}")
    try:
        sys.stdout.flush()
    except OSError:  # a full disk: what Python would still write when it exits goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1 if changed else 2


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


if __name__ == "__main__":
    sys.exit(main())
