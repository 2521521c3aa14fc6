"""A Python with LeRobot that imports it once: each program that it is asked for is a fork.

LeRobot takes seconds to import, and a day of an arm starts it four times.
"""

from __future__ import annotations

import json
import os
import runpy
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LEROBOT = Path(__file__).parents[3] / ".venv/lerobot/python"
NO_LEROBOT = not LEROBOT.exists() and "PRIOR_REINFORCE_REQUIRED" not in os.environ
"""Whether tests that need it are skipped: never in CI."""
CLIENT = """#!{python} -IS
import json, socket, sys
with socket.socket(socket.AF_UNIX) as end:
    end.connect({place!r})
    socket.send_fds(end, [json.dumps(sys.argv[1:]).encode()], [0, 1, 2])
    end.recv(1)  # nothing: it has ended
"""


@contextmanager
def nursery(folder: Path) -> Iterator[Path]:
    """Start it; what is called as that Python is."""
    place, python = folder / "asked", folder / "python"
    python.write_text(CLIENT.format(python=sys.executable, place=str(place)))
    python.chmod(0o755)
    with socket.socket(socket.AF_UNIX) as asked:
        asked.bind(str(place))
        asked.listen()
        program = subprocess.Popen([LEROBOT, __file__], stdin=asked)
    try:
        yield python
    finally:
        program.kill()
        program.wait()


def _serve(asked: socket.socket) -> None:
    """Fork for each who asks, with the input and the outputs of who asks."""
    del sys.path[0]  # this folder
    import draccus  # noqa: F401
    import lerobot.robots.so_follower  # noqa: F401

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        end, _ = asked.accept()
        text, files, *_ = socket.recv_fds(end, 1 << 16, 3)
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            asked.close()
            for number, file in enumerate(files):
                os.dup2(file, number)
                os.close(file)
            break
        for file in (*files, end.detach()):
            os.close(file)
    sys.argv = json.loads(text)
    sys.path.insert(0, str(Path(sys.argv[0]).parent))
    runpy.run_path(sys.argv[0], run_name="__main__")


if __name__ == "__main__":
    _serve(socket.socket(fileno=0))
