"""The command that opens the operator's console."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.base import OnWorkspace
from prior_reinforce.commands.trials import arm_of
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.extras import check_installed
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig


@dataclass(frozen=True)
class Console(OnWorkspace):
    """Open a page over a workspace, for whoever stands beside the arm: touch where it landed.

    For example:
        prior-reinforce console hoop --run "mycontroller {plan}"
        prior-reinforce console hoop --host 192.168.1.5
    """

    host: str = "127.0.0.1"
    """Where to listen: this computer alone, or an address of it for a tablet in the same network,
    for instance 192.168.1.5, or 0.0.0.0 for all of them."""
    port: int = 8750
    """Where to listen; the same one again, so that open pages go on."""
    run_command: Annotated[str | None, tyro.conf.arg(name="run")] = None
    """Command that executes a plan, as in `ask --run`; without one, the arm that [arm] of the
    manifest names does, and where there is none, plans are downloaded."""
    executor: str | None = None
    """The executor that [arm] names, where it is your own: module:Class."""
    time_limit: float = 120.0
    """Seconds that the command may take."""
    generator: str | None = None
    """The generator that the model was learned by, where it is your own: module:Class."""
    adapter: str | None = None
    """The adapter that the goal was set with, where it is your own: module:Class."""
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model that find objects in pictures (docs/perception.md)."""

    def run_on(self, workspace: Workspace, words: Sequence[str]) -> None:
        """Serve until interrupted."""
        check_installed("uvicorn")
        from prior_reinforce.bench.console.guard import report_path, token_of
        from prior_reinforce.bench.console.server import Events, application, serve
        from prior_reinforce.bench.console.verbs import Execute, Verbs
        from prior_reinforce.bench.robots.executors.arguments import (
            check_command,
            without_arguments,
        )

        limit, by, name = self.time_limit, self.run_command, ""
        arm, folder = arm_of(workspace, self.executor), workspace.folder
        if by is not None:
            check_command(by, time_limit=limit)
            arm, name = None, without_arguments(by)
        elif arm is not None:
            name = arm.executor

        def execute(workspace: Workspace, body: Execute) -> object:
            how = by or arm
            assert how is not None
            return workspace.execute(
                body.trial, how, time_limit=limit, motion=body.motion, speed=body.speed
            )

        with self._listening() as listening:
            token, events = token_of(folder), Events()
            verbs = Verbs(
                folder,
                execute=execute if name else None,
                executor=name,
                approaches=arm is not None,
                own=self.generator,
                own_adapter=self.adapter,
                report=report_path(token),
                publish=events.publish,
            )
            try:
                self._say(folder, token)
                serve(application(verbs, events, token, self.host, self.vlm), listening)
            finally:
                verbs.close()

    def _listening(self) -> socket.socket:
        if not 0 <= self.port < 2**16:
            raise ConfigurationError(f"cannot listen at port {self.port}; give one up to 65535")
        try:
            return socket.create_server((self.host, self.port))
        except OSError as error:
            raise ConfigurationError(
                f"cannot listen at {self.host}:{self.port} ({error}); give another --host or --port"
            ) from error

    def _say(self, folder: Path, token: str) -> None:
        """Show the link, and as a QR code where another device is to open it."""
        host = self.host
        if host in ("0.0.0.0", "::"):
            host = _own_address()
        link = f"http://{host}:{self.port}/#{token}"
        print(f"console of {folder}: {link}", flush=True)
        if not _is_loopback(host):
            import segno

            segno.make(link).terminal(compact=True)
            print(
                "whoever has this link can move the arm; a browser gives its camera to this "
                "address only over https (docs: console)",
                flush=True,
            )


def _own_address() -> str:
    """The address by which other devices reach this computer; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1, RFC 5737
            return str(probe.getsockname()[0])
        except OSError:
            return socket.gethostname()


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
