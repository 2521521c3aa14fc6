"""A console that runs as a program of its own, and a browser at it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

ARM = Path(__file__).with_name("simulated_arm.py")
CHROMIUM = "/usr/bin/chromium"


class Served:
    """`prior-reinforce console`, to be killed and started again at the same address."""

    def __init__(
        self, folder: Path, task: str = "planar", seconds: float = 0.0, *more: str
    ) -> None:
        self.folder, self.truths = folder, folder.parent / f"{folder.name}.truths"
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        arm = f"{sys.executable} {ARM} {task} {{plan}} {self.truths} {seconds}"
        self._options = ["--run", arm]
        self.start()

    def start(self) -> None:
        program = [sys.executable, "-m", "prior_reinforce.cli", "console", str(self.folder)]
        with (self.folder.parent / "console.log").open("a") as log:
            self.process = subprocess.Popen(
                [*program, "--port", str(self.port), *self._options],
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        for _ in range(600):
            with contextlib.suppress(OSError), urllib.request.urlopen(self.address):
                return
            assert self.process.poll() is None, (self.folder.parent / "console.log").read_text()
            time.sleep(0.05)
        raise AssertionError("the console does not start")

    def kill(self) -> None:
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(20)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def token(self) -> str:
        return (self.folder / ".console-token").read_text().strip()

    @property
    def link(self) -> str:
        return f"{self.address}/#{self.token}"

    def get(self, path: str) -> dict:
        headers = {"authorization": f"Bearer {self.token}"}
        request = urllib.request.Request(self.address + path, headers=headers)
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)

    def landed(self) -> list[list[float]]:
        """Where the object ended in each execution so far."""
        lines = self.truths.read_text().splitlines() if self.truths.exists() else []
        return [json.loads(line) for line in lines]
