"""The whole way over HTTP with the real client: physics, pixels, boxes, metres; and all faults."""

from __future__ import annotations

import json

import numpy as np
import pytest
from slanted_table import RIM_HEIGHT
from vision_server import VisionServer

from prior_reinforce.adapters import GaussianProcessAdapter
from prior_reinforce.errors import ConfigurationError, EndpointError, PerceptionFailedError
from prior_reinforce.experiments.protocol import run_goals
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.perception.camera import Camera, CameraConfig
from prior_reinforce.perception.stand_in_server import StandInServer
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.plans.alignment import align
from prior_reinforce.rollouts import Rollout
from prior_reinforce.scene import SeenObject, TableScene, scene_of
from prior_reinforce.tasks import FAMILY, BasketballShotV3

SCENE = TableScene(
    SeenObject("the orange ball", 0.06), SeenObject("the red ring", 0.102), RIM_HEIGHT
)
BALL, GOAL = np.array([0.95, 0.20]), np.array([0.80, 0.08])
FAMILIES = ["glm-4.5v", "qwen2-vl", "qwen2.5-vl", "qwen3-vl"]
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def camera():
    camera = Camera(CameraConfig(width=640, height=480))
    yield camera
    camera.close()


@pytest.fixture(scope="module")
def picture(camera, frame_with_ball_at):
    return camera.picture(frame_with_ball_at(*BALL), GOAL)


@pytest.fixture(scope="module")
def calibration(camera, table_model):
    return camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)


@pytest.fixture
def looking(camera, calibration):
    """Make a perception that asks a server."""
    made = []

    def make(stand_in: VisionServer, **settings) -> VisionLanguageModel:
        settings = {"family": stand_in.family, "timeout": 5.0, **settings}
        config = VisionLanguageModelConfig(base_url=stand_in.base_url, **settings)
        made.append(VisionLanguageModel(SCENE, config, camera=camera, calibration=calibration))
        return made[-1]

    yield make
    for perception in made:
        perception._client.close()


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_sees_the_true_error(family, looking, frame_with_ball_at):
    with VisionServer(family) as server:
        perception = looking(server)
        for ball, goal in [(BALL, GOAL), (GOAL, BALL), ([0.5, -0.35], [1.2, 0.35])]:
            rollout = Rollout(np.array(ball), True, frame_with_ball_at(*ball))
            error_seen = perception.perceive(rollout, np.array(goal), RNG)
            np.testing.assert_allclose(error_seen, np.subtract(ball, goal), atol=0.004)


def test_a_large_picture_of_odd_shape_is_scaled_back(looking, table_model, frame_with_ball_at):
    camera = Camera(CameraConfig(width=1250, height=870))
    calibration = camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)
    with VisionServer("qwen2.5-vl") as server:
        config = VisionLanguageModelConfig(base_url=server.base_url, family="qwen2.5-vl")
        perception = VisionLanguageModel(SCENE, config, camera=camera, calibration=calibration)
        reading = perception.read(camera.picture(frame_with_ball_at(*BALL), GOAL))
        perception.close()
    np.testing.assert_allclose(reading.error_seen, BALL - GOAL, atol=0.002)


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


@pytest.mark.parametrize("family", ["glm-4.5v", "qwen2.5-vl"])
@pytest.mark.parametrize(
    "fault",
    [
        "swapped corners",
        "thinking in the text",
        "thinking kept apart",
        "draft before",
        "markers stripped",
        "markers leaked",
        "end marker lost",
        "bracket style",
    ],
)
def test_what_can_be_mended_costs_no_further_request(fault, family, looking, picture):
    with VisionServer(family, faults=[fault] * 6) as server:
        reading = looking(server).read(picture)
        assert len(server.requests) == 6
    np.testing.assert_allclose(reading.error_seen, BALL - GOAL, atol=0.003)


