"""Hostile requests to a console that listens: whatever they say, nobody is let in.

    python -m tests.attacks.requests [REQUESTS] [oldest | newest | installed ...]

The console is served by the oldest versions of its libraries that `pyproject.toml` allows, by the
newest that there are, or by those that are installed; pip installs them into a folder that is
deleted. No request has the secret, and each is sent as bytes, since a client would not send most
of them. Afterwards nothing has moved or changed, and a page that has the secret is answered.
"""

from __future__ import annotations

import os
import random
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import distributions
from pathlib import Path

from packaging.requirements import Requirement

from prior_reinforce.arm.console.guard import PUBLIC
from tests.arm.console.served import Served
from tests.arm.console.test_guard import HEADERS, VALUES
from tests.attacks.harness import prepare, tree
from tests.test_dependencies import PROJECT

LIBRARIES = [Requirement(line) for line in PROJECT["optional-dependencies"]["console"]]
WANTED = ("/api/state", "/api/execute", "/api/ask", "/api/stop", "/api/events", "/report/0")
TARGETS = [
    *(end.format(path) for path in WANTED for end in ("{}", "/{}", "{}/", "{}?/console.js")),
    *(f"{start}{path}" for path in WANTED for start in ("/console.js/..", "/%2e%2e", "/./")),
    *(f"http://{host}{path}" for path in WANTED for host in ("127.0.0.1", "127.0.0.1/console.js?")),
    *("*", "", "/", "/console.js", "/%00", "\\api\\state", "/api%2fstate", "/api/state;x"),
]  # fmt: skip
METHODS = ("GET", "GET", "POST", "POST", "PUT", "HEAD", "OPTIONS", "DELETE", "CONNECT", "get", "X")
BODIES = ("", "{}", '{"seen": 4, "trial": 1, "sha256": "", "stopped": 0}', "x" * 70_000)
_MEDIA = re.compile(rb"content-type: (?:%s)" % "|".join(PUBLIC.values()).encode())


def hostile(rng: random.Random, port: int) -> bytes:
    """One request, or two, one hidden in the other."""
    request = _one(rng, port)
    if rng.random() < 0.2:
        request += _one(rng, port)
    if rng.random() < 0.1:
        at = rng.randrange(len(request))
        request = request[:at] + rng.randbytes(rng.randrange(9)) + request[at:]
    return request


def _one(rng: random.Random, port: int) -> bytes:
    target, body = rng.choice(TARGETS), rng.choice(BODIES)
    lines = [f"{rng.choice(METHODS)} {target} HTTP/{rng.choice(['1.1', '1.1', '1.1', '1.0', '2'])}"]
    if rng.random() < 0.8:
        lines.append(f"Host: 127.0.0.1:{port}")
    if rng.random() < 0.8:
        lines.append(f"Content-Length: {len(body) + rng.choice([0, 0, 0, -1, 1])}")
    for _ in range(rng.randrange(4)):
        lines.append(f"{rng.choice(HEADERS)}: {rng.choice(VALUES)}".replace("8750", str(port)))
    head = [lines[0], *rng.sample(lines[1:], len(lines) - 1)]
    end = rng.choice(["\r\n", "\r\n", "\r\n", "\n"])
    return (end.join(head) + end * 2 + body).encode("latin-1")


def answer(port: int, request: bytes) -> bytes:
    """All that comes back within a second."""
    said = b""
    with socket.create_connection(("127.0.0.1", port), timeout=1) as connection:
        try:
            connection.sendall(request)
            connection.shutdown(socket.SHUT_WR)
            while part := connection.recv(65536):
                said += part
        except OSError:  # it closed, or waits for more
            pass
    return said


def let_in(said: bytes) -> bool:
    """Whether some answer is more than a refusal or a file of the page itself."""
    heads = re.findall(rb"HTTP/1\.1 2\d\d.*?\r\n\r\n", said, re.DOTALL)
    return any(not _MEDIA.search(head) or b"unsafe-inline" in head for head in heads)


def tabs_are_freed(console: Served) -> bool:
    """Whether a page is told what happens after sixty others were opened and closed."""
    head = f"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {console.token}"
    for _ in range(60):
        with socket.create_connection(("127.0.0.1", console.port), timeout=9) as tab:
            tab.sendall(f"{head}\r\n\r\n".encode())
            tab.recv(64)
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        with socket.create_connection(("127.0.0.1", console.port), timeout=9) as tab:
            tab.sendall(f"{head}\r\n\r\n".encode())
            if b" 200 " in tab.recv(64):
                return True
        time.sleep(0.5)
    return False


def attack(requests: int) -> list[str]:
    """What broke in a console that is served by what Python finds first."""
    with tempfile.TemporaryDirectory() as place:
        folder = prepare(Path(place))
        os.environ["PRIOR_REINFORCE_ARM"] = place
        console = Served(folder)
        try:
            before = tree(folder)
            rng = random.Random(requests)
            sent = [hostile(rng, console.port) for _ in range(requests)]
            with ThreadPoolExecutor(8) as pool:
                said = list(pool.map(lambda request: answer(console.port, request), sent))
            broke = [f"let in: {q[:300]!r}" for q, a in zip(sent, said, strict=True) if let_in(a)]
            statuses = Counter(n.decode() for a in said for n in re.findall(rb"^HTTP/1.1 (...)", a))
            print(f"{requests} requests, answered {dict(statuses.most_common())}", flush=True)
            if console.landed() or tree(folder) != before:
                broke.append("something moved, or changed")
            if console.get("/api/state")["step"] != "execute":
                broke.append("a page with the secret sees another state")
            if not tabs_are_freed(console):
                broke.append("tabs that were closed are never let go")
        finally:
            console.end()
        log = (folder.parent / "console.log").read_text()
        return broke + [f"said: {log[-600:]}"] * ("Traceback" in log)


def installed(versions: str, folder: Path) -> str:
    """Have the console's libraries of these versions in a folder; which they are."""
    wanted = [
        f"{each.name}=={next(iter(each.specifier)).version}" if versions == "oldest" else each.name
        for each in LIBRARIES
    ]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(folder), *wanted]
    subprocess.run(pip, check=True, stderr=subprocess.DEVNULL)
    return ", ".join(
        sorted(f"{each.name} {each.version}" for each in distributions(path=[str(folder)]))
    )


def main(requests: int = 1000, *versions: str) -> int:
    """Print what broke with each of the versions; how much did."""
    broke, path = 0, os.environ.get("PYTHONPATH", "")
    for each in versions or ("oldest", "newest"):
        with tempfile.TemporaryDirectory() as folder:
            which = "" if each == "installed" else installed(each, Path(folder))
            os.environ["PYTHONPATH"] = f"{folder}{os.pathsep}{path}"
            print(f"{each}: {which}", flush=True)
            found = attack(requests)
        broke += len(found)
        print("\n".join(found) or "held", flush=True)
    return broke


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2]), *sys.argv[2:]) > 0)
