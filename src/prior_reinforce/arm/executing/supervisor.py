"""A program that runs one command and ends only after everything that the command started has.

    python supervisor.py REQUEST

Whoever moves the arm with it may be interrupted, killed or stopped: this process goes on, and with
it the lock that it inherited. It adopts what detaches itself (Linux' child subreaper), so that a
driver in the background, in a session of its own or orphaned is waited for like any other. It takes
every signal that can be taken as the wish to stop: SIGTERM to all, SIGKILL to what is left after a
grace period, however often it is asked.

Two processes watch the motion: this one and the program that started it (`supervision.py`). Where
this one is killed, hangs or is stopped (SIGSTOP), the program wakes it or stops the command; where
the program is, this one goes on. Where both are, the lock stays with the command, which has
inherited it too, or is found by its mark (`lock.py`).

Only what fails before the command is started has not moved the arm. Whatever system call fails
afterwards, everything is stopped, and what became of the motion is for a person to say.

REQUEST is JSON: `arguments` of the command, `time_limit` and `grace` in [s], `keep_open`
(descriptors that the command inherits), `output` and `ended` (descriptors of files for what it
writes, and for how it ended), and `channel`: a socket from which the word to begin comes, and into
which a byte is sent at every look. It imports nothing but the standard library, so that it starts
fast and cannot fail by what is installed.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
import tty
from pathlib import Path
from typing import Any

_SET_CHILD_SUBREAPER, _SET_PARENT_DEATH_SIGNAL = 36, 1  # linux/prctl.h
_STOPS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGTSTP)
# A terminal sends these to all that it knows. The command is asked to stop by SIGTERM instead, as
# its time limit does: one that knows only that signal would be cut off by Ctrl-C in mid-swing.
_TERMINALS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTSTP)
LOOK = 0.02
"""How often it looks for output, ends and deadlines, in [s]."""
_TAIL_BYTES = 4000
"""Of its output in what says how it ended: the last screenful, where a driver says why."""
_MOST_BYTES = 16_000_000
"""Kept of its output; ours: hours of talk, and no full disk by a driver that runs wild."""
_SAY_AFTER = 1.0
"""After the command's end, in [s], what still runs is named."""
BUTTON = "THE ARM MAY GO ON MOVING: use its stop button"


def main(request: dict[str, Any]) -> None:
    """Run the command; write how it ended."""
    stop_asked: list[int] = []
    try:
        watched = _start(request, stop_asked)
    except Exception as error:  # before anything moved, whatever it is
        report: dict[str, Any] = {"not_started": str(error) or repr(error)}
        report["interrupted"] = bool(stop_asked)
    else:
        report = watched.until_all_has_ended()
    with contextlib.suppress(OSError):  # on a full disk, a person has to say how it ended
        os.write(request["ended"], json.dumps(report).encode())
        os.fsync(request["ended"])


