"""A program that runs one command and ends only after everything that the command started has.

    python supervisor.py REQUEST

Whoever moves the arm with it may be interrupted, killed or stopped: this process goes on, and with
it the lock that it inherited. It adopts what detaches itself (Linux' child subreaper), so that a
driver in the background, in a session of its own or orphaned is waited for like any other. It takes
every signal that can be taken as the wish to stop: SIGTERM to all, SIGKILL to what is left after a
grace period, however often it is asked.

It is two processes: one that runs the command, and its parent, the guard, which adopts and stops
what is left where the first is killed. Where both are, the lock stays with the command, which has
inherited it too, or is found by its mark (`lock.py`).

REQUEST is JSON: `arguments` of the command, `time_limit` and `grace` in [s], `keep_open`
(descriptors that the command inherits), `output` and `ended` (descriptors of files for what it
writes, and for how it ended). It imports nothing but the standard library, so that it starts fast
and cannot fail by what is installed.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import select
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

_SET_CHILD_SUBREAPER, _SET_PARENT_DEATH_SIGNAL = 36, 1  # linux/prctl.h
_STOPS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGTSTP)
# A terminal sends these to all that it knows. The command is asked to stop by SIGTERM instead, as
# its time limit does: one that knows only that signal would be cut off by Ctrl-C in mid-swing.
_TERMINALS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTSTP)
_LOOK = 0.02
"""How often it looks for output, ends and deadlines, in [s]."""
_TAIL_BYTES = 4000
"""Of its output in what says how it ended: the last screenful, where a driver says why."""
_MOST_BYTES = 16_000_000
"""Kept of its output; ours: hours of talk, and no full disk by a driver that runs wild."""
_SAY_AFTER = 1.0
"""After the command's end, in [s], what still runs is named."""


def main(request: dict[str, Any]) -> None:
    """Run the command; write how it ended."""
    # A terminal of its own for the output: programs write to one line by line.
    master, slave = os.openpty()
    tty.setraw(slave)
    output = _Output(master, request["output"])
    runner = os.fork()
    if runner == 0:
        _run(request, output, slave)
        return
    os.close(slave)
    _adopt_and_hear(lambda number, _: _send(runner, number))
    if os.waitpid(runner, 0)[1] != 0:  # killed
        for number in _STOPS:
            signal.signal(number, signal.SIG_IGN)
        _see_out(output, request, 0, [signal.SIGTERM])


def _run(request: dict[str, Any], output: _Output, slave: int) -> None:
    stop_asked: list[int] = []
    libc = _adopt_and_hear(lambda number, _: stop_asked.append(number))

    def in_the_child() -> None:
        for number in _TERMINALS:
            signal.signal(number, signal.SIG_IGN)
        libc.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)

    try:
        # Kept: where nothing holds it, Python itself takes the status of what has ended already.
        process = subprocess.Popen(
            request["arguments"],
            stdout=slave,
            stderr=slave,
            pass_fds=request["keep_open"],
            preexec_fn=in_the_child,
        )
        os.close(slave)
        report = _see_out(output, request, process.pid, stop_asked)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        report = {"started": False, "error": str(error)}
    with contextlib.suppress(OSError):  # on a full disk, a person has to say how it ended
        os.write(request["ended"], json.dumps(report).encode())
        os.fsync(request["ended"])


