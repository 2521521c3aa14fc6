"""Starting the supervisor, showing what its command writes, and stopping it when we must leave."""

from __future__ import annotations

import codecs
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import msgspec

from prior_reinforce.arm.executing.lock import GRACE, MARK, ExecutingLock, stop_marked
from prior_reinforce.arm.executing.supervisor import BUTTON, LOOK, shout
from prior_reinforce.errors import ConfigurationError

OUTPUT_FILE, ENDED_FILE = "output.txt", "ended.json"
"""In the result folder: what the command wrote, and how it ended."""
_SUPERVISOR = Path(__file__).with_name("supervisor.py")
_SILENT = 0.5
"""After so long without a word, in [s], the supervisor is woken; ours: 25 of its looks."""
# Ctrl-Z too: who presses it wants the arm to stop, and it would not.
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


class Interruptions:
    """What would end or stop this program, kept until the end of a `with` block, which raises it.

    Signals are kept in the main thread; in another thread none arrive.
    """

    def __init__(self) -> None:
        """None came yet."""
        self.came = False
        """Whether a signal came; a KeyboardInterrupt is then raised."""
        self.raised: BaseException | None = None
        """What was raised while something moved, by `show` or a signal's handler."""
        self.said = ""
        """What became of what moved, for the KeyboardInterrupt."""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruptions:
        """Note them from now on."""
        if threading.current_thread() is threading.main_thread():
            for number in _STOPS:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        """Let them through again, and raise what came, unless the block raises something else."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if kind is None and self.raised is not None:
            raise self.raised
        if kind is None and self.came:
            raise KeyboardInterrupt(*filter(None, [self.said]))

    def _note(self, *_: object) -> None:
        self.came = True


class Ended(msgspec.Struct, frozen=True):
    """How a command ended, as its supervisor writes it down."""

    not_started: str = ""
    """Why nothing was started; nothing else is said then."""
    exit_status: int | None = None
    """Of the command, where it was started."""
    seconds: float = 0.0
    timed_out: bool = False
    interrupted: bool = False
    left_running: str = ""
    """What still ran after the command's end when all was stopped."""
    unstoppable: str = ""
    """What runs as another user and could not be."""
    fault: str = ""
    """Why watching it failed, which stopped it."""
    output_tail: str = ""


def read_ended(file: IO[bytes]) -> Ended | None:
    """Read how a command ended; None where its supervisor could not write it down."""
    try:
        file.seek(0)
        ended = msgspec.json.decode(file.read(), type=Ended)
    except (OSError, ValueError):
        return None
    return ended if ended.not_started or ended.exit_status is not None else None


def supervise(
    arguments: tuple[str, ...],
    folder: Path,
    *,
    time_limit: float,
    interruptions: Interruptions,
    lock: ExecutingLock | None = None,
    show: Callable[[str], None] | None = None,
) -> Ended | None:
    """Run a command under the supervisor until all that it started has ended.

    Returns what the supervisor wrote; None where it could not. What is raised meanwhile, by `show`
    or a signal's handler, stops it and is in `interruptions`. ConfigurationError if the system
    starts nothing; what a signal's handler raises before anything has run is raised.
    """
    with ExitStack() as stack:
        try:
            supervised = _Supervised(arguments, folder, time_limit, lock, show, stack)
        except OSError as error:
            raise ConfigurationError(
                f"nothing can be started ({error.strerror}); close other programs, or make room"
            ) from error
        supervised.watch(interruptions)
        return supervised.ended


