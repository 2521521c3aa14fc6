"""Requests as a real server receives them, and what becomes of its failures."""

from __future__ import annotations

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, EndpointError
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.rollouts import Rollout
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
        ({"votes": 0}, "0 votes"),
        ({"votes": 5, "most_requests": 4}, "5 votes in at most 4"),
        ({"spread_gate": 0.0}, "spread_gate = 0.0"),
        ({"timeout": -1.0}, "timeout = -1.0"),
        ({"max_retries": -1}, "max_retries = -1"),
        ({"temperature": float("nan")}, "temperature = nan"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(ConfigurationError, match=message):
        VisionLanguageModelConfig(**settings)
