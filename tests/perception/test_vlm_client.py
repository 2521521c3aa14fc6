"""Requests as a real server receives them, and what becomes of its failures."""

from __future__ import annotations

import json
import random
import re
import socketserver
import threading
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError, EndpointError
from prior_reinforce.perception.vlm_client import OpenAIClient, VisionLanguageModelConfig
from tests.perception.slanted_table import BALL, GOAL
from tests.perception.vision_server import VisionServer, vlm_file

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


@pytest.mark.parametrize(
    "refusal",
    [
        {"error": "quota exceeded"},
        {"error": {"message": "quota exceeded", "code": 1113}},
        {"choices": [], "error": {"message": "quota exceeded"}},
        {"detail": "quota exceeded"},
        {"message": "quota exceeded"},
    ],
)
def test_a_refusal_with_http_200_is_told_in_the_servers_words(refusal):
    with (
        endpoint(lambda file: file.write(body(refusal))) as (address, _),
        pytest.raises(EndpointError, match="refuses with HTTP 200: quota exceeded; see"),
    ):
        ask(address)


def test_what_is_no_completion_is_shown_as_it_came():
    native = {"candidates": [{"content": "It is there."}], "error": None}
    with (
        endpoint(lambda file: file.write(body(native))) as (address, _),
        pytest.raises(EndpointError, match=r'completion \(\{"candidates": .*ends in /v1'),
    ):
        ask(address)


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


@pytest.mark.parametrize("part", [slice(100), slice(8), slice(30, 60), slice(-8, None)])
def test_a_part_of_a_key_is_not_kept_either(monkeypatch, part):
    key = "".join(random.Random(0).choices("abcdefghijklmnopqrstuvwxyz0123456789", k=164))
    monkeypatch.setenv("A_KEY", key)
    said = f"you sent {key[part]}x, and then {key[part]}"
    completion = {"choices": [{"message": {"content": said}, "finish_reason": said}]}
    with endpoint(lambda file: file.write(body(completion))) as (address, _):
        found = ask(address, api_key_variable="A_KEY")
    assert found.text == found.finish_reason == "you sent ***x, and then ***"


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


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


COMPLETION = {"choices": [{"message": {"content": "[[1, 2, 3, 4]]"}, "finish_reason": "stop"}]}


def refused(address, **settings):
    with pytest.raises(EndpointError) as caught:
        ask(address, **settings)
    said = str(caught.value)
    assert "\n" not in said
    return said


@pytest.mark.parametrize(
    ("status", "words", "remedy"),
    [
        (b"429 No", "You exceeded your current quota, please check your plan", "quota"),
        (b"402 Pay", "Insufficient balance", "log"),
        (b"403 No", "Your country is not supported", "what the key may do"),
        (b"413 Big", "Request entity too large", "lower max_image_side"),
        (b"401 No", "Incorrect API key provided", "api_key_variable"),
        (b"400 Bad", "API key not valid. Please pass a valid API key.", "api_key_variable"),
        (b"404 No", "The model `x` has been deprecated", "base_url and model"),
        (b"400 Bad", "Unsupported parameter: 'max_tokens'", "leave_out = ['max_tokens']"),
        (b"400 Bad", "Unsupported value: 'temperature' is 1 alone", "leave_out = ['temperature']"),
        (b"422 Bad", "chat_template_kwargs: extra fields", "leave_out = ['chat_template_kwargs']"),
        (b"500 Oh", "CUDA out of memory", "server's log"),
        (b"402 Pay", "Insufficient credits", "credit"),
        (b"503 No", "Loading model", "wait a minute"),
        (b"400 Bad", "This model's maximum context length is 4096 tokens", "longer context"),
    ],
)
@pytest.mark.parametrize("form", ["error", "list", "bare", "detail", "text"])
def test_a_refusal_has_the_servers_own_words_and_a_remedy(status, words, remedy, form):
    reply = {
        "error": {"error": {"message": words, "code": "x"}},
        "list": [{"error": {"message": words, "code": "x"}}],
        "bare": {"message": words},
        "detail": {"detail": words},
        "text": words.encode(),
    }[form]
    content = body(reply).replace(b"200 OK", status)
    with endpoint(lambda file: file.write(content)) as (address, _):
        said = refused(address)
    assert f": {words[:60]}" in said
    assert remedy in said


def test_a_server_that_asks_for_an_hour_is_told_with_the_hour_and_the_requests_that_were_sent():
    content = body({"error": {"message": "slow down"}}, Retry_After="3600")
    content = content.replace(b"200 OK", b"429 No")
    with endpoint(lambda file: file.write(content)) as (address, requests):
        said = refused(address, max_retries=2)
    sent = len(requests)  # which of them depends on the client's version
    assert ("after one try" if sent == 1 else f"after {sent} tries") in said
    assert "3600 s" in said


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("19.5", "wait 20 s"),
        ("Wed, 21 Oct 2026 07:28:00 GMT", "until 21 October 07:28"),
        ("soon", "wait a minute"),
        ("nan", "wait a minute"),
        ("inf", "wait a minute"),
    ],
)
def test_how_long_a_server_asks_to_wait_is_told(asked, told):
    content = body({"error": {"message": "slow down"}}, Retry_After=asked)
    with endpoint(lambda file: file.write(content.replace(b"200 OK", b"429 No"))) as (address, _):
        assert told in refused(address)


