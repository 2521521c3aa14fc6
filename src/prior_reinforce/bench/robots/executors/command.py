"""Executing a plan by a command: whatever drives the arm, in processes of its own.

Bindings of robot libraries exclude each other in one process, and the session must outlive a
driver that crashes or hangs; so the plan's file is given to a command. A supervisor
(`supervisor.py`) runs it and lives until everything that the command started has ended, whatever
becomes of this program.
"""

from __future__ import annotations

import codecs
import contextlib
import json
import math
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

from prior_reinforce.bench.robots.executors.result import (
    NOT_MOVED_STATUS,
    DriverResult,
    Outcome,
    read_driver_result,
)
from prior_reinforce.bench.robots.plan_files import PlanFile
from prior_reinforce.errors import ConfigurationError, FileFormatError

PLAN, RESULT = "{plan}", "{result}"
"""What stands in a command for the plan's file, and for the folder of what the driver says."""
_SUPERVISOR = Path(__file__).with_name("supervisor.py")
_OUTPUT_FILE, _ENDED_FILE = "output.txt", "ended.json"
_GRACE = 2.0
"""Between asking a command to stop and killing it, in [s]: time to bring an arm to rest."""
_LOOK = 0.02
"""How often the supervisor is looked at, in [s]."""
_SECRET = re.compile(
    r"((?:^|(?<=[\s\-_]))[\w-]*(?:password|passwd|passphrase|secret|token|api[-_]?key)[=:\s]\s*)"
    r"(?:'[^']*'|\"[^\"]*\"|\S+)",
    re.IGNORECASE,
)
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class CommandResult:
    """How a command that was given a plan ended."""

    command: tuple[str, ...]
    """Program and arguments as they were started."""
    exit_status: int
    """Status the command ended with; minus the signal's number if a signal ended it."""
    timed_out: bool
    """Whether it was stopped at its time limit. The arm may have moved."""
    seconds: float
    """How long it ran."""
    output_tail: str
    """The end of what it wrote to its output and error streams, in order."""
    interrupted: bool = False
    """Whether it was stopped by a signal (Ctrl-C). The arm may have moved."""
    outcome: Outcome = "done"
    """What became of the motion: what the driver says, unless how it ended says otherwise."""
    reason: str = ""
    """Why it was not done."""
    start_error: float | None = None
    """What the driver says of its distance from the plan's first frame, in [rad]."""
    tracking_rms: float | None = None
    """What the driver says of its distance from the plan, root mean square, in [rad]."""

    @property
    def succeeded(self) -> bool:
        """Whether the plan was executed to its end."""
        return self.outcome == "done"

    def as_json(self) -> dict[str, Any]:
        """The same as plain data for the journal."""
        return asdict(self) | {"command": split_hidden(self.command)}


class Interruptions:
    """Signals that would end this program, noted while it may not end.

    Used in a `with` block of the main thread; in another thread none arrive.
    """

    def __init__(self) -> None:
        """None came yet."""
        self.came = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruptions:
        """Note them from now on."""
        if threading.current_thread() is threading.main_thread():
            for number in _STOPS:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Let them through again."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, *_: object) -> None:
        self.came = True


def split_command(command: str, plan: Path, result: Path = Path("result")) -> tuple[str, ...]:
    """Program and arguments, `{plan}` and `{result}` replaced by paths within one argument.

    The text is split as a shell would, but no shell ever sees it: nothing in a path can become a
    second command.

    Raises:
        ConfigurationError: Quotes that do not match, no program, or no `{plan}`.
    """
    arguments = _split(command)
    if not any(PLAN in argument for argument in arguments[1:]):
        raise ConfigurationError(
            f"the command {command!r} must name a program and hold {PLAN} where the plan's path "
            'goes, for instance "mycontroller {plan}"'
        )
    paths = {PLAN: str(plan.resolve()), RESULT: str(result.resolve())}
    for name, path in paths.items():
        arguments = [argument.replace(name, path) for argument in arguments]
    return tuple(arguments)


def hide_secrets(command: str) -> str:
    """A command without what looks like passwords, keys and tokens in it, for the journal."""
    command = re.sub(r"//[^/@\s]*@", "//***@", command)
    return _SECRET.sub(lambda found: f"{found[1]}***", command)


def split_hidden(command: Sequence[str]) -> list[str]:
    """The same for program and arguments, one by one."""
    return [
        "***" if before.startswith("-") and _SECRET.match(f"{before} x") else hide_secrets(word)
        for before, word in zip(("", *command), command, strict=False)
    ]


