import os
import re
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from prior_reinforce.bench.console.guard import TOKEN_FILE, report_path, token_of
from prior_reinforce.bench.console.verbs import Ask, SetGoal
from prior_reinforce.errors import FileFormatError
from tests.bench.console.conftest import TOKEN

LINK = {"authorization": f"Bearer {TOKEN}"}


def state(client, **headers):
    return client.get("/api/state", headers=LINK | headers).status_code


def test_the_secret_is_kept_for_pages_that_are_open_and_read_by_nobody_else(tmp_path):
    token = token_of(tmp_path)
    assert len(token) >= 32
    assert token_of(tmp_path) == token
    assert (tmp_path / TOKEN_FILE).stat().st_mode & 0o077 == 0


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
    "host", ["evil.example", "127.0.0.1.evil.example:8750", "localhost.evil.example", "[::1", ""]
)
def test_a_name_that_others_resolve_to_this_computer_is_refused(client, host):
    assert state(client, host=host) == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:9999", "null", "http://127.0.0.1", "x"]
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
