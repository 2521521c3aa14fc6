"""A simulated FR3 or UR in a process of its own, at an address of its own."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

_next = iter(range(1, 255))


@dataclass(frozen=True)
class Served:
    """A simulated arm that is served."""

    host: str
    """Its address."""
    program: subprocess.Popen[str]
    """What serves it."""
    lines: queue.Queue[str]
    """What it printed and nobody read yet."""

    def said(self) -> str:
        """The next line that it prints."""
        return self.lines.get(timeout=60).strip()


def fr3(*args: str) -> AbstractContextManager[Served]:
    """Serve an FR3."""
    return arm("fr3", *args)


@contextmanager
def arm(kind: str, *args: str) -> Iterator[Served]:
    """Serve an `fr3` or a `ur`."""
    high, low = divmod(os.getpid() % 2**15, 256)  # of nobody else who tests at the same time
    host = f"127.{100 + high}.{low}.{next(_next)}"
    words = [sys.executable, "-m", "simulators", kind, "--host", host, *args]
    program = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    stdout, lines = program.stdout, queue.Queue[str]()
    threading.Thread(target=lambda: deque(map(lines.put, stdout), 0), daemon=True).start()
    served = Served(host, program, lines)
    try:
        assert "Ctrl-C ends it" in served.said()
        yield served
    finally:
        program.terminate()
        try:
            assert program.wait(timeout=20) in (0, -9)
        finally:
            program.kill()
            stdout.close()
