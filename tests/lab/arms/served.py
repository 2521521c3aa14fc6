"""A simulated FR3 or UR in a process of its own, at an address of its own."""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import sys
import threading

_next = iter(range(1, 255))


def fr3(*args):
    """Serve an FR3; `.host`, and `.said()` for the next line that it prints."""
    return arm("fr3", *args)


@contextlib.contextmanager
def arm(kind, *args):
    """Likewise, `fr3` or `ur`."""
    high, low = divmod(os.getpid() % 2**15, 256)  # of nobody else who tests at the same time
    host = f"127.{100 + high}.{low}.{next(_next)}"
    words = [sys.executable, "-m", "prior_reinforce.cli", "simulate", kind, "--host", host, *args]
    program = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    lines: queue.Queue[str] = queue.Queue()
    threading.Thread(
        target=lambda: [lines.put(line) for line in program.stdout], daemon=True
    ).start()
    program.host, program.said = host, lambda: lines.get(timeout=60).strip()
    try:
        assert "Ctrl-C ends it" in program.said()
        yield program
    finally:
        program.terminate()
        try:
            assert program.wait(timeout=20) in (0, -9)
        finally:
            program.kill()
            program.stdout.close()
