"""Requests as a real server receives them, and what becomes of its failures."""

from __future__ import annotations

import json
import socketserver
import threading
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError, EndpointError
from prior_reinforce.perception.vlm_client import OpenAIClient, VisionLanguageModelConfig
from tests.perception.slanted_table import BALL, GOAL
from tests.perception.vision_server import VisionServer

RNG = np.random.default_rng(0)


def test_the_request_asks_for_one_object_and_switches_thinking_off(looking, picture, monkeypatch):
    monkeypatch.setenv("A_KEY", "secret-7")
    bodies = {}
    for server_kind in ("vllm", "zai", "plain"):
        with VisionServer() as server:
            looking(server, server=server_kind, api_key_variable="A_KEY").read(picture)
            bodies[server_kind] = server.requests[0]
            assert server.headers[0]["authorization"] == "Bearer secret-7"
            prompts = [body["messages"][0]["content"][1]["text"] for body in server.requests]
    assert bodies["vllm"]["chat_template_kwargs"] == {"enable_thinking": False}
    assert bodies["zai"]["thinking"] == {"type": "disabled"}
    assert not {"thinking", "chat_template_kwargs"} & bodies["plain"].keys()
    assert [prompt.count("orange ball") for prompt in prompts] == [1, 1, 1, 0, 0, 0]
    assert [prompt.count("red ring") for prompt in prompts] == [0, 0, 0, 1, 1, 1]


@pytest.mark.parametrize("fault", ["http 429", "http 500", "dropped", "timeout"])
def test_a_passing_failure_of_the_server_is_retried(fault, looking, picture):
    with VisionServer(faults=[fault]) as server:
        reading = looking(server, timeout=0.5, votes=1).read(picture)
        assert len(server.requests) == 3
    np.testing.assert_allclose(reading.error_seen, BALL - GOAL, atol=0.003)


@pytest.mark.parametrize(
    ("fault", "message", "n_requests"),
    [
        ("http 429", "HTTP 429.* after 2 tries", 2),
        ("http 500", "failed with HTTP 500", 2),
        ("dropped", "cannot reach .* after 2 tries", 2),
        ("timeout", "no answer from .* in 0.3 s after 2 tries", 2),
        ("http 401", "set api_key_variable", 1),
        ("http 404", "does not serve model 'zai-org/GLM-4.5V'", 1),
        ("web page", "not with a chat completion", 1),
        ("no choices", "not with a chat completion", 1),
    ],
)
def test_a_lasting_failure_asks_the_operator(
    fault, message, n_requests, looking, frame_with_ball_at
):
    with VisionServer(faults=[fault] * 20) as server:
        perception = looking(server, timeout=0.3, max_retries=1)
        with pytest.raises(EndpointError, match=message) as failure:
            perception.perceive(Rollout(BALL, True, frame_with_ball_at(*BALL)), GOAL, RNG)
        assert len(server.requests) == n_requests
    assert "the orange ball" in str(failure.value)
    assert "ask the operator" in str(failure.value)
    assert "\n" not in str(failure.value)


def test_no_server_at_all_asks_the_operator(looking, picture):
    with VisionServer() as server:
        perception = looking(server, max_retries=0)
    assert "is the server running?" in perception.read(picture).problem


