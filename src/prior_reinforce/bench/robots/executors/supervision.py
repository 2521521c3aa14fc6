"""Starting the supervisor, showing what its command writes, and stopping it when we must leave."""

from __future__ import annotations

import codecs
import json
import os
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from prior_reinforce.bench.robots.executors.lock import GRACE, MARK, ExecutingLock, stop_marked
from prior_reinforce.errors import ConfigurationError

OUTPUT_FILE, ENDED_FILE = "output.txt", "ended.json"
"""In the result folder: what the command wrote, and how it ended."""
_SUPERVISOR = Path(__file__).with_name("supervisor.py")
_LOOK = 0.02
"""How often the supervisor is looked at, in [s]."""
# Ctrl-Z too: who presses it wants the arm to stop, and it would not.
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


class Interruptions:
    """Signals that would end or stop this program, noted while it may not end.

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


def supervise(
    arguments: tuple[str, ...],
    folder: Path,
    *,
    time_limit: float,
    interruptions: Interruptions,
    lock: ExecutingLock | None = None,
    show: Callable[[str], None] | None = None,
) -> tuple[dict[str, Any] | None, BaseException | None]:
    """Run a command under the supervisor until all that it started has ended.

    Returns:
        What the supervisor wrote, None where it was killed; and what was raised meanwhile, by
        `show` or a signal's handler, which stopped the command.

    Raises:
        ConfigurationError: The system starts nothing; nothing has run.
    """
    descriptors, names = ((), ()) if lock is None else (lock.descriptors, lock.names)
    run, raised, supervisor, asked = f"run-{uuid.uuid4().hex}", None, None, False
    with (
        _named_refusal(lambda: supervisor is None),
        (folder / OUTPUT_FILE).open("wb+", buffering=0) as output,
        (folder / ENDED_FILE).open("wb+", buffering=0) as ended,
        (folder / OUTPUT_FILE).open("rb") as to_show,
    ):
        shown = _Shown(to_show, show)
        request = {
            "arguments": arguments,
            "time_limit": time_limit,
            "grace": GRACE,
            "keep_open": descriptors,
            "output": output.fileno(),
            "ended": ended.fileno(),
        }
        while True:
            try:
                if supervisor is None:
                    with _blocked_signals():
                        supervisor = subprocess.Popen(
                            [sys.executable, "-I", "-S", str(_SUPERVISOR), json.dumps(request)],
                            pass_fds=(*descriptors, output.fileno(), ended.fileno()),
                            env=os.environ | {MARK: " ".join((*names, run))},
                        )
                while supervisor.poll() is None:
                    # Who stops a workspace finds nothing to stop if this begins just then.
                    revoked = lock is not None and lock.revoked()
                    if (interruptions.came or revoked or raised is not None) and not asked:
                        supervisor.send_signal(signal.SIGTERM)
                        asked = True
                    time.sleep(_LOOK)
                    shown.go_on()
                # Nobody is left who would stop them, unless the supervisor ended as it should.
                stop_marked(run, 2 * GRACE)
                shown.go_on()
                break
            except BaseException as error:
                if supervisor is None:
                    raise
                # Whatever it is, the arm moves: it stops before anybody hears of it.
                raised = raised or error
                shown.show = None
        ended.seek(0)
        written = ended.read()
    return (json.loads(written) if written.endswith(b"}") else None), raised


@contextmanager
def _named_refusal(nothing_ran: Callable[[], bool]) -> Iterator[None]:
    """Turn what the system refuses before anything is started into one line."""
    try:
        yield
    except OSError as error:
        if not nothing_ran():  # a disk that fails later says nothing of the arm
            raise
        raise ConfigurationError(
            f"nothing can be started ({error.strerror}); close other programs, or make room"
        ) from error


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
        text = self._decoder.decode(self._file.read())
        if text and self.show is not None:
            try:
                self.show(text)
            except OSError:
                self.show = None