def check_command(command: str, *, time_limit: float) -> None:
    """Do nothing if a command and its limit could be used; arguments as in `run_command`.

    Raises:
        ConfigurationError: It cannot be split, names no program that can run, or lacks `{plan}`;
            the limit is not a positive number; or this is not Linux.
    """
    if not (math.isfinite(time_limit) and time_limit > 0):
        raise ConfigurationError(f"the time limit must be a positive number, got {time_limit} s")
    split_command(command, Path("plan"))
    _check_program(command)


def run_command(
    command: str,
    plan: PlanFile,
    *,
    time_limit: float,
    keep_open: tuple[int, ...] = (),
    folder: Path | None = None,
    show: Callable[[str], None] | None = None,
    interruptions: Interruptions | None = None,
) -> CommandResult:
    """Run `mycontroller {plan}` in processes of its own, and wait for all that it starts.

    At the time limit, and when this program is interrupted, the command and everything it started
    are asked to stop (SIGTERM), and killed two seconds later. The command has this program's
    standard input, so it can ask a person at the terminal. Nothing is held against a robot's
    limits: call `check_plan` before the plan is written.

    Args:
        command: Program and arguments, `{plan}` among them.
        plan: What is to be executed; its hash is checked first.
        time_limit: In [s].
        keep_open: File descriptors that the supervisor and the command inherit, so that a lock on
            them lasts as long as they run.
        folder: An empty folder for what the command writes, `{result}`; a temporary one if not
            given.
        show: Called with its output as it comes.
        interruptions: Signals that are noted by the caller; its own if not given.

    Raises:
        ConfigurationError: A command or a limit that cannot be used, or a program that cannot be
            started; nothing has run then.
        FileFormatError: The plan is no longer what its hash says; nothing has run.
        KeyboardInterrupt: Interrupted before anything ran; or later, once all has ended, where the
            caller notes no interruptions itself.
    """
    check_command(command, time_limit=time_limit)
    with contextlib.ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        own = interruptions is None
        noted = stack.enter_context(Interruptions()) if interruptions is None else interruptions
        arguments = split_command(command, plan.path, folder)
        plan.verify()
        if noted.came:
            raise KeyboardInterrupt
        ended = _supervise(arguments, folder, time_limit, keep_open, noted, show)
        if ended is not None and not ended["started"]:
            raise ConfigurationError(
                f"cannot start {arguments[0]!r} ({ended['error']}); give the path of a program "
                "that can run"
            )
        result = _result(arguments, ended, folder)
        if own and noted.came:
            raise KeyboardInterrupt
    return result


def read_ended(folder: Path, command: str) -> CommandResult | None:
    """How the command of a folder ended, where its supervisor wrote it down; None if it did not."""
    try:
        ended = json.loads((folder / _ENDED_FILE).read_bytes())
        return _result(tuple(_split(command)), ended, folder) if ended["started"] else None
    except (OSError, ValueError, KeyError, TypeError):
        return None  # a person has to say what moved


