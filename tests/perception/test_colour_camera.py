"""What is found by colour is where it was painted, and readings are right through outliers."""

from __future__ import annotations

import numpy as np
import pytest

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.perception.colour_camera import (
    ColourCamera,
    ColourClient,
    find_by_colour,
    say_box,
)
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.simulation.protocol import run_goals
from prior_reinforce.simulation.tasks import TASKS, make_task
from tests.perception.slanted_table import SCENE
from tests.perception.vision_server import VisionServer

RED, ORANGE, WOOD = (220, 30, 25), (245, 128, 25), (204, 178, 143)


def table(*boxes: tuple[tuple[int, int, int, int], tuple[int, int, int]]) -> np.ndarray:
    """A wooden table of 300 x 200 px with painted boxes (left, top, right, bottom)."""
    picture = np.full((200, 300, 3), WOOD, dtype=np.uint8)
    for (left, top, right, bottom), colour in boxes:
        picture[top:bottom, left:right] = colour
    return picture


def test_an_object_is_found_where_it_was_painted():
    picture = table(((30, 40, 60, 55), RED), ((200, 150, 215, 170), ORANGE))
    assert find_by_colour(picture, "the red hoop") == (30.0, 40.0, 60.0, 55.0)
    assert find_by_colour(picture, "the orange ball") == (200.0, 150.0, 215.0, 170.0)
    assert find_by_colour(picture, "the blue stone") is None


def test_pieces_belong_together_and_specks_do_not():
    pieces = table(((30, 40, 45, 60), RED), ((50, 40, 55, 60), RED), ((280, 5, 283, 8), RED))
    assert find_by_colour(pieces, "the red hoop") == (30.0, 40.0, 55.0, 60.0)
    assert find_by_colour(table(((280, 5, 283, 8), RED)), "the red hoop") is None


@pytest.mark.parametrize("words", ["Orange ball", "the ORANGE one", "the bright orange ball"])
def test_a_colour_may_begin_a_sentence_and_be_bright(words):
    box = (200, 150, 215, 170)
    assert find_by_colour(table((box, ORANGE)), words) == box


@pytest.mark.parametrize("words", ["the ball", "the red and blue ball", "the redder ball"])
def test_words_must_name_one_colour(words):
    with pytest.raises(ConfigurationError, match="it must name one of red, orange, blue, yellow"):
        find_by_colour(table(), words)


@pytest.mark.parametrize(
    ("family", "said"),
    [
        ("glm-4.5v", "The bounding box is <|begin_of_box|>[[100, 200, 200, 275]]<|end_of_box|>."),
        ("qwen3-vl", '```json\n[{"bbox_2d": [100, 200, 200, 275], "label": "the hoop"}]\n```'),
        # 300 x 200 px as the server's 308 x 196: multiples of 28.
        ("qwen2.5-vl", '```json\n[{"bbox_2d": [31, 39, 62, 54], "label": "the hoop"}]\n```'),
    ],
)
def test_a_box_is_said_in_the_familys_scale_by_hand(family, said):
    assert say_box((30.0, 40.0, 60.0, 55.0), (300, 200), "the hoop", family) == said


def test_the_same_questions_get_the_same_answers_and_a_share_of_them_is_astray():
    picture, runs = table(((30, 40, 60, 55), RED)), []
    for _ in range(2):
        client = ColourClient(outlier_rate=0.3, seed=2)
        runs.append([client.ask("the red hoop", picture).text for _ in range(40)])
    assert runs[0] == runs[1]
    clean = ColourClient().ask("the red hoop", picture).text
    assert 5 <= sum(text != clean for text in runs[0]) <= 19  # 12 expected, sd 2.9


@pytest.mark.slow
def test_it_reads_as_a_model_at_an_endpoint_that_finds_the_same(camera, calibration, picture):
    seeing = {"camera": camera, "calibration": calibration}
    for family in ("glm-4.5v", "qwen2.5-vl"):
        config = VisionLanguageModelConfig(family=family)
        here = ColourCamera(SCENE, config, outlier_rate=0.3, seed=4, **seeing).read(picture)
        with VisionServer(family, outlier_rate=0.3, seed=4) as server:
            config = VisionLanguageModelConfig(base_url=server.base_url, family=family)
            with VisionLanguageModel(SCENE, config, **seeing) as model:
                there = model.read(picture)
        np.testing.assert_array_equal(here.error_seen, there.error_seen)
        assert here.reached.answers == there.reached.answers
        assert here.model == "found by colour"


def test_settings_that_mean_nothing_are_refused():
    with pytest.raises(ConfigurationError, match="expected a share from 0 to 1"):
        ColourCamera(SCENE, outlier_rate=1.5)
    with pytest.raises(ConfigurationError, match="what to look for"):
        ColourCamera(None)


@pytest.fixture(
    scope="module", params=[each for each in TASKS.members if TASKS.resolve(each).scene]
)
def trials(request):
    """Four real trials of a task with their goals: half anywhere, half as near as they get."""
    task = make_task(request.param)
    rng = np.random.default_rng(11)
    plans = np.concatenate([task.demonstrations(name).plans[:3] for name in ("A", "B")])
    rollouts = [rollout for rollout in task.rollout(plans, rng) if rollout.valid][:4]
    assert len(rollouts) == 4
    goals = task.sample_goals(4, rng)
    goals[::2] = [r.outcome + rng.uniform(-0.08, 0.08, 2) for r in rollouts[::2]]
    return task.scene, list(zip(rollouts, goals, strict=True))


@pytest.mark.slow
def test_the_error_of_real_trials_is_seen_to_a_centimetre_through_outliers(trials):
    scene, pairs = trials
    rng = np.random.default_rng(0)
    with ColourCamera(scene, outlier_rate=0.1, seed=7) as perception:
        seen = [perception.perceive(rollout, goal, rng).error_seen for rollout, goal in pairs]
    truth = [rollout.outcome - goal for rollout, goal in pairs]
    assert np.linalg.norm(np.subtract(seen, truth), axis=1).max() < 0.01


@pytest.mark.slow
def test_outliers_cost_less_than_a_trial():
    # V1's demonstrations miss on V3's hardware by 5 cm: there is something to adapt.
    task = make_task("basketball-v3")
    prior = align(task.demonstrations("A")).demonstrations
    generator = SmoothInterpolation().fit(prior, seed=0)
    goals = task.sample_goals(4, np.random.default_rng(8))
    trials = []
    for rate in (0.0, 0.1):
        with ColourCamera(task.scene, outlier_rate=rate, seed=2) as perception:
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
        trials.append([result.solved_at or 7 for result in results])
    clean, spoilt = trials
    assert max(clean) <= 6  # every goal is reached through the pictures,
    assert np.mean(clean) >= 1.5  # and not by the first throw
    assert np.mean(spoilt) - np.mean(clean) < 1


@pytest.mark.parametrize("words", ["the light-blue ball", "a dark red cup", "what is not red"])
def test_a_shade_or_the_lack_of_a_colour_is_not_taken_for_the_colour(words):
    with pytest.raises(ConfigurationError, match="another colour"):
        find_by_colour(np.zeros((9, 9, 3), np.uint8), words)