def _adopt_and_hear(hear: Callable[[int, Any], object]) -> ctypes.CDLL:
    """Become the parent of what descendants leave, and take every wish to stop."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "cannot adopt what a command detaches")
    for number in _STOPS:
        signal.signal(number, hear)
    # What started us blocked them all, so that none came too early.
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    return libc


def _see_out(
    output: _Output, request: dict[str, Any], command: int, stop_asked: list[int]
) -> dict[str, Any]:
    """Wait for all descendants, stop them where that is asked or it is time; how it went."""
    start = time.monotonic()
    status, since, left, unstoppable = 0, 0.0, "", ""
    kill_at: float | None = None
    report: dict[str, Any] = {"started": True, "timed_out": False, "interrupted": False}
    while True:
        output.take(_LOOK)
        try:
            while (ended := os.waitpid(-1, os.WNOHANG))[0] != 0:
                if ended[0] == command:
                    status, since = os.waitstatus_to_exitcode(ended[1]), time.monotonic()
        except ChildProcessError:
            break  # whatever loses its parent becomes our child: nothing is left
        now = time.monotonic()
        if since and not left and kill_at is None and now > since + _SAY_AFTER:
            left = _names(_descendants())
            output.say(f"the command ended, but what it started still runs: {left}; waiting\n")
        if kill_at is None and (stop_asked or now > start + request["time_limit"]):
            report["interrupted" if stop_asked else "timed_out"] = True
            kill_at = now + request["grace"]
            running = _descendants()
            if since:
                left = _names(running)
            # Once: what they start to come to rest may do its work. SIGCONT is for one that waits
            # for a terminal.
            deaf = {
                pid: name
                for pid, name in running.items()
                if not (_send(pid, signal.SIGTERM) and _send(pid, signal.SIGCONT))
            }
            if deaf:
                unstoppable = _names(deaf)
                output.shout(
                    f"CANNOT STOP {unstoppable}: it runs as another user. THE ARM MAY GO ON "
                    "MOVING: use its stop button\n"
                )
        if kill_at is not None and now > kill_at:
            for pid in _descendants():
                _send(pid, signal.SIGKILL)
    output.take_rest()
    return report | {
        "exit_status": status,
        "seconds": (since or time.monotonic()) - start,
        "left_running": left,
        "unstoppable": unstoppable,
        "output_tail": output.tail.decode(errors="replace"),
    }


class _Output:
    """What the command and all that it started write."""

    def __init__(self, master: int, file: int) -> None:
        self._master, self._file, self._written = master, file, 0
        self.tail = b""

    def take(self, seconds: float) -> bool:
        """Take what comes within a time; False where nobody can write any more."""
        if not select.select([self._master], [], [], seconds)[0]:
            return True
        try:
            content = os.read(self._master, 65536)
        except OSError:  # Linux says so when the last writer has closed it
            time.sleep(seconds)
            return False
        self._keep(content)
        return bool(content)

    def take_rest(self) -> None:
        """Take what was written and not read yet."""
        while select.select([self._master], [], [], 0)[0] and self.take(0.0):
            pass

    def say(self, text: str) -> None:
        """Words of our own among its output."""
        self._keep(f"prior-reinforce: {text}".encode())

    def shout(self, text: str) -> None:
        """The same, and to the terminal at once, whether or not somebody shows the output."""
        self.say(text)
        with contextlib.suppress(OSError):
            os.write(2, f"\aprior-reinforce: {text}".encode())

    def _keep(self, content: bytes) -> None:
        self.tail = (self.tail + content)[-_TAIL_BYTES:]
        if self._written < _MOST_BYTES:
            self._written += len(content)
            with contextlib.suppress(OSError):  # a full disk stops no motion
                os.write(self._file, content)


def _descendants() -> dict[int, str]:
    """Names of the processes that descend from this one, by their number."""
    parents: dict[int, tuple[int, str]] = {}
    for entry in os.listdir("/proc"):
        if entry.isdecimal():
            with contextlib.suppress(OSError):
                text = Path("/proc", entry, "stat").read_text(errors="replace")
                name, _, rest = text.partition("(")[2].rpartition(")")
                parents[int(entry)] = int(rest.split()[1]), name
    found: dict[int, str] = {}
    here = os.getpid()
    for pid, (ancestor, name) in parents.items():
        for _ in parents:  # no longer than all of them, though they change while we read
            if ancestor == here or ancestor not in parents:
                break
            ancestor = parents[ancestor][0]
        if ancestor == here:
            found[pid] = name
    return found


def _names(processes: dict[int, str]) -> str:
    return ", ".join(f"{name} ({pid})" for pid, name in sorted(processes.items()))


def _send(pid: int, number: int) -> bool:
    """Send a signal; False where that is not allowed."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass
    except PermissionError:
        return False
    return True


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