class _Supervised:
    """A command under its supervisor, watched from here."""

    def __init__(
        self,
        arguments: tuple[str, ...],
        folder: Path,
        time_limit: float,
        lock: ExecutingLock | None,
        show: Callable[[str], None] | None,
        stack: ExitStack,
    ) -> None:
        """Start the supervisor, which waits for our word: if this raises, nothing is started."""
        self._lock, self._time_limit, self._run = lock, time_limit, f"run-{uuid.uuid4().hex}"
        descriptors, names = ((), ()) if lock is None else (lock.descriptors, lock.names)
        output = stack.enter_context((folder / OUTPUT_FILE).open("wb", buffering=0))
        self._ended = stack.enter_context((folder / ENDED_FILE).open("wb+", buffering=0))
        self._shown = _Shown(stack.enter_context((folder / OUTPUT_FILE).open("rb")), show)
        self._channel, theirs = map(stack.enter_context, socket.socketpair())
        request = {
            "arguments": arguments,
            "time_limit": time_limit,
            "grace": GRACE,
            "keep_open": descriptors,
            "output": output.fileno(),
            "ended": self._ended.fileno(),
            "channel": theirs.fileno(),
        }
        with _blocked_signals():
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", str(_SUPERVISOR), json.dumps(request)],
                pass_fds=(*descriptors, output.fileno(), self._ended.fileno(), theirs.fileno()),
                env=os.environ | {MARK: " ".join((*names, self._run))},
            )
        theirs.close()
        self._heard, self._due, self._stop_since = time.monotonic(), math.inf, math.inf
        self._ready = self._begun = self._asked = self._told = False

    @property
    def ended(self) -> Ended | None:
        """What the supervisor wrote; None where it could not."""
        if not self._begun:
            why = "it was stopped before it began" if self._asked else "its supervisor cannot start"
            return read_ended(self._ended) or Ended(not_started=why, interrupted=self._asked)
        return read_ended(self._ended)

    def watch(self, interruptions: Interruptions) -> None:
        """Let it begin, and see that it ends; whatever is raised stops it first."""
        while True:
            try:
                if self._look(interruptions):
                    return
            except BaseException as error:
                # Whatever it is, the arm moves: it stops before anybody hears of it.
                interruptions.raised = interruptions.raised or error
                self._shown.show = None

    def _look(self, interruptions: Interruptions) -> bool:
        """Ask it to stop where that is due, and show what came; whether all has ended."""
        now = time.monotonic()
        with suppress(OSError):  # nothing came, or it is gone
            if self._channel.recv(4096, socket.MSG_DONTWAIT):
                self._ready, self._heard = True, now
        # Who stops a workspace finds nothing to stop if this begins just then.
        if not self._asked and (
            interruptions.raised is not None
            or interruptions.came
            or (self._lock is not None and self._lock.revoked())
        ):
            self._asked, self._due = True, now
            self._wake(signal.SIGTERM)
        elif self._ready and not self._begun and not self._asked:
            self._begun, self._due = True, now + self._time_limit
            try:
                self._channel.send(b"!")
            except OSError:  # it is gone
                self._begun = False
        silent = now - self._heard
        if silent > _SILENT:
            self._wake()
        if self._process.poll() is not None:
            self._stop_marked(now)  # nothing is left, if it ended as it should
            self._shown.go_on()
            return True
        if silent > 2 * GRACE and now > self._due + 2 * GRACE:
            self._tell("what watches over the command does not answer; all of it is being stopped")
            self._stop_marked(now)
        time.sleep(LOOK)
        self._shown.go_on()
        return False

    def _wake(self, *numbers: int) -> None:
        """Signal the supervisor, which somebody may have stopped (SIGSTOP)."""
        if self._process.returncode is None:
            for number in (*numbers, signal.SIGCONT):
                with suppress(ProcessLookupError):
                    os.kill(self._process.pid, number)

    def _stop_marked(self, now: float) -> None:
        self._stop_since = min(self._stop_since, now)
        try:
            stop_marked(self._run, self._stop_since + GRACE)
        except ConfigurationError as error:
            self._tell(f"CANNOT FIND what the command started ({error})")
            self._wake(signal.SIGKILL)  # with it, the command is asked to stop

    def _tell(self, text: str) -> None:
        if not self._told:
            self._told = True
            shout(f"{text}. {BUTTON}")


@contextmanager
def _blocked_signals() -> Iterator[None]:
    """Keep signals from us until we know the child, and from it until it is ready for them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Shown:
    """A file's text, shown as the file grows."""

    def __init__(self, file: IO[bytes], show: Callable[[str], None] | None) -> None:
        self.show, self._file = show, file
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")

    def go_on(self) -> None:
        """Show what came; a reader that left, or a full disk, ends no motion."""
        if self.show is not None:
            try:
                if text := self._decoder.decode(self._file.read()):
                    self.show(text)
            except OSError:
                self.show = None
