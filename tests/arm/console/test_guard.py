import asyncio
import itertools
import os
import re
from pathlib import Path

import pytest
from starlette.datastructures import URL
from starlette.requests import HTTPConnection
from starlette.testclient import TestClient

from prior_reinforce.arm.console.guard import PUBLIC, TOKEN_FILE, report_path, token_of
from prior_reinforce.arm.console.verbs import Ask, SetGoal
from prior_reinforce.errors import FileFormatError
from tests.arm.console.conftest import TOKEN

LINK = {"authorization": f"Bearer {TOKEN}"}


def state(client, **headers):
    return client.get("/api/state", headers=LINK | headers).status_code


def test_the_secret_is_kept_for_pages_that_are_open_and_read_by_nobody_else(tmp_path):
    token = token_of(tmp_path)
    assert len(token) >= 32
    assert token_of(tmp_path) == token
    assert (tmp_path / TOKEN_FILE).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("damaged", [b"", b"a", b"\xff" * 32, b"x" * 31 + b"\n"])
def test_a_secret_that_is_damaged_is_made_anew(tmp_path, damaged):
    """One that is cut to a few characters could be guessed."""
    (tmp_path / TOKEN_FILE).write_bytes(damaged)
    assert len(token_of(tmp_path)) == 32


def test_the_secret_is_never_there_for_others_to_read(tmp_path, monkeypatch):
    modes = []

    def look(path, mode):
        modes.append(path.stat().st_mode & 0o777)

    monkeypatch.setattr(Path, "chmod", look)
    before = os.umask(0)
    try:
        token_of(tmp_path)
    finally:
        os.umask(before)
    assert modes == [0o600]


def test_a_secret_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "w").mkdir()
    (tmp_path / "mine").write_text("known to me")
    (tmp_path / "w" / TOKEN_FILE).symlink_to(tmp_path / "mine")
    with pytest.raises(FileFormatError, match="link"):
        token_of(tmp_path / "w")


def test_the_page_is_for_everyone_and_the_workspace_for_who_has_the_link(client):
    stranger = TestClient(client.app, base_url="http://127.0.0.1:8750")
    for path in ("/", "/console.js", "/console.css", "/icon.svg", "/tags.svg"):
        assert stranger.get(path).status_code == 200
    for route in client.app._app.routes:
        path = re.sub(r"\{\w+:int\}", "1", route.path).replace("{ticket}", "0")
        if path.startswith(("/api", "/report")):
            for method in route.methods:
                answer = stranger.request(method, path)
                assert answer.status_code == 401, (method, path)
    for wrong in ("", "Bearer", f"Bearer {TOKEN[:-1]}", f"bearer {TOKEN}x", f"Basic {TOKEN}"):
        answer = stranger.get("/api/state", headers={"authorization": wrong})
        assert answer.status_code == 401


@pytest.mark.parametrize("host", ["127.0.0.1:8750", "localhost:8750", "[::1]:8750", "192.168.1.5"])
def test_addresses_and_names_of_this_computer_are_answered(client, host):
    assert state(client, host=host) == 200


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "127.0.0.1.evil.example:8750", "localhost.evil.example", "[::1", ""),
        *("127.0.0.1:8750.evil.example", "[::ffff:127.0.0.1].evil.example", "[127.0.0.1]", "::1"),
        *("127.0.0.1/console.js?", "127.0.0.1:8750#", "x@127.0.0.1", "127.0.0.1:", "127.0.0.1:x"),
        *("127.0.0.1:123456", "127.0.0.1\t", "127.0.0.1,127.0.0.1", "[::1]x", "localhost."),
    ],
)
def test_a_name_that_others_resolve_to_this_computer_is_refused(client, host):
    assert state(client, host=host) == 403


@pytest.mark.parametrize(
    "origin",
    [
        *("http://evil.example", "http://127.0.0.1:9999", "null", "http://127.0.0.1", "x"),
        *(
            "http://[::1",
            "http://x@127.0.0.1:8750",
            "file://127.0.0.1:8750",
            "http://127.0.0.1:8750/",
        ),
    ],
)
def test_other_sites_are_refused_even_with_the_secret(client, origin):
    assert state(client, origin=origin) == 403
    assert state(client, origin="http://127.0.0.1:8750") == 200


def test_no_script_but_ours_no_cookie_no_frame(client):
    answer = client.get("/")
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert "set-cookie" not in answer.headers
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert not re.search(r"<script(?! src=\"/console.js\")|\son\w+=|style=", answer.text)