def test_a_server_on_this_machine_is_asked_without_the_proxy_for_others(
    looking, picture, monkeypatch
):
    monkeypatch.delenv("NO_PROXY", raising=False)
    monkeypatch.delenv("no_proxy", raising=False)
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")  # nobody listens there
    with VisionServer() as server:
        reading = looking(server, max_retries=0, votes=1).read(picture)
    np.testing.assert_allclose(reading.error_seen, BALL - GOAL, atol=0.003)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"family": "gpt"}, "family 'gpt' is unknown; use one of glm"),
        ({"votes": 0}, "votes: Expected `int` >= 1, got 0"),
        ({"votes": 5, "most_requests": 4}, "5 votes in at most 4"),
        ({"spread_gate": 0.0}, "spread_gate: Expected `float` > 0.0, got 0.0"),
        ({"timeout": -1.0}, "timeout: Expected `float` > 0.0, got -1.0"),
        ({"max_retries": -1}, "max_retries: Expected `int` >= 0, got -1"),
        ({"temperature": float("nan")}, "temperature: Expected a finite number, got nan"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(ConfigurationError, match=message):
        VisionLanguageModelConfig(**settings)


SQUARE = np.zeros((8, 8, 3), dtype=np.uint8)
OK = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"


@contextmanager
def endpoint(reply):
    """An address where `reply` gets each connection's writing end after the request's head."""
    requests = []

    class Handler(socketserver.StreamRequestHandler):
        def handle(self):
            head = []
            while (line := self.rfile.readline()).strip():
                head.append(line.decode())
            requests.append(head)
            length = next(line for line in head if line.lower().startswith("content-length"))
            self.rfile.read(int(length.partition(":")[2]))
            with suppress(OSError):  # nobody listens any more
                reply(self.wfile)

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = True

    with Server(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield f"127.0.0.1:{server.server_address[1]}/v1", requests
        finally:
            server.shutdown()
            thread.join()


def ask(address, **settings):
    how = {"max_retries": 0, "timeout": 10.0} | settings
    client = OpenAIClient(VisionLanguageModelConfig(base_url=f"http://{address}", **how))
    try:
        return client.ask("the ball", SQUARE)
    finally:
        client.close()


def body(content, **head):
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    more = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in head.items())
    return OK + more.encode() + f"Content-Length: {len(data)}\r\n\r\n".encode() + data


def test_the_picture_goes_to_no_other_host():
    with endpoint(lambda file: file.write(body({}))) as (elsewhere, requests):
        moved = f"Moved\r\nLocation: http://{elsewhere}".encode()
        content = body({}).replace(b"200 OK", b"307 " + moved)
        with (
            endpoint(lambda file: file.write(content)) as (address, _),
            pytest.raises(EndpointError, match="HTTP 307"),
        ):
            ask(address)
        assert not requests


@pytest.mark.parametrize("length", [25, 164])
@pytest.mark.parametrize("status", [b"200 OK", b"400 Bad", b"401 No", b"500 Oh"])
def test_a_key_that_is_sent_back_is_not_kept(monkeypatch, status, length):
    key = "sk-very-secret-0123456789".ljust(length, "x")
    monkeypatch.setenv("A_KEY", key)
    said = f"you sent Bearer {key}"
    message = {"content": said, "reasoning_content": said}
    completion = {"choices": [{"message": message, "finish_reason": said}]}
    content = body(completion | {"error": {"message": said}}).replace(b"200 OK", status)
    with endpoint(lambda file: file.write(content)) as (address, requests):
        try:
            found = repr(ask(address, api_key_variable="A_KEY"))
        except EndpointError as error:
            found = f"{error} {error.__cause__!r} {error.__suppress_context__}"
    assert any(key in line for line in requests[0])
    assert "secret" not in found


def test_a_password_in_the_address_is_in_no_message():
    with (
        endpoint(lambda file: file.write(body({}))) as (address, _),
        pytest.raises(EndpointError) as caught,
    ):
        ask(f"user:hunter2@{address}?token=hunter3#hunter4")
    assert "hunter" not in str(caught.value)
    assert address.partition("/")[0] in str(caught.value)


@pytest.mark.parametrize(
    "url",
    [
        "http://u:hunter@hunter@host/v1",
        "http://u:hunter/hunter@host/v1",
        "http:/u:hunter@host",
        "u:hunter@host",
        "http://u:hunter?@host/v1",
        "http://u:hunter#@host/v1",
        "ftp://host/v1?token=hunter",
    ],
)
def test_an_address_that_cannot_be_taken_apart_is_refused_unseen(url):
    with pytest.raises(ConfigurationError, match="is no address") as caught:
        VisionLanguageModelConfig(base_url=url)
    assert "hunter" not in str(caught.value)


def test_a_text_that_no_file_can_hold_is_a_failed_reading():
    content = body(b'{"choices": [{"message": {"content": "\\ud800"}}]}')
    with endpoint(lambda file: file.write(content)) as (address, _), pytest.raises(EndpointError):
        ask(address)


@pytest.mark.parametrize("url", ["", "127.0.0.1:8000", "http://", "http://[::1", "http://a:b/v1"])
def test_what_is_no_address_is_refused(url):
    with pytest.raises(ConfigurationError, match="is no address"):
        VisionLanguageModelConfig(base_url=url)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda each: (
        st.lists(each, max_size=3) | st.dictionaries(st.text(max_size=9), each, max_size=3)
    ),
    max_leaves=6,
)
messages = st.fixed_dictionaries(
    {}, optional={"content": anything, "reasoning_content": anything, "role": anything}
)
choices = st.fixed_dictionaries(
    {}, optional={"message": messages | anything, "finish_reason": anything, "index": anything}
)
replies = st.fixed_dictionaries({}, optional={"choices": st.lists(choices | anything) | anything})


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.one_of(replies, anything, st.binary(max_size=30)))
def test_any_reply_is_an_answer_or_a_failed_reading(reply):
    content = reply if isinstance(reply, bytes) else json.dumps(reply).encode()
    with endpoint(lambda file: file.write(body(content))) as (address, _):
        try:
            said = ask(address).text
        except EndpointError as error:
            said = str(error).replace("\n", "more than a line")
    assert isinstance(said, str)
    assert "more than a line" not in said


def test_a_reply_nested_beyond_all_depth_is_a_failed_reading():
    content = body(b'{"choices":' + b"[" * 100_000 + b"]" * 100_000 + b"}")
    with endpoint(lambda file: file.write(content)) as (address, _), pytest.raises(EndpointError):
        ask(address)