def _start(request: dict[str, Any], stop_asked: list[int]) -> _Watched:
    """Start the command, once we are told to; nothing has run if it raises."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "cannot adopt what a command detaches")
    for number in _STOPS:
        signal.signal(number, lambda number, _: stop_asked.append(number))
    # What started us blocked them all, so that none came too early.
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    # A terminal of its own for the output: programs write to one line by line.
    master, slave = os.openpty()
    tty.setraw(slave)
    output = _Output(master, request["output"])
    _descendants()  # what cannot be found could not be stopped
    channel = socket.socket(fileno=request["channel"])
    channel.send(b".")  # ready
    while not stop_asked and not select.select([channel], [], [], LOOK)[0]:
        pass
    if stop_asked or not channel.recv(1):
        raise InterruptedError("it was stopped before it began")
    us = os.getpid()

    def in_the_child() -> None:
        for number in _TERMINALS:
            signal.signal(number, signal.SIG_IGN)
        libc.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != us:
            os._exit(1)

    watched = _Watched(request, output, stop_asked, channel)
    try:
        # Kept: where nothing holds it, Python itself takes the status of what has ended already.
        watched.process = subprocess.Popen(
            request["arguments"],
            stdout=slave,
            stderr=slave,
            pass_fds=request["keep_open"],
            preexec_fn=in_the_child,
        )
        os.close(slave)
    except Exception as error:
        if _is_childless():
            raise
        watched.fail(error)  # after the start
    return watched


def _is_childless() -> bool:
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return True
    except OSError:  # who knows
        return False
    return False


class _Watched:
    """A command and all that it started."""

    def __init__(
        self,
        request: dict[str, Any],
        output: _Output,
        stop_asked: list[int],
        channel: socket.socket,
    ) -> None:
        """Nothing was started yet."""
        self.process: subprocess.Popen[bytes] | None = None
        self._output, self._stop_asked, self._channel = output, stop_asked, channel
        self._grace: float = request["grace"]
        self._start = time.monotonic()
        self._limit = self._start + request["time_limit"]
        self._status, self._ended = 0, 0.0
        self._kill_at: float | None = None
        self._asked: set[int] = set()
        self._all_asked = self._done = False
        self._report: dict[str, Any] = {
            "timed_out": False, "interrupted": False, "left_running": "", "unstoppable": "",
            "fault": "",
        }  # fmt: skip

    def until_all_has_ended(self) -> dict[str, Any]:
        """Wait for all descendants, stop them where that is asked or it is time; how it went."""
        while not self._done:
            self._look()
        with contextlib.suppress(Exception):  # nothing moves any more
            self._output.take_rest()
        return self._report | {
            "exit_status": self._status,
            "seconds": (self._ended or time.monotonic()) - self._start,
            "output_tail": self._output.tail.decode(errors="replace"),
        }

    def fail(self, error: Exception) -> None:
        """Stop everything, since watching it failed."""
        if not self._report["fault"]:
            self._report["fault"] = str(error) or repr(error)
            self._stop_asked.append(signal.SIGTERM)
            self._output.shout(f"the watch failed ({error}): the motion is being stopped")

    def _look(self) -> None:
        """Take output, ends and deadlines once."""
        failed: Exception | None = None
        for step in (self._output.take, self._take_ends, self._stop_when_due):
            try:
                step()
            except ChildProcessError:  # whatever loses its parent becomes our child
                self._done = True
                return
            except Exception as error:
                failed = error
                self.fail(error)
        if failed is None:
            with contextlib.suppress(OSError):  # who started us is gone, or does not look
                self._channel.send(b".", socket.MSG_DONTWAIT)
        elif self._kill_at is not None and time.monotonic() > self._kill_at + self._grace:
            self._output.shout(f"CANNOT STOP all that the command started ({failed}). {BUTTON}")
            self._done = True

    def _take_ends(self) -> None:
        while (ended := os.waitpid(-1, os.WNOHANG))[0] != 0:
            if self.process is None or ended[0] == self.process.pid:
                self._status, self._ended = os.waitstatus_to_exitcode(ended[1]), time.monotonic()

    def _stop_when_due(self) -> None:
        now, said = time.monotonic(), self._report
        if self._kill_at is None:
            if self._ended and not said["left_running"] and now > self._ended + _SAY_AFTER:
                said["left_running"] = left = _names(_descendants())
                self._output.say(
                    f"the command ended, but what it started still runs: {left}; waiting\n"
                )
            if not self._stop_asked and now <= self._limit:
                return
            said["interrupted" if self._stop_asked else "timed_out"] = True
            self._kill_at = now + self._grace
        if now > self._kill_at:
            self._send_to_all(signal.SIGKILL)
        elif not self._all_asked:
            # Once: what they start to come to rest may do its work. SIGCONT is for one that waits
            # for a terminal.
            running = self._send_to_all(signal.SIGTERM, signal.SIGCONT)
            self._all_asked = True
            if self._ended:
                said["left_running"] = _names(running)

    def _send_to_all(self, *numbers: int) -> dict[int, str]:
        """Send signals to all that runs, which is returned; but for SIGKILL, once to each.

        OSError if that cannot be found; the command gets them all the same.
        """
        error, running = None, {}
        try:
            running = _descendants()
        except OSError as cannot:
            error = cannot
            if self.process is not None and not self._ended:
                running = {self.process.pid: "the command"}
        deaf = {}
        for pid, name in running.items():
            if pid not in self._asked or numbers[0] == signal.SIGKILL:
                self._asked.add(pid)
                if not all([_send(pid, number) for number in numbers]):
                    deaf[pid] = name
        if deaf and not self._report["unstoppable"]:
            self._report["unstoppable"] = _names(deaf)
            self._output.shout(f"CANNOT STOP {_names(deaf)}: it runs as another user. {BUTTON}")
        if error is not None:
            raise error
        return running


class _Output:
    """What the command and all that it started write."""

    def __init__(self, master: int, file: int) -> None:
        self._master, self._file, self._written = master, file, 0
        self.tail = b""

    def take(self, seconds: float = LOOK) -> bool:
        """Take what comes within a time; False where nobody can write any more."""
        if not select.select([self._master], [], [], seconds)[0]:
            return True
        try:
            content = os.read(self._master, 65536)
        except OSError as error:
            if error.errno != errno.EIO:  # which is how Linux says that the last writer closed it
                raise
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
        self.say(f"{text}\n")
        shout(text)

    def _keep(self, content: bytes) -> None:
        self.tail = (self.tail + content)[-_TAIL_BYTES:]
        if self._written < _MOST_BYTES:
            self._written += len(content)
            with contextlib.suppress(OSError):  # a full disk stops no motion
                os.write(self._file, content)


def shout(text: str) -> None:
    """Say something in a line of the terminal, at once."""
    with contextlib.suppress(OSError):
        os.write(2, f"\aprior-reinforce: {text}\n".encode())


def processes() -> list[int]:
    """All processes.

    OSError if they cannot be listed: /proc is missing, or another computer's or container's.
    """
    if os.readlink("/proc/self") != str(os.getpid()):
        raise FileNotFoundError(errno.ENOENT, "/proc does not list this program")
    return [int(entry) for entry in os.listdir("/proc") if entry.isdecimal()]


def _descendants() -> dict[int, str]:
    """Names of the processes that descend from this one, by their number.

    OSError if they cannot be found.
    """
    parents: dict[int, tuple[int, str]] = {}
    for pid in processes():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
            text = Path(f"/proc/{pid}/stat").read_text(errors="replace")
            name, _, rest = text.partition("(")[2].rpartition(")")
            parents[pid] = int(rest.split()[1]), name
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