def read_pose(
    command: str, names: tuple[str, ...], *, time_limit: float = 10.0
) -> dict[str, float]:
    """Ask a command where the arm stands; it must move nothing.

    Args:
        command: Writes one line of JSON last: `{"joint1": 0.1, ...}`, or a list in the order of
            `names`.
        names: Of a plan's columns.
        time_limit: In [s].

    Returns:
        Position by column, for those that it names.

    Raises:
        ConfigurationError: It cannot be used, fails, or says something else.
    """
    _check_program(command)
    with tempfile.TemporaryDirectory() as folder, Interruptions() as noted:
        ended = _supervise(tuple(_split(command)), Path(folder), time_limit, (), noted, None)
    if noted.came:
        raise KeyboardInterrupt
    if ended is None or not ended["started"] or ended["timed_out"] or ended["exit_status"]:
        said = "" if ended is None else ended.get("error") or ended["output_tail"].strip()
        raise ConfigurationError(
            f"the command {command!r} did not say where the arm stands: "
            f"{said.splitlines()[-1] if said else 'no output'}; try it by itself"
        )
    try:
        said = json.loads(ended["output_tail"].strip().splitlines()[-1])
        pose = said if isinstance(said, dict) else dict(zip(names, said, strict=True))
        pose = {name: float(value) for name, value in pose.items() if name in names}
        if not pose or not all(map(math.isfinite, pose.values())):
            raise ValueError("no finite positions of the plan's columns")
    except (IndexError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ConfigurationError(
            f"the command {command!r} must end with a line of JSON such as "
            f'{{"{names[0]}": 0.1}}: {error}'
        ) from error
    return pose


def _split(command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise ConfigurationError(
            f"cannot split the command {command!r} ({error}); close its quotes"
        ) from error


def _check_program(command: str) -> None:
    if not sys.platform.startswith("linux"):
        raise ConfigurationError(
            "a command is run on Linux only, where all that it starts is found again; write the "
            "plan with --out and execute it yourself"
        )
    program = next(iter(_split(command)), "")
    if "\0" in command or shutil.which(program) is None:
        raise ConfigurationError(
            f"cannot start {program!r}; give the path of a program that can run"
        )


def _supervise(
    arguments: tuple[str, ...],
    folder: Path,
    time_limit: float,
    keep_open: tuple[int, ...],
    interruptions: Interruptions,
    show: Callable[[str], None] | None,
) -> dict[str, Any] | None:
    """Run a command under the supervisor; what that wrote, None where it was killed."""
    ended = folder / _ENDED_FILE
    with _named_refusal(), (folder / _OUTPUT_FILE).open("wb", buffering=0) as output:
        request = {
            "arguments": arguments,
            "time_limit": time_limit,
            "grace": _GRACE,
            "keep_open": keep_open,
            "output": output.fileno(),
            "ended": str(ended.resolve()),
        }
        program = [sys.executable, "-I", "-S", str(_SUPERVISOR), json.dumps(request)]
        with _blocked_signals():
            supervisor = subprocess.Popen(program, pass_fds=(*keep_open, output.fileno()))
    asked = False
    with (folder / _OUTPUT_FILE).open("rb") as written:
        shown = _Shown(written, show)
        while supervisor.poll() is None:
            if interruptions.came and not asked:
                asked = True
                supervisor.send_signal(signal.SIGTERM)
            time.sleep(_LOOK)
            shown.go_on()
        shown.go_on()
    return json.loads(ended.read_bytes()) if ended.exists() else None


@contextmanager
def _named_refusal() -> Iterator[None]:
    """Turn what the system refuses before anything is started into one line."""
    try:
        yield
    except OSError as error:
        raise ConfigurationError(
            f"nothing can be started ({error.strerror}); close other programs, or make room"
        ) from error


@contextmanager
def _blocked_signals() -> Iterator[None]:
    """Keep signals from a child until it is ready for them; a mask is inherited."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Shown:
    """A file's text, shown as the file grows."""

    def __init__(self, file: IO[bytes], show: Callable[[str], None] | None) -> None:
        self._file, self._show = file, show
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")

    def go_on(self) -> None:
        """Show what came; a reader that left, or a full disk, ends no motion."""
        text = self._decoder.decode(self._file.read())
        if text and self._show is not None:
            try:
                self._show(text)
            except OSError:
                self._show = None


def _result(
    arguments: tuple[str, ...], ended: dict[str, Any] | None, folder: Path
) -> CommandResult:
    """What became of a motion, from how its command ended and what the driver says."""
    if ended is None:
        why = "what watched over the command was killed"
        return CommandResult(arguments, 0, False, 0.0, "", outcome="unknown", reason=why)
    status = int(ended["exit_status"])
    try:
        said = read_driver_result(folder)
    except FileFormatError as error:
        said = DriverResult("aborted", str(error))
    outcome: Outcome = "done" if status == 0 else "aborted"
    reason = "" if status == 0 else f"the command ended with status {status}"
    if status == NOT_MOVED_STATUS:
        outcome, reason = "not_moved", "the command says that the arm did not move"
    if said is not None and status in (0, NOT_MOVED_STATUS):
        outcome, reason = said.outcome, said.reason
    elif said is not None and said.outcome != "done":
        outcome, reason = "aborted", said.reason or reason
    # Stopped, it may have moved since it wrote anything.
    if ended["timed_out"] or ended["interrupted"]:
        stopped = "at its time limit" if ended["timed_out"] else "by a signal"
        left = f"; still running were {ended['left_running']}" if ended["left_running"] else ""
        outcome, reason = "aborted", f"the command was stopped {stopped}{left}"
    return CommandResult(
        command=arguments,
        exit_status=status,
        timed_out=bool(ended["timed_out"]),
        seconds=float(ended["seconds"]),
        output_tail=str(ended["output_tail"]),
        interrupted=bool(ended["interrupted"]),
        outcome=outcome,
        reason=reason,
        start_error=None if said is None else said.start_error,
        tracking_rms=None if said is None else said.tracking_rms,
    )