def test_a_refusal_is_cut_between_words():
    words = "max_tokens is too large: " + "2048 > 4096 - 3000 and so on " * 30
    content = body({"error": {"message": words}}).replace(b"200 OK", b"400 Bad")
    with endpoint(lambda file: file.write(content)) as (address, _):
        shown = refused(address).partition(": max_")[2].partition(" ...;")[0]
    assert 200 < len(shown) < 300
    assert words.startswith(f"max_{shown} ")


def test_a_completion_behind_a_byte_order_mark_is_read():
    content = body(b"\xef\xbb\xbf" + json.dumps(COMPLETION).encode())
    with endpoint(lambda file: file.write(content)) as (address, _):
        assert ask(address).text == "[[1, 2, 3, 4]]"


def test_an_answer_of_another_protocol_is_no_refusal():
    native = {"model": "m", "message": {"role": "assistant", "content": "[1]"}, "done": True}
    with endpoint(lambda file: file.write(body(native))) as (address, _):
        said = refused(address)
    assert "refuses" not in said
    assert "/v1" in said.rpartition(";")[2]


def test_a_family_that_is_unknown_in_a_file_is_told_with_those_that_are_known(tmp_path):
    path = vlm_file(tmp_path, "http://127.0.0.1:8000/v1", family="llava")
    with pytest.raises(ConfigurationError, match=r"'llava'.*use one of glm-4\.5v, qwen2-vl, "):
        VisionLanguageModelConfig.load(path)
    path = vlm_file(tmp_path, "http://127.0.0.1:8000/v1", server="ollama")
    with pytest.raises(ConfigurationError, match=r"'ollama'.*use one of vllm, zai, plain"):
        VisionLanguageModelConfig.load(path)


@pytest.mark.parametrize(
    ("location", "leads", "remedy"),
    [
        (
            "https://gpu.example/v1/chat/completions",
            "https://gpu",
            "set base_url to https://gpu.exa",
        ),
        ("/api/v1/chat/completions", "/api/v1/chat", "/api/v1"),
        ("https://me:secret-7@gpu.example/v2/chat/completions", "https://gpu", "gpu.example/v2"),
        ("/login?next=x", "/login", "set api_key_variable"),
    ],
)
def test_a_redirection_says_where_it_leads(location, leads, remedy):
    content = body({}, Location=location).replace(b"200 OK", b"301 Moved")
    with endpoint(lambda file: file.write(content)) as (address, _):
        said = refused(address)
    assert leads in said
    assert said.endswith(remedy) or remedy in said
    assert "secret" not in said


def test_a_redirection_to_no_address_is_named():
    content = body({}, Location="http://[::1").replace(b"200 OK", b"301 Moved")
    with endpoint(lambda file: file.write(content)) as (address, _):
        said = refused(address)
    assert "301" in said or "location header" in said  # by the client, or by its HTTP library


def test_a_proxy_that_wants_a_password_is_named(monkeypatch):
    content = body(b"<html>Proxy Authentication Required</html>").replace(b"200 OK", b"407 No")
    with endpoint(lambda file: file.write(content)) as (address, _):
        monkeypatch.setenv("http_proxy", f"http://{address.removesuffix('/v1')}")
        for name in ("NO_PROXY", "no_proxy", "HTTP_PROXY"):
            monkeypatch.delenv(name, raising=False)
        said = refused("gpu.example/v1")
    assert "give it in http_proxy" in said


def test_a_field_to_leave_out_that_no_request_has_is_refused(tmp_path):
    path = vlm_file(tmp_path, "http://127.0.0.1:8000/v1")
    path.write_text(f'{path.read_text()}\nleave_out = ["max_token"]\n')
    with pytest.raises(ConfigurationError, match=r"leave_out.*use one of max_tokens, temp"):
        VisionLanguageModelConfig.load(path)
    with pytest.raises(ConfigurationError, match=r"leave_out.*max_token.*use one of max_tokens"):
        VisionLanguageModelConfig(leave_out=("max_token",))


def test_fields_that_a_server_refuses_are_left_out():
    with VisionServer() as server:
        kept = {"temperature", "max_tokens", "chat_template_kwargs", "skip_special_tokens"}
        for out in ((), ("max_tokens",), ("temperature", "skip_special_tokens")):
            address = server.base_url.removeprefix("http://")
            with suppress(EndpointError):
                ask(address, leave_out=out)
            assert kept & server.requests[-1].keys() == kept - {*out}


