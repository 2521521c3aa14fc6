import asyncio
import json
import shutil
import signal
import socket
import threading
import time
import warnings

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prior_reinforce.arm.console import server as module
from prior_reinforce.arm.console.server import Events
from prior_reinforce.arm.workspace.workspace import Workspace
from tests.arm.console.pictures import jpeg
from tests.arm.console.served import Served

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import schemathesis
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi.checks import (
        content_type_conformance,
        response_schema_conformance,
        status_code_conformance,
    )

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]


def post(client, verb, **body):
    return client.post(f"/api/{verb}", json=body)


def aimed(client):
    state = post(client, "goal", seen=2, goal=[0.9, 0.05]).json()
    return post(client, "ask", seen=state["id"]).json()


def test_a_trial_over_http(client):
    state = aimed(client)
    assert state["step"] == "execute"
    motion = client.get("/api/plans/1").json()
    assert motion["sha256"] == state["trials"][0]["sha256"]
    file = client.get("/api/plans/1/file")
    assert file.status_code == 200
    import hashlib

    assert hashlib.sha256(file.content).hexdigest() == motion["sha256"]
    told = post(client, "tell", seen=state["id"], trial=1, error=[0.05, 0.0])
    assert told.json()["trials"][0]["line"] == "5 cm long"


@pytest.mark.parametrize(
    ("verb", "body", "status", "said"),
    [
        ("goal", {"seen": 1, "goal": [0.9, 0.0]}, 409, "not done"),
        ("goal", {"seen": 2, "goal": [0.9]}, 422, "goal"),
        ("goal", {"seen": 2}, 400, "goal"),
        ("goal", {"seen": 2, "goal": [0.9, 0.0], "other": 1}, 400, "other"),
        ("goal", {"seen": 2, "goal": ["<b>", 0.0]}, 400, "float"),
        ("tell", {"seen": 2, "trial": 1, "hit": True}, 409, "no trial 1"),
        ("execute", {"seen": 2, "trial": 1, "sha256": "x", "stopped": "0"}, 409, "no trial 1"),
        ("ask", {"seen": 2}, 409, "no goal"),
        ("find", {"words": "the red ball", "size": 0.04}, 422, "calibrated"),
        ("nothing", {}, 404, "Not Found"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(client, verb, body, status, said):
    answer = post(client, verb, **body)
    assert answer.status_code == status
    assert said in answer.json()["error"]


@pytest.mark.parametrize("content", [b"", b"[", b"\xff\xfe", b'{"seen":1e999,"goal":[0,0]}', b"1"])
def test_what_is_no_json_is_refused(client, content):
    assert client.post("/api/goal", content=content).status_code == 400


def test_a_body_that_is_too_large_is_refused_before_it_is_read(client):
    told = client.post("/api/goal", content=b"x", headers={"content-length": "100000000"})
    assert told.status_code == 413
    assert client.post("/api/goal", content=iter([b"x" * 60_000] * 2)).status_code == 413
    assert client.put("/api/picture", content=b"x" * 12_000_001).status_code == 413


def test_a_client_that_dawdles_is_refused(client, monkeypatch):
    monkeypatch.setattr(module, "_LONGEST_WAIT", 0.05)

    async def never():
        await asyncio.sleep(5)
        return {"type": "http.request", "body": b"", "more_body": False}

    sent = []

    async def send(message):
        sent.append(message)

    headers = [(b"host", b"127.0.0.1"), (b"authorization", b"Bearer secret")]
    scope = {"type": "http", "method": "POST", "path": "/api/goal", "headers": headers}
    scope |= {"query_string": b"", "http_version": "1.1", "scheme": "http", "app": None}
    asyncio.run(asyncio.wait_for(client.app(scope, never, send), 3))
    assert sent[0]["status"] == 408


def test_recordings_and_pictures_come_as_they_are(client):
    answer = client.put("/api/recordings", params={"name": "x.npz"}, content=b"zip")
    assert answer.json()["files"] == 1
    assert client.put("/api/recordings", content=b"zip").status_code == 400
    assert "x.npz" in client.get("/api/recordings").json()["problem"]
    assert client.delete("/api/recordings").json()["files"] == 0
    camera = client.put("/api/picture", content=jpeg()).json()
    assert len(camera["picture"]) == 16
    assert client.get("/api/picture").headers["content-type"] == "image/jpeg"


def test_stop_waits_for_nothing_else(client, monkeypatch):
    """Forty requests that hang hold all other threads."""
    free, hanging = threading.Event(), threading.Semaphore(0)

    def hang():
        hanging.release()
        free.wait(60)
        return b""

    async def ask_for_all():
        transport = httpx.ASGITransport(client.app)
        headers = {"authorization": "Bearer secret"}
        base = "http://127.0.0.1"
        async with httpx.AsyncClient(transport=transport, base_url=base, headers=headers) as asking:
            held = [asyncio.create_task(asking.get("/api/camera")) for _ in range(60)]
            for _ in range(40):
                while not hanging.acquire(blocking=False):
                    await asyncio.sleep(0.01)
            stopped = await asyncio.wait_for(asking.post("/api/stop"), 30)
            free.set()
            await asyncio.gather(*held)
            return stopped.status_code

    for route in client.app._app.routes:
        if route.path == "/api/camera":
            endpoint = route.endpoint.args[0]
            monkeypatch.setitem(endpoint.__dict__, "call", hang)
    assert asyncio.run(ask_for_all()) == 200


def test_every_tab_hears_and_one_that_lags_holds_nobody_up():
    async def listening():
        events = Events()
        events.loop = asyncio.get_running_loop()
        tabs = [asyncio.Queue(module._QUEUE) for _ in range(2)]
        events._tabs.update(tabs)
        quick, slow = map(events._lines, tabs)
        assert await anext(quick) == await anext(slow) == b"data: {}\n\n"
        for number in range(3 * module._QUEUE):
            events.publish({"id": number})
            await asyncio.sleep(0)
            assert json.loads((await anext(quick))[6:]) == {"id": number}
        assert json.loads((await anext(slow))[6:]) == {"id": 0}
        await quick.aclose()
        await slow.aclose()

    asyncio.run(asyncio.wait_for(listening(), 20))


def test_eighty_tabs_in_one_burst_are_fifty(client):
    async def burst():
        closed, statuses = asyncio.Event(), []

        async def receive():
            await closed.wait()
            return {"type": "http.disconnect"}

        async def send(message):
            if message["type"] == "http.response.start":
                statuses.append(message["status"])
            await asyncio.sleep(0)  # as a socket lets the others go on

        headers = [(b"host", b"127.0.0.1"), (b"authorization", b"Bearer secret")]
        scope = {"type": "http", "method": "GET", "path": "/api/events", "headers": headers}
        scope |= {"query_string": b"", "http_version": "1.1", "asgi": {"version": "3.0"}}
        for _ in range(2):  # those that are closed make room for as many
            tabs = [asyncio.create_task(client.app(dict(scope), receive, send)) for _ in range(80)]
            while len(statuses) < 80:
                await asyncio.sleep(0)
            assert (statuses.count(200), statuses.count(429)) == (module._MOST_TABS, 30)
            closed.set()
            await asyncio.gather(*tabs)
            closed.clear()
            statuses.clear()

    asyncio.run(asyncio.wait_for(burst(), 60))


def test_a_sign_of_life_comes_where_nothing_happens(monkeypatch):
    monkeypatch.setattr(module, "_BEAT", 0.01)

    async def listening():
        lines = Events()._lines(asyncio.Queue())
        assert [await anext(lines) for _ in range(3)] == [b"data: {}\n\n"] * 3
        await lines.aclose()

    asyncio.run(asyncio.wait_for(listening(), 20))


@pytest.fixture(scope="module")
def served(learned_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("served") / "planar"
    shutil.copytree(learned_folder, folder)
    with Workspace(folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
    served = Served(folder)
    yield served
    served.end()


@pytest.fixture(scope="module")
def operations(served):
    headers = {"authorization": f"Bearer {served.token}"}
    schema = schemathesis.openapi.from_url(f"{served.address}/api/openapi.json", headers=headers)
    return [operation.ok() for operation in schema.get_all_operations()], headers


def test_whatever_is_asked_the_answer_is_a_documented_one(served, operations):
    table, headers = operations
    assert len(table) == 25

    for operation in table:
        if operation.path == "/api/stop":
            continue  # nothing is executing; what it does is in test_verbs

        @settings(max_examples=12, suppress_health_check=list(HealthCheck), database=None)
        @given(case=operation.as_strategy())
        def answered(case):
            case.validate_response(case.call(headers=headers), checks=CHECKS)

        answered()
    assert served.process.poll() is None


@settings(max_examples=60, suppress_health_check=list(HealthCheck), database=None)
@given(
    method=st.sampled_from(["GET", "POST", "PUT", "DELETE", "PATCH"]),
    path=st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=30),
    body=st.binary(max_size=200),
)
def test_no_request_at_all_ends_in_a_server_error(served, method, path, body):
    headers = {"authorization": f"Bearer {served.token}"}
    path = f"/api/{path}".split("#")[0].split("events")[0]
    answer = httpx.request(method, served.address + path, content=body, headers=headers)
    assert answer.status_code < 500


def test_interrupted_with_open_pages_it_ends_in_one_line(learned_folder, tmp_path):
    shutil.copytree(learned_folder, tmp_path / "planar")
    served = Served(tmp_path / "planar")
    headers = {"authorization": f"Bearer {served.token}"}
    address = f"{served.address}/api/events"
    try:
        with httpx.stream("GET", address, headers=headers) as events:
            lines = events.iter_lines()
            assert next(lines) == "data: {}"
            served.process.send_signal(signal.SIGINT)
            assert "".join(lines) == ""  # and an end, not a connection that was cut
        assert served.process.wait(30) == 0
    finally:
        served.end()
    link, *rest = (tmp_path / "console.log").read_text().splitlines()
    assert link.startswith("console of ")
    assert rest == ["console closed"]


def test_the_console_stays_up_beside_floods_and_half_requests(served):
    idle = [socket.create_connection(("127.0.0.1", served.port)) for _ in range(40)]
    for each in idle:
        each.sendall(b"POST /api/goal HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Le")
    headers = {"authorization": f"Bearer {served.token}"}
    with socket.create_connection(("127.0.0.1", served.port)) as flood:
        head = f"PUT /api/recordings?name=x HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
        head += f"authorization: {headers['authorization']}\r\ncontent-length: 100000000\r\n\r\n"
        flood.sendall(head.encode())
        assert b"413" in flood.recv(100)
    assert httpx.get(f"{served.address}/api/state", headers=headers).status_code == 200
    deadline = time.monotonic() + 60
    for each in idle:  # closed by the console, not by us
        each.settimeout(max(1.0, deadline - time.monotonic()))
        assert each.recv(1000) == b""
        each.close()
    assert httpx.get(f"{served.address}/api/state", headers=headers).status_code == 200