@pytest.mark.parametrize(
    "fault",
    [
        "refusal",
        "empty",
        "truncated",
        "out of range",
        "no area",
        "whole picture",
        "thinking without end",
        "two objects",
        "null content",
    ],
)
def test_an_unreadable_answer_is_asked_again_and_if_it_stays_the_operator(fault, looking, picture):
    with VisionServer(faults=[fault, None, None, None, None, fault]) as server:
        reading = looking(server).read(picture)
        assert len(server.requests) == 8
    np.testing.assert_allclose(reading.error_seen, BALL - GOAL, atol=0.003)
    assert reading.reached.answers[0].problem

    with VisionServer(faults=[fault] * 20) as server:
        reading = looking(server, most_requests=4).read(picture)
        assert len(server.requests) == (3 if fault == "empty" else 4)
    assert reading.error_seen is None
    assert "the orange ball" in reading.problem
    assert reading.goal is None


def test_an_outlier_among_three_votes_changes_nothing_and_all_outliers_give_no_number(
    looking, picture
):
    with VisionServer(faults=[None, "outlier", None, "outlier", None, None]) as server:
        clean = looking(server).read(picture)
        assert len(server.requests) == 6
    np.testing.assert_allclose(clean.error_seen, BALL - GOAL, atol=0.003)

    with VisionServer(outlier_rate=1.0, seed=3) as server:
        reading = looking(server).read(picture)
        assert len(server.requests) == 7
    assert reading.error_seen is None
    assert "7 answers do not agree on a place to 1 cm" in reading.problem


def test_ten_per_cent_outliers_never_get_through(looking, picture):
    n_readings = 60
    with VisionServer(outlier_rate=0.1, seed=5) as server:
        perception = looking(server)
        errors = [perception.read(picture).error_seen for _ in range(n_readings)]
    seen = [error for error in errors if error is not None]
    np.testing.assert_allclose(seen, np.tile(BALL - GOAL, (len(seen), 1)), atol=0.003)
    assert len(seen) >= n_readings - 1  # four outliers of seven: about 1 in 200 readings


@pytest.fixture(scope="module", params=FAMILY, ids=lambda kind: kind.name)
def trials(request):
    """Six real trials of a task with their goals: half anywhere, half as near as they get."""
    task = request.param()
    rng = np.random.default_rng(11)
    plans = np.concatenate([task.demonstrations(name).plans[:4] for name in ("A", "B")])
    rollouts = [rollout for rollout in task.rollout(plans, rng) if rollout.valid][:6]
    assert len(rollouts) == 6
    goals = task.sample_goals(6, rng)
    goals[::2] = [r.outcome + rng.uniform(-0.08, 0.08, 2) for r in rollouts[::2]]
    return scene_of(task.name), list(zip(rollouts, goals, strict=True))


@pytest.mark.slow
def test_the_error_of_real_trials_is_seen_to_a_centimetre_through_outliers(trials):
    scene, pairs = trials
    with VisionServer(outlier_rate=0.1, seed=7) as server:
        config = VisionLanguageModelConfig(base_url=server.base_url)
        perception = VisionLanguageModel(scene, config)
        seen = [perception.perceive(rollout, goal, RNG) for rollout, goal in pairs]
        perception.close()
        assert len(server.requests) >= 6 * len(pairs)
    truth = [rollout.outcome - goal for rollout, goal in pairs]
    assert np.linalg.norm(np.subtract(seen, truth), axis=1).max() < 0.01


@pytest.mark.slow
def test_outliers_cost_less_than_a_trial():
    # V1's demonstrations miss on V3's hardware by 5 cm: there is something to adapt.
    task = BasketballShotV3()
    prior = align(task.demonstrations("A")).demonstrations
    generator = SmoothInterpolation().fit(prior, seed=0)
    goals = task.sample_goals(6, np.random.default_rng(8))
    trials = []
    for rate in (0.0, 0.1):
        with StandInServer(outlier_rate=rate, seed=2) as server:
            config = VisionLanguageModelConfig(base_url=server.base_url)
            perception = VisionLanguageModel(scene_of(task.name), config)
            results = run_goals(
                task,
                generator,
                GaussianProcessAdapter,
                perception,
                prior,
                goals,
                rounds=6,
                seed=0,
            )
            perception.close()
        trials.append([result.solved_at or 7 for result in results])
    clean, spoilt = trials
    assert max(clean) <= 6  # every goal is reached through the pictures,
    assert np.mean(clean) >= 1.5  # and not by the first throw
    assert np.mean(spoilt) - np.mean(clean) < 1