@pytest.mark.parametrize(
    ("message", "text", "thinking"),
    [
        ({"content": [{"type": "text", "text": "[[1,"}, {"text": " 2]]"}]}, "[[1, 2]]", None),
        ({"content": [{"type": "image"}]}, "", None),
        ({"content": [{"type": "output_text", "text": "[1]"}]}, "[1]", None),
        ({"tool_calls": [{"function": {"name": "f", "arguments": "{[1, 2]}"}}]}, "{[1, 2]}", None),
        ({"content": "", "tool_calls": [{"function": {"arguments": {"a": 1}}}]}, "{'a': 1}", None),
        ({"content": "[1]", "tool_calls": []}, "[1]", None),
        ({"content": [{"type": "reasoning", "text": "[1]"}, {"text": "no"}]}, "no", None),
        ({"content": None, "reasoning": "so"}, "", "so"),
        ({"content": "a", "reasoning_content": "so"}, "a", "so"),
        ({"content": None, "refusal": "I cannot"}, "I cannot", None),
    ],
)
def test_an_answer_may_come_in_parts_and_with_thoughts(message, text, thinking):
    with endpoint(lambda file: file.write(body({"choices": [{"message": message}]}))) as (
        address,
        _,
    ):
        answer = ask(address)
    assert (answer.text, answer.thinking) == (text, thinking)


@contextmanager
def encrypted(certificate):
    """An address that is spoken to by TLS."""
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*certificate)

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = True

    class Handler(socketserver.StreamRequestHandler):
        def setup(self):
            self.request = context.wrap_socket(self.request, server_side=True)
            super().setup()

        def handle(self):
            while (line := self.rfile.readline()).strip():
                if line.lower().startswith(b"content-length"):
                    length = int(line.partition(b":")[2])
            self.rfile.read(length)
            self.wfile.write(body(COMPLETION))

        def finish(self):
            super().finish()
            self.request.close()

    class Quiet(Server):
        def handle_error(self, *_):
            """A client that hangs up is what is tried here."""

    with Quiet(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield f"127.0.0.1:{server.server_address[1]}/v1"
        finally:
            server.shutdown()
            thread.join()


def test_why_a_server_cannot_be_reached_is_named(certificate):
    with encrypted(certificate) as address:
        secret = VisionLanguageModelConfig(f"https://{address}", max_retries=0)
        with pytest.raises(EndpointError, match=r"self.signed.*as certificate"):
            OpenAIClient(secret).ask("the ball", SQUARE)
        known = replace(secret, certificate=str(certificate[0]))
        assert OpenAIClient(known).ask("the ball", SQUARE).text == "[[1, 2, 3, 4]]"
        assert "http or https" in refused(address)  # without TLS
        other = replace(known, base_url=f"https://{address}".replace("127.0.0.1", "localhost"))
        with pytest.raises(EndpointError, match=r"base_url to the name.*certificate"):
            OpenAIClient(other).ask("the ball", SQUARE)
    for host in ("gpu-box.invalid:8000/v1", "127.0.0.1:9/v1"):
        said = refused(host)
        assert "cannot reach" in said
        assert re.search(r"\((?!Connection error).*(Errno|refused|resolution)", said), said


@pytest.mark.parametrize(("file", "says"), [("no.pem", "no.pem"), (__file__, "give a .pem")])
def test_a_certificate_that_is_none_is_named(file, says):
    with pytest.raises(ConfigurationError, match=says):
        OpenAIClient(VisionLanguageModelConfig(certificate=file))


@pytest.mark.parametrize("key", ["sk-abc\n", "sk-abc\r\n", "sk\u2013abc", "sk abc", "Bearer sk"])
def test_a_key_with_what_no_key_has_is_refused_unseen(monkeypatch, key):
    monkeypatch.setenv("A_KEY", key)
    with pytest.raises(ConfigurationError, match="variable A_KEY") as caught:
        OpenAIClient(VisionLanguageModelConfig(api_key_variable="A_KEY"))
    assert "abc" not in str(caught.value)


@pytest.mark.parametrize("name", ["ALL_PROXY", "https_proxy", "HTTP_PROXY"])
@pytest.mark.parametrize("proxy", ["socks5://127.0.0.1:1080", "socks4://127.0.0.1:7890"])
def test_a_proxy_that_is_not_understood_is_named_with_its_variable(monkeypatch, name, proxy):
    for other in ("ALL_PROXY", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY"):
        monkeypatch.delenv(other, raising=False)
        monkeypatch.delenv(other.lower(), raising=False)
    monkeypatch.setenv(name, proxy)
    with pytest.raises(ConfigurationError, match=rf"{name}.*unset it"):
        OpenAIClient(VisionLanguageModelConfig("https://192.0.2.7/v1"))


def test_a_proxy_that_refuses_is_named(monkeypatch):
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.delenv("NO_PROXY", raising=False)
    monkeypatch.delenv("no_proxy", raising=False)
    assert "HTTP_PROXY sets a proxy" in refused("192.0.2.7/v1")
