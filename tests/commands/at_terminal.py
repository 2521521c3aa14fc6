"""A person at a pseudo-terminal: of this process, or of a command in one of its own."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from contextlib import suppress
from pathlib import Path

PROGRAM = str(Path(sys.executable).with_name("prior-reinforce"))
PROMPT = re.compile(r"([^\n]*)\ntype [^\n]*: $")
"""A question, and below it what may be typed: the end of what stands on the screen."""


class Person:
    """Answers each question of this process, whose input is its terminal, with the next answer."""

    def __init__(self, *answers):
        self.asked, self._answers = [], list(answers)
        self._screen, theirs = pty.openpty()
        settings = termios.tcgetattr(theirs)
        settings[1] &= ~termios.OPOST  # "\n" stays one
        settings[3] &= ~termios.ECHO
        termios.tcsetattr(theirs, termios.TCSANOW, settings)
        self.stdin = os.fdopen(theirs)
        self._thread = threading.Thread(target=self._answer, daemon=True)
        self._thread.start()

    def _answer(self):
        seen = ""
        with suppress(OSError):
            while shown := os.read(self._screen, 4096).decode():
                seen += shown
                if (found := PROMPT.search(seen)) is not None:
                    self.asked.append(found[1])
                    seen, answer = "", self._answers.pop(0) if self._answers else "\x04"
                    os.write(self._screen, f"{answer() if callable(answer) else answer}\n".encode())

    def close(self):
        self.stdin.close()
        self._thread.join()
        os.close(self._screen)


class Typed:
    """A command at a terminal of its own."""

    def __init__(self, *args, program=PROGRAM):
        self.ours, theirs = os.openpty()
        self.process = subprocess.Popen(
            [program, *map(str, args)],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
        )
        os.close(theirs)
        self.seen = self.shown = ""
        """What stands on the screen since `wait_for` found something, and all of it."""

    def look(self, seconds):
        """Wait for the command to write something; whether the terminal is still open."""
        if select.select([self.ours], [], [], seconds)[0]:
            try:
                said = os.read(self.ours, 4096).decode()
            except OSError:
                return False
            self.seen += said
            self.shown += said
        return True

    def wait_for(self, text, limit=60.0):
        deadline = time.monotonic() + limit
        while text not in self.seen:
            assert time.monotonic() < deadline, self.seen
            if not self.look(1.0):
                assert text in self.seen, self.seen
        self.seen = self.seen.partition(text)[2]

    def type(self, text):
        with suppress(OSError):  # it has ended
            os.write(self.ours, text.encode())

    def close(self):
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        os.close(self.ours)