def test_the_report_is_read_at_an_address_that_cannot_be_guessed(client):
    client.verbs.goal(SetGoal(seen=2, goal=[0.9, 0.05]))
    client.verbs.ask(Ask(seen=3))
    stranger = TestClient(client.app, base_url="http://127.0.0.1:8750")
    answer = stranger.get(report_path(TOKEN))
    assert answer.status_code == 200
    assert "script-src" not in answer.headers["content-security-policy"]
    assert stranger.get(report_path("another")).status_code == 401
    picture = stranger.get(report_path(TOKEN, "goal-1-plans.svg"))
    assert picture.headers["content-type"] == "image/svg+xml"
    assert "script-src" not in picture.headers["content-security-policy"]
    (client.verbs.folder / "report" / "link.svg").symlink_to(client.verbs.folder / "workspace.toml")
    for name in ("goal-9-plans.svg", "link.svg", "..%2Fworkspace.toml", "..%2Ficon.svg", ".."):
        assert stranger.get(report_path(TOKEN, name)).status_code in (401, 404)


_HERE = b"127.0.0.1:8750"
HEADERS = [
    *("host", "origin", "referer", "authorization", "proxy-authorization", "cookie", "forwarded"),
    *("x-forwarded-host", "x-forwarded-for", "x-forwarded-proto", "x-forwarded-prefix"),
    *("x-forwarded-path", "x-original-url", "x-rewrite-url", "x-real-ip", "x-http-method-override"),
    *("content-type", "content-length", "transfer-encoding", "upgrade", "connection", "range"),
    *("accept", "user-agent", "sec-fetch-site", "via", "x-script-name", "x-envoy-original-path"),
]
VALUES = [
    *(f"{host}{end}" for host in ("", "127.0.0.1", "localhost:8750", "[::1]", "http://127.0.0.1:8750")
      for end in ("", "/", "/console.js", "/console.js?", "/console.js#", "\\console.js", "\t/?")),
    *("//console.js", "/../console.js", "/%2e%2e/console.js", "?/console.js", "@/console.js"),
    *("Bearer", "Bearer ", "Bearer secret ", "bearer secret", "Basic secret", "secret"),
    *("Bearer \xff", "Bearer x,Bearer secret", "GET", "websocket", "null", "*", "1", "evil"),
    *("chunked", "bytes=0-", "host=127.0.0.1;proto=https", "127.0.0.1, 127.0.0.1"),
    "\r\nauthorization: Bearer secret",
]  # fmt: skip


def answered(app, method, path, headers):
    """The status of a request that no server has looked at before."""
    statuses = []

    async def receive():
        return {"type": "http.request", "body": b"{}", "more_body": False}

    async def send(message):
        statuses.append(message.get("status"))

    scope = {"type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "scheme": "http"}
    scope |= {"method": method, "path": path, "raw_path": path.encode(), "root_path": ""}
    scope |= {"query_string": b"", "headers": headers, "server": ("127.0.0.1", 8750)}
    asyncio.run(app(scope | {"client": ("127.0.0.1", 9)}, receive, send))
    return statuses[0]


@pytest.fixture(params=["as installed", "by the Host header"])
def urls(request, monkeypatch):
    """Also with addresses as Starlette made them below 1.0.1: of what the Host header says."""

    def url(self):
        host = dict(self.scope["headers"]).get(b"host", b"").decode("latin-1")
        return URL(f"http://{host}{self.scope['path']}")

    if request.param == "by the Host header":
        monkeypatch.setattr(HTTPConnection, "url", property(url))


def test_whatever_the_headers_say_nothing_is_answered_without_the_secret(client, urls):
    paths = [("GET", "/report/0"), ("POST", "/api/execute"), ("GET", "/api/state")]
    everything = [(name.encode(), value.encode("latin-1")) for name in HEADERS for value in VALUES]
    for (method, path), header in itertools.product(paths, everything):
        for headers in ([header, (b"host", _HERE)], [(b"host", _HERE), header], [header]):
            status = answered(client.app, method, path, headers)
            assert status in (401, 403), (method, path, headers)


@pytest.mark.parametrize("host", [_HERE, b"127.0.0.1/console.js?", b"127.0.0.1:8750/?"])
def test_every_path_but_the_public_files_wants_the_secret(client, urls, host):
    for route in client.app._app.routes:
        path = re.sub(r"\{\w+:int\}", "1", route.path).replace("{ticket}", "0")
        spelled = [path, f"{path}/", f"/{path}", f"{path}?/console.js", f"/console.js/..{path}"]
        for method, each in itertools.product([*(route.methods or ()), "OPTIONS"], spelled):
            wanted = {200, 405} if each in PUBLIC and host == _HERE else {401, 403}
            assert answered(client.app, method, each, [(b"host", host)]) in wanted, (method, each)


def test_with_the_secret_a_second_host_or_secret_is_refused(client):
    link = (b"authorization", b"Bearer secret")
    assert answered(client.app, "GET", "/api/state", [(b"host", _HERE), link]) == 200
    for more in (link, (b"authorization", b"Bearer x"), (b"host", _HERE), (b"host", b"evil")):
        for headers in ([(b"host", _HERE), link, more], [more, (b"host", _HERE), link]):
            assert answered(client.app, "GET", "/api/state", headers) in (401, 403)
