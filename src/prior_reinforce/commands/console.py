"""The command that opens the operator's console."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass
from pathlib import Path
from ssl import PROTOCOL_TLS_SERVER, SSLContext
from typing import Annotated

import tyro

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands.base import OnWorkspace
from prior_reinforce.commands.vision import Vlm, model_of
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.extras import check_installed


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
    time_limit: float = 120.0
    """Seconds that the command may take."""
    certificate: Path | None = None
    """Certificate by which to answer over https, so that a tablet's camera works (PEM; mkcert
    makes one)."""
    key: Path | None = None
    """Its key, where that is a file of its own."""
    vlm: Vlm = None

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        check_installed("uvicorn")
        from prior_reinforce.arm.console.guard import report_path, token_of
        from prior_reinforce.arm.console.server import Events, application, server_of
        from prior_reinforce.arm.console.verbs import Verbs
        from prior_reinforce.arm.executing.arguments import check_command

        self._check_certificate()
        model = model_of(self.vlm, workspace.folder)
        arm, by = workspace.manifest.driven_by, self.run_command
        if by is not None:
            check_command(by, time_limit=self.time_limit)
        with self._listening() as listening:
            token, events = token_of(workspace.folder), Events()
            verbs = Verbs(
                workspace.folder,
                moved_by=by or arm,
                time_limit=self.time_limit,
                report=report_path(token),
                publish=events.publish,
            )
            try:
                self._say(workspace.folder, token)
                app = application(verbs, events, token, self.host, model)
                server_of(app, events, self.certificate, self.key).run([listening])
            except KeyboardInterrupt:  # how it is meant to end
                pass
            finally:
                verbs.close()
        print("console closed")

    def _check_certificate(self) -> None:
        if self.certificate is None and self.key is not None:
            raise ConfigurationError("--key is of a --certificate; give both, or drop it")
        if self.certificate is not None:
            try:
                SSLContext(PROTOCOL_TLS_SERVER).load_cert_chain(self.certificate, self.key)
            except OSError as error:  # a wrong one, too
                raise ConfigurationError(
                    f"cannot use {self.certificate} ({error}); give a certificate and its key as "
                    "PEM, for instance those that mkcert makes"
                ) from error

    def _listening(self) -> socket.socket:
        if not 0 <= self.port < 2**16:
            raise ConfigurationError(f"cannot listen at port {self.port}; give one up to 65535")
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        both = self.host == "::" and socket.has_dualstack_ipv6()
        try:
            return socket.create_server((self.host, self.port), family=family, dualstack_ipv6=both)
        except OSError as error:
            raise ConfigurationError(
                f"cannot listen at {self.host}:{self.port} ({error}); give another --host or --port"
            ) from error

    def _say(self, folder: Path, token: str) -> None:
        """Show the link, and as a QR code where another device is to open it."""
        host = _own_address() if self.host in ("0.0.0.0", "::") else self.host
        scheme = "http" if self.certificate is None else "https"
        named = f"[{host}]" if ":" in host else host
        link = f"{scheme}://{named}:{self.port}/#{token}"
        print(f"console of {folder}: {link}", flush=True)
        if not _is_loopback(host):
            import segno

            segno.make(link).terminal(compact=True)
            camera = "; a browser gives its camera to this address only over https (docs: console)"
            camera = "" if scheme == "https" else camera
            print(f"whoever has this link can move the arm{camera}", flush=True)


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