def test_a_goal_beside_its_object_is_told_apart(looking, picture, camera, calibration):
    scene = TableScene(SCENE.reached, SCENE.goal, RIM_HEIGHT, goal_offset=(-0.08, 0.01))
    with VisionServer() as server:
        config = looking(server).config
        perception = VisionLanguageModel(scene, config, camera=camera, calibration=calibration)
        error_seen = perception.read(picture).error_seen
        perception._client.close()
    np.testing.assert_allclose(error_seen, BALL - GOAL - [-0.08, 0.01], atol=0.003)


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


def test_a_lost_ball_is_named(looking, frame_with_ball_at):
    with VisionServer() as server:
        perception = looking(server)
        for place in [(3.0, 0.0, 0.03), (0.95, 0.2, -0.3)]:  # out of the picture; under the table
            rollout = Rollout(np.array([3.0, 0.0]), False, frame_with_ball_at(*place))
            with pytest.raises(
                PerceptionFailedError, match="orange ball is not in the pic"
            ) as told:
                perception.perceive(rollout, GOAL, RNG)
            assert not isinstance(told.value, EndpointError)  # it answered
        assert len(server.requests) == 6


def test_the_record_keeps_every_answer_and_draws_the_boxes(looking, picture, tmp_path):
    with VisionServer(faults=[None, "outlier", "refusal"]) as server:
        perception = looking(server)
        reading = perception.read(picture)
    assert perception.last_reading is reading
    reading.save(tmp_path, "trial-3")
    record = json.loads((tmp_path / "trial-3.json").read_text())
    answers = record["reached"]["answers"]
    assert [bool(answer["problem"]) for answer in answers] == [False, False, True, False]
    assert "I'm sorry" in answers[2]["text"]
    np.testing.assert_allclose(record["error_seen_m"], BALL - GOAL, atol=0.003)
    assert (tmp_path / "trial-3.png").stat().st_size > 1000

    drawn = reading.drawn()
    assert drawn.shape == picture.shape
    left, top, right, bottom = map(round, reading.reached.box)
    assert (drawn[(top + bottom) // 2, left - 2] == (0, 90, 255)).all()
    assert (drawn[top - 2, (left + right) // 2] == (0, 90, 255)).all()
    assert reading.picture is picture


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


def test_what_cannot_be_seen_is_refused_before_anyone_is_asked(
    looking, picture, camera, frame_with_ball_at, monkeypatch
):
    with VisionServer() as server:
        perception = looking(server)
        rollout = Rollout(BALL, True, frame_with_ball_at(*BALL))
        with pytest.raises(ConfigurationError, match=r"goal of shape \(3,\)"):
            perception.perceive(rollout, np.zeros(3), RNG)
        with pytest.raises(PerceptionFailedError, match="no key frame"):
            perception.perceive(Rollout(BALL, True), GOAL, RNG)
        uncalibrated = VisionLanguageModel(SCENE, perception.config, camera=camera)
        with pytest.raises(ConfigurationError, match="not calibrated"):
            uncalibrated.read(picture)
        assert server.requests == []
    monkeypatch.delenv("NO_SUCH_KEY", raising=False)
    with pytest.raises(ConfigurationError, match="NO_SUCH_KEY is not set"):
        VisionLanguageModel(SCENE, VisionLanguageModelConfig(api_key_variable="NO_SUCH_KEY"))
    with pytest.raises(ConfigurationError, match="of 0 m"):
        SeenObject("the ball", 0)
    with pytest.raises(ConfigurationError, match="'bowling', only for basketball-v1, "):
        scene_of("bowling")
