"""Who may speak to the console: one secret, no cookies, no other site.

The secret is in the link that the terminal shows, behind its `#`, which browsers send nowhere. The
page adds it to every request as a header, which no other site can do; so nothing is ambient, and a
request forged by another site has no right. Names that are resolved to this computer by somebody
else's name server (DNS rebinding) are refused by the Host header. What is public is decided by the
path that is routed, `scope["path"]`, and by nothing that a header can change.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable
from pathlib import Path

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from prior_reinforce.files import in_place, require_inside

TOKEN_FILE = ".console-token"
_RANDOM = 24
"""Bytes of the secret, which are written as 32 characters."""
_TOKEN = re.compile(rb"[\w-]{32}")
PUBLIC = {
    "/": "text/html",
    "/console.js": "text/javascript",
    "/console.css": "text/css",
    "/icon.svg": "image/svg+xml",
    "/tags.svg": "image/svg+xml",
}
"""The page itself, which holds nothing of the workspace: path and media type."""
_SELF_ONLY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; media-src "
    "blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_REPORT = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; media-src 'self' data:"
)
"""The report has its styles in it, pictures in it or beside it, and no script."""
_HOST = re.compile(r"(?:\[([0-9a-f:.]+)\]|([0-9a-z._-]+))(?::[0-9]{1,5})?")
"""An IPv6 address in brackets, or a name, and a port (RFC 3986, section 3.2.2)."""
_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(self), microphone=(), geolocation=()",
    "cache-control": "no-store",
}


def problem(status: int, error: str) -> JSONResponse:
    """Answer why something is not done."""
    return JSONResponse({"error": error}, status)


def token_of(folder: Path) -> str:
    """Return a workspace's secret; made if there is none whole, and kept, so that pages stay valid.

    FileFormatError if it is a link out of the workspace.
    """
    path = require_inside(folder / TOKEN_FILE, folder)
    if not path.is_file() or not _TOKEN.fullmatch(path.read_bytes()):
        with in_place(path) as unfinished:
            unfinished.touch(0o600)  # before it holds the secret, and has its name
            unfinished.write_text(secrets.token_urlsafe(_RANDOM), encoding="ascii")
    path.chmod(0o600)
    return path.read_text(encoding="ascii")


def report_path(token: str, name: str = "report.html") -> str:
    """Where a file of the report is read: it cannot be guessed, for a page without a script."""
    return f"/report/{hmac.new(token.encode(), b'report', 'sha256').hexdigest()}/{name}"


class Guard:
    """Lets through what comes from the page, and adds the headers that keep it ours."""

    def __init__(self, app: ASGIApp, token: str, host: str) -> None:
        """Guard an application that was told to listen at a host, for who has the token."""
        self._app, self._token = app, token
        own = socket.gethostname().lower()
        self._names = {"localhost", host.lower(), own, f"{own}.local"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] != "http":  # the start and the end: what serves it opens no websocket
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                policy = _REPORT if scope["path"].startswith("/report/") else _SELF_ONLY
                added = _HEADERS | {"content-security-policy": policy}
                message["headers"] += [(k.encode(), v.encode()) for k, v in added.items()]
            await send(message)

        refused = self._refusal(scope["path"], scope["headers"])
        answer = self._app if refused is None else refused
        await answer(scope, receive, send_guarded)

    def _refusal(self, path: str, headers: Iterable[tuple[bytes, bytes]]) -> JSONResponse | None:
        """Why a request is not answered; None if it is."""

        def said(name: bytes) -> str:
            """All that the headers of a name say: a second one never stands for the first."""
            return ",".join(value.decode("latin-1") for key, value in headers if key == name)

        host, origin = said(b"host").lower(), said(b"origin").lower()
        if not self._is_here(host):
            return problem(403, f"{host[:80]!r} is no name of this computer; open the link again")
        if origin not in ("", f"http://{host}", f"https://{host}"):
            return problem(403, "a page of another site asks; open the console's own link")
        if path in PUBLIC or path.startswith(report_path(self._token, "")):
            return None
        given = said(b"authorization").encode()
        if not secrets.compare_digest(given, f"Bearer {self._token}".encode()):
            return problem(401, "the link is incomplete; open the one that the terminal shows")
        return None

    def _is_here(self, host: str) -> bool:
        """Whether a Host header names this computer: an address, or a name that it has itself."""
        if (found := _HOST.fullmatch(host)) is None:
            return False
        try:
            name = found[2] or str(ipaddress.IPv6Address(found[1]))
            return name in self._names or bool(ipaddress.ip_address(name))
        except ValueError:
            return False
