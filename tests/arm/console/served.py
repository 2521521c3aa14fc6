"""A console, as a program of its own or in a thread of the tests, for a browser to look at."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

from prior_reinforce.arm.console.guard import report_path, token_of
from prior_reinforce.arm.console.server import Events, application, server_of
from prior_reinforce.arm.console.verbs import Verbs
from prior_reinforce.arm.executing.base import ArmSettings
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

ARM = Path(__file__).with_name("simulated_arm.py")
CHROMIUM = "/usr/bin/chromium"


class Served:
    """`prior-reinforce console`, to be killed and started again at the same address."""

    def __init__(self, folder: Path, task: str = "planar", seconds: float = 0.0) -> None:
        self.folder, self.truths = folder, folder.parent / f"{folder.name}.truths"
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self.moved_by: str | ArmSettings | None = (
            f"{sys.executable} {ARM} {task} {{plan}} {self.truths} {seconds}"
        )
        self.start()

    def start(self) -> None:
        program = [sys.executable, "-m", "prior_reinforce.cli", "console", str(self.folder)]
        with (self.folder.parent / "console.log").open("a") as log:
            self.process = subprocess.Popen(
                [*program, "--port", str(self.port), "--run", str(self.moved_by)],
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


class Here(Served):
    """The same in a thread: it cannot be killed, and starts at once."""

    certificate: tuple[Path, Path] | tuple[()] = ()

    def start(self) -> None:
        token, events = token_of(self.folder), Events()
        self.verbs = Verbs(
            self.folder,
            moved_by=self.moved_by,
            report=report_path(token),
            publish=events.publish,
        )
        app = application(self.verbs, events, token, "127.0.0.1", VisionLanguageModelConfig())
        self._server = server_of(app, events, *self.certificate)
        listening = socket.create_server(("127.0.0.1", self.port))
        self._thread = threading.Thread(target=self._server.run, args=([listening],), daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._server.should_exit = True
        self._thread.join()


class OnArm(Here):
    """The same, moved by the arm that the manifest names."""

    def start(self) -> None:
        with Workspace(self.folder) as workspace:
            self.moved_by = workspace.manifest.driven_by
        super().start()


class Secure(Here):
    """The same by https."""

    def __init__(self, folder: Path, certificate: tuple[Path, Path]) -> None:
        self.certificate = certificate
        super().__init__(folder)

    @property
    def address(self) -> str:
        return f"https://127.0.0.1:{self.port}"
