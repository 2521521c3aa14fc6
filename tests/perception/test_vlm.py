"""The whole way over HTTP with the real client: physics, pixels, boxes, metres; and all faults."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw

from prior_reinforce.environment import Rollout, SeenObject, TableScene
from prior_reinforce.errors import ConfigurationError, EndpointError, PerceptionFailedError
from prior_reinforce.perception.calibration import CAMERA_SD, TableCalibration
from prior_reinforce.perception.camera import Camera, CameraConfig
from prior_reinforce.perception.colour_camera import ColourClient, find_by_colour, say_box
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.perception.vlm_reading import Answer, Sighting
from tests.perception.slanted_table import BALL, GOAL, RIM_HEIGHT, SCENE
from tests.perception.vision_server import VisionServer

FAMILIES = ["glm-4.5v", "qwen2-vl", "qwen2.5-vl", "qwen3-vl", "gemini"]
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_sees_the_true_error(family, looking, frame_with_ball_at):
    with VisionServer(family) as server:
        perception = looking(server)
        for ball, goal in [(BALL, GOAL), (GOAL, BALL), ([0.5, -0.35], [1.2, 0.35])]:
            rollout = Rollout(np.array(ball), True, frame_with_ball_at(*ball))
            error_seen = perception.perceive(rollout, np.array(goal), RNG).error_seen
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


def test_ten_per_cent_outliers_never_get_through(picture, camera, calibration):
    n_readings, client = 60, ColourClient(outlier_rate=0.1, seed=5)
    perception = VisionLanguageModel(SCENE, client=client, camera=camera, calibration=calibration)
    errors = [perception.read(picture).error_seen for _ in range(n_readings)]
    seen = [error for error in errors if error is not None]
    np.testing.assert_allclose(seen, np.tile(BALL - GOAL, (len(seen), 1)), atol=0.003)
    assert len(seen) >= n_readings - 1  # four outliers of seven: about 1 in 200 readings


def test_a_goal_beside_its_object_is_told_apart(looking, picture, camera, calibration):
    scene = TableScene(SCENE.reached, SCENE.goal, RIM_HEIGHT, goal_offset=(-0.08, 0.01))
    with VisionServer() as server:
        config = looking(server).config
        perception = VisionLanguageModel(scene, config, camera=camera, calibration=calibration)
        error_seen = perception.read(picture).error_seen
        perception._client.close()
    np.testing.assert_allclose(error_seen, BALL - GOAL - [-0.08, 0.01], atol=0.003)


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
    with pytest.raises(ConfigurationError, match="TableScene with your objects' names"):
        VisionLanguageModel(None)


@pytest.mark.parametrize("config", [CameraConfig(width=960, height=540), CameraConfig()])
@pytest.mark.parametrize(
    ("said", "believed"),
    [("glm-4.5v", "qwen2.5-vl"), ("qwen2.5-vl", "qwen3-vl"), ("qwen2.5-vl", "glm-4.5v")],
)
def test_another_scale_than_the_familys_gives_no_number(
    said, believed, config, table_model, frame_with_ball_at
):
    """Both boxes say so together: too small or large, or as flat as the picture."""
    camera = Camera(config)
    calibration = camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)
    picture = camera.picture(frame_with_ball_at(*BALL), GOAL)
    how = VisionLanguageModelConfig(family=believed)
    with VisionLanguageModel(
        SCENE, how, client=ColourClient(said), camera=camera, calibration=calibration
    ) as perception:
        reading = perception.read(picture)
    if config.width == config.height:  # 896 pixels for 1000 thousandths: an error of a tenth
        true = BALL - GOAL
        assert reading.error_seen is None or np.abs(reading.error_seen - true).max() < 0.02
    else:
        assert reading.error_seen is None
        assert "family" in reading.problem


class Says(ColourClient):
    """Says the boxes in another order or of another size."""

    def __init__(self, said="glm-4.5v", *, swaps=False, loose=((1, 1), (1, 1))):
        super().__init__(said)
        self.said, self.swaps, self.loose = said, swaps, loose

    def ask(self, words, picture):
        size = picture.shape[1], picture.shape[0]
        left, top, right, bottom = find_by_colour(picture, words)
        wide, tall = np.multiply(self.loose[int("ring" in words)], (right - left, bottom - top)) / 2
        x, y = (left + right) / 2, (top + bottom) / 2
        said = say_box((x - wide, y - tall, x + wide, y + tall), size, words, self.said)
        if self.swaps:
            said = re.sub(r"(\d+), (\d+), (\d+), (\d+)", r"\2, \1, \4, \3", said)
        return Answer(said, None, "stop")


@pytest.fixture(scope="module")
def wide(table_model, frame_with_ball_at):
    """A picture of 16 : 9 with its calibration."""
    with_camera = Camera(CameraConfig(width=960, height=540))
    calibration = with_camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)
    picture = with_camera.picture(frame_with_ball_at(*BALL), GOAL)
    with_camera.close()
    return picture, calibration


class SaysTheBall(ColourClient):
    """Gives the ball's box whatever it is asked for."""

    def ask(self, words, picture):
        return super().ask(SCENE.reached.words, picture)


def test_one_box_for_both_objects_gives_no_number(wide):
    picture, calibration = wide
    with VisionLanguageModel(SCENE, client=SaysTheBall("glm-4.5v"), calibration=calibration) as eye:
        reading = eye.read(picture)
    assert reading.error_seen is None
    assert "one box for both" in reading.problem


@pytest.mark.parametrize("size", [0.06, 0.065])
@pytest.mark.parametrize("jitter", [0, 2])
def test_one_box_for_two_objects_of_one_size_gives_no_number(size, jitter, flat):
    class SaysOne(ColourClient):
        def ask(self, words, picture):
            off = jitter if "blue" in words else 0
            return Answer(str([400 + off, 500 + off, 430 + off, 538 + off]), None, "stop")

    scene = TableScene(SeenObject("the red stone", 0.06), SeenObject("the blue stone", size), 0.0)
    with VisionLanguageModel(scene, client=SaysOne(), calibration=flat) as eye:
        reading = eye.read(painted())
    assert reading.error_seen is None
    assert "one box for both" in reading.problem


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((480, 640), np.uint8),
        np.zeros((480, 640, 1), np.uint8),
        np.zeros((480, 640, 4), np.uint8),
        np.zeros((480, 640, 3)),
        np.zeros((480, 640, 3), np.uint16),
        [[[0, 0, 0]]],
        None,
    ],
)
def test_an_array_that_is_no_rgb_picture_is_refused_with_what_it_should_be(wrong, calibration):
    perception = VisionLanguageModel(SCENE, client=ColourClient(), calibration=calibration)
    with pytest.raises(ConfigurationError, match=r"\(height, width, 3\) and uint8; convert it"):
        perception.read(wrong)


class Exchanges(ColourClient):
    """Gives the ring's box for the ball, and the ball's for the ring."""

    def ask(self, words, picture):
        other = SCENE.goal if words == SCENE.reached.words else SCENE.reached
        return super().ask(other.words, picture)


def test_two_objects_that_are_exchanged_give_no_number(wide):
    picture, calibration = wide
    with VisionLanguageModel(SCENE, client=Exchanges("glm-4.5v"), calibration=calibration) as eye:
        reading = eye.read(picture)
    assert reading.error_seen is None
    assert "fit only with the orange ball and the red ring exchanged" in reading.problem


LOOSE = [((1, 1), (1, 1)), ((1.2, 1.2), (1.2, 1.2)), ((0.85, 1.15), (1.1, 0.9))]


@pytest.mark.parametrize("loose", LOOSE)
@pytest.mark.parametrize(
    ("said", "believed", "remedy"),
    [
        ("glm-4.5v", "glm-4.5v", "gemini"),
        ("qwen3-vl", "qwen3-vl", "gemini"),
        ("gemini", "gemini", "glm-4.5v or qwen2-vl or qwen3-vl"),
    ],
)
def test_boxes_with_x_and_y_swapped_give_no_number_and_name_the_families(
    said, believed, remedy, loose, wide
):
    picture, calibration = wide
    client, how = Says(said, swaps=True, loose=loose), VisionLanguageModelConfig(family=believed)
    perception = VisionLanguageModel(SCENE, how, client=client, calibration=calibration)
    reading = perception.read(picture)
    assert reading.error_seen is None
    assert "only with x and y swapped" in reading.problem
    assert reading.problem.rstrip(")").endswith(f"set family to {remedy}")


@pytest.mark.parametrize("size", [(640, 480), (1280, 960)])
@pytest.mark.parametrize("loose", [*LOOSE[:2], ((0.95, 1.05), (1.05, 0.95))])
def test_swapped_boxes_are_told_in_a_picture_of_4_to_3_too(
    size, loose, table_model, frame_with_ball_at
):
    with_camera = Camera(CameraConfig(width=size[0], height=size[1]))
    calibration = with_camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)
    picture = with_camera.picture(frame_with_ball_at(*BALL), GOAL)
    with_camera.close()
    client, how = Says(swaps=True, loose=loose), VisionLanguageModelConfig()
    with VisionLanguageModel(SCENE, how, client=client, calibration=calibration) as perception:
        problem = perception.read(picture).problem
    assert "only with x and y swapped" in problem


def test_the_family_that_is_named_for_swapped_boxes_reads_them(wide):
    picture, calibration = wide
    how = VisionLanguageModelConfig(family="gemini")
    client = Says("glm-4.5v", swaps=True)
    perception = VisionLanguageModel(SCENE, how, client=client, calibration=calibration)
    np.testing.assert_allclose(perception.read(picture).error_seen, BALL - GOAL, atol=0.004)


@pytest.mark.parametrize("size", [(960, 540), (640, 480), (600, 480), (720, 480)])
def test_loose_boxes_in_the_right_order_are_not_taken_for_swapped_ones(
    size, table_model, frame_with_ball_at
):
    with_camera = Camera(CameraConfig(width=size[0], height=size[1]))
    calibration = with_camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)
    picture = with_camera.picture(frame_with_ball_at(*BALL), GOAL)
    with_camera.close()
    how = VisionLanguageModelConfig(votes=1, spread_gate=1.0)
    for loose in np.random.default_rng(0).uniform(0.75, 1.3, size=(40, 2, 2)):
        client = Says(loose=loose)
        perception = VisionLanguageModel(SCENE, how, client=client, calibration=calibration)
        assert "swapped" not in (perception.read(picture).problem or "")


@pytest.fixture(scope="module")
def slanted():
    """A camera that looks at the table's middle, 30 degrees off the vertical, in 1920 x 1080 px."""
    return Slanted()


class Slanted:
    """Boxes in pixels of a picture that is not drawn, around two objects on the table."""

    def __init__(self):
        grid = np.array([(x, y) for x in (0.7, 1.0, 1.3) for y in (-0.4, 0.0, 0.4)])
        forward = np.array([0.5, 0.0, -np.sqrt(0.75)])
        right = np.array([0.0, -1.0, 0.0])
        axes = np.stack([right, np.cross(forward, right), forward], axis=1)
        seen = (np.insert(grid, 2, 0.0, axis=1) - ([1, 0, 0] - 1.8 * forward)) @ axes
        pixels = [960, 540] + 1300 * seen[:, :2] / seen[:, 2:]
        self.calibration = TableCalibration.fit(grid, pixels, picture=(1920, 1080))
        self.picture = np.zeros((1080, 1920, 3), np.uint8)

    def verdict(self, places, loose, *, swaps=False):
        """Why boxes so many times as large as a ball, and as a flat ring, are read wrongly."""
        how, found = VisionLanguageModelConfig(family="qwen2.5-vl"), []
        for i, wanted in enumerate((SCENE.reached, SCENE.goal)):
            centre = self.calibration.to_pixels(places[i])
            disc, ball = self.calibration.seen(centre, wanted.size)
            half = loose[i] * (disc if i else ball) / 2
            box = np.array([centre - half, centre + half])[:, :: -1 if swaps else 1].ravel()
            found.append(Sighting(wanted.words, (), tuple(box.tolist()), np.array(places[i])))
        with VisionLanguageModel(
            SCENE, how, client=ColourClient(), calibration=self.calibration
        ) as perception:
            return perception._misread(*found, self.picture)

    def scale(self, places, loose):
        """The scale that is told of round boxes so many times as large as flat rings there."""
        found = []
        for place, times, wanted in zip(places, loose, (SCENE.reached, SCENE.goal), strict=True):
            centre = self.calibration.to_pixels(np.array(place))
            half = times * self.calibration.seen(centre, wanted.size)[0] / 2
            box = np.array([centre - half, centre + half]).ravel()
            found.append(Sighting(wanted.words, (), tuple(box.tolist()), np.array(place)))
        with VisionLanguageModel(
            SCENE, client=ColourClient(), calibration=self.calibration
        ) as perception:
            return perception._scale(*found, self.picture)[0]


@pytest.mark.parametrize("times", [0.7, 0.85, 1.0, 1.2, 1.3, 1.5])
def test_one_scale_of_both_objects_is_told_by_a_slanted_camera_too(times, slanted):
    places = [(1.2, -0.3), (0.7, 0.2)]
    assert slanted.scale(places, (times, times)) == pytest.approx(times, abs=0.02)
    assert slanted.scale(places, (times, times + 0.4)) == 1.0  # none of both


def test_too_large_boxes_in_pixels_of_a_slanted_camera_are_not_taken_for_swapped_ones(slanted):
    rng, told = np.random.default_rng(0), []
    for _ in range(60):
        places = rng.uniform([0.6, -0.4], [1.3, 0.4], size=(2, 2))
        told.append(slanted.verdict(places, rng.uniform(1.15, 1.35, size=(2, 2))))
    assert not any("swapped" in problem for problem in told)


def test_swapped_boxes_of_which_no_family_is_read_say_so(slanted):
    places = [[1.3, -0.4], [1.2, -0.3]]
    problem = slanted.verdict(places, np.ones((2, 2)), swaps=True)
    assert "only with x and y swapped: 'qwen2.5-vl' is read x first" in problem
    assert problem.endswith("and no family is read so")
    assert "set family to" not in problem


@pytest.mark.parametrize("shrunk", [0.5, 0.65, 0.8])
def test_a_server_that_shrinks_the_picture_gives_no_number(shrunk, calibration, picture):
    class Shrinks(ColourClient):
        def ask(self, words, picture):
            tall, wide, _ = picture.shape
            small = Image.fromarray(picture).resize((int(wide * shrunk), int(tall * shrunk)))
            box = find_by_colour(np.asarray(small), words)
            return Answer(json.dumps({"bbox_2d": [round(v) for v in box]}), None, "stop")

    how = VisionLanguageModelConfig(family="qwen2.5-vl")
    reading = VisionLanguageModel(SCENE, how, client=Shrinks(), calibration=calibration).read(
        picture
    )
    assert reading.error_seen is None
    assert "max_image_side" in reading.problem
    assert "as large as that" not in reading.problem  # that is known


def test_a_picture_of_another_size_than_an_unknown_one_is_named_as_the_cause(calibration, picture):
    unsized = replace(calibration, picture=None)
    larger = np.asarray(Image.fromarray(picture).resize((960, 720)))
    perception = VisionLanguageModel(SCENE, client=ColourClient(), calibration=unsized)
    problem = perception.read(larger).problem
    assert "is the picture as large as that in which the camera was calibrated" in problem


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (Answer("", "It is at [1, 2, 3, 4].", "stop"), "in the thoughts"),
        (Answer("", None, "content_filter"), "content filter"),
        (Answer("I cannot assist with that.", None, "stop"), "I cannot assist"),
    ],
)
def test_an_answer_without_a_box_says_why(answer, says, calibration, picture):
    class Says(ColourClient):
        def ask(self, words, picture):
            return answer

    reading = VisionLanguageModel(SCENE, client=Says(), calibration=calibration).read(picture)
    assert says in reading.problem
    assert reading.reached.answers[0].thinking == answer.thinking


def test_a_picture_of_another_size_is_read_with_the_calibration_scaled(
    calibration, frame_with_ball_at
):
    larger = Camera(CameraConfig(width=960, height=720))
    picture = larger.picture(frame_with_ball_at(*BALL), GOAL)
    larger.close()
    perception = VisionLanguageModel(SCENE, client=ColourClient(), calibration=calibration)
    np.testing.assert_allclose(perception.read(picture).error_seen, BALL - GOAL, atol=0.003)
    with pytest.raises(ConfigurationError, match="calibrate again"):
        perception.read(np.ascontiguousarray(np.rot90(picture)))


def test_what_a_camera_tells_is_no_surer_than_its_calibration(calibration, frame_with_ball_at):
    rough = replace(calibration, left_out_error=0.14)
    with VisionLanguageModel(
        SCENE, client=ColourClient(), camera=Camera(CameraConfig(width=640, height=480)),
        calibration=rough,
    ) as perception:  # fmt: skip
        frame = frame_with_ball_at(*BALL)
        reading = perception.perceive(Rollout(BALL, True, frame), GOAL, RNG)
    np.testing.assert_allclose(reading.sd, 0.14)


@pytest.fixture(scope="module")
def flat():
    """A camera straight above (1, 0), 500 px a metre, in pictures of 1000 x 800 px."""
    grid = np.array([(x, y) for x in (0.6, 1.4) for y in (-0.6, 0.0, 0.6)])
    return TableCalibration.fit(grid, _flat_pixels(grid), picture=(1000, 800))


def _flat_pixels(places):
    return np.array([500, 400]) - 500 * (np.asarray(places)[..., ::-1] - [0, 1])


def painted(*discs, hidden=None):
    """Orange discs (x, y, radius), and what hides them: a rectangle (left, top, right, bottom)."""
    image = Image.new("RGB", (1000, 800), (204, 178, 143))
    pen = ImageDraw.Draw(image)
    for x, y, radius in discs:
        pen.circle(_flat_pixels([x, y]).tolist(), 500 * radius, fill=(245, 128, 25))
    if hidden is not None:
        pen.rectangle(hidden, fill=(204, 178, 143))
    return np.asarray(image)


def found_by_colour(picture, calibration, size, *, is_round=True):
    wanted = SeenObject("the orange ball", size, is_round)
    scene = TableScene(wanted, wanted, plane_height=0.0)
    with VisionLanguageModel(scene, client=ColourClient(), calibration=calibration) as eye:
        return eye.find(wanted, picture)


@pytest.mark.parametrize(
    ("place", "radius", "others", "hidden"),
    [
        ((1.0, 1.0), 0.03, (), None),  # half of it beyond the left border
        ((1.0, 0.992), 0.03, (), None),
        ((0.2, 0.0), 0.03, (), None),  # beyond the lower one
        ((1.0, 0.0), 0.03, (), (500, 0, 999, 799)),  # its right half is hidden
        ((1.0, 0.0), 0.10, (), (0, 0, 999, 400)),  # the upper half
        ((1.0, 0.0), 0.03, ((1.0, 0.045, 0.017),), None),  # another thing of its colour beside it
        ((1.0, 0.0), 0.03, ((1.035, 0.035, 0.017),), None),
    ],
)
def test_the_place_of_a_part_of_an_object_is_no_surer_than_it_is_right(
    place, radius, others, hidden, flat
):
    picture = painted((*place, radius), *others, hidden=hidden)
    seen = found_by_colour(picture, flat, 2 * radius)
    if seen.place is not None:
        wrong = np.abs(seen.place - place)
        assert wrong.max() > 2 * CAMERA_SD
        assert (wrong <= 1.3 * flat.sd_off(seen.off)).all()


@pytest.mark.parametrize("place", [(1.0, 0.0), (1.0, 0.969), (0.231, 0.0), (1.3, -0.5)])
@pytest.mark.parametrize("radius", [0.03, 0.1])
def test_a_whole_object_is_as_sure_as_the_calibration(place, radius, flat):
    place = np.array(place) + np.sign([1 - place[0], -place[1]]) * (radius - 0.03)
    seen = found_by_colour(painted((*place, radius)), flat, 2 * radius)
    np.testing.assert_allclose(seen.place, place, atol=0.003)
    np.testing.assert_array_equal(flat.sd_off(seen.off), flat.sd)


def test_a_flat_box_around_what_is_not_round_hides_nothing(flat):
    picture = painted((1.0, 0.0, 0.1), hidden=(0, 0, 999, 390)).copy()
    picture[410:] = picture[0, 0]
    assert flat.sd_off(found_by_colour(picture, flat, 0.2).off).max() > 0.05
    oblong = found_by_colour(picture, flat, 0.2, is_round=False)
    np.testing.assert_array_equal(flat.sd_off(oblong.off), flat.sd)


@pytest.mark.parametrize("shrunk", [1.0, 0.98, 0.97, 0.96, 0.95, 0.9, 0.85])
def test_a_distance_in_a_picture_that_is_shrunk_a_little_is_no_surer_than_it_is_right(shrunk, flat):
    ball, hoop = np.array([0.8, 0.32]), np.array([1.0, 0.05])

    class Shrinks(ColourClient):
        def ask(self, words, picture):
            place, radius = (ball, 0.03) if "ball" in words else (hoop, 0.1)
            box = shrunk * np.add.outer([-500 * radius, 500 * radius], _flat_pixels(place))
            return Answer(json.dumps({"bbox_2d": box.round().ravel().tolist()}), None, "stop")

    scene = TableScene(SeenObject("the ball", 0.06), SeenObject("the hoop", 0.2), 0.0)
    how = VisionLanguageModelConfig(family="qwen2.5-vl", max_image_side=1008)
    with VisionLanguageModel(scene, how, client=Shrinks(), calibration=flat) as eye:
        reading = eye.read(painted())
    if reading.error_seen is not None:
        wrong = np.abs(reading.error_seen - (ball - hoop))
        assert (wrong <= 1.5 * reading.sd).all()
        told_on_980_px = shrunk * 1000 / 980
        assert shrunk > 0.9 or reading.scale == pytest.approx(told_on_980_px, abs=0.03)


@pytest.mark.parametrize(
    ("times", "hidden", "is_round", "cause"),
    [
        (1.0, None, True, None),
        (1.15, None, True, None),  # as models draw boxes, on all sides alike
        (1.28, None, False, None),
        (1.5, None, True, "too large"),
        (1.0, (0, 0, 999, 400), True, "hidden"),
        (1.0, (0, 0, 999, 400), False, None),  # half a disc may be all of what is not round
        (1.0, (500, 0, 999, 799), True, "hidden"),
    ],
)
def test_a_box_that_may_be_beside_the_object_says_by_what(times, hidden, is_round, cause, flat):
    picture = painted((1.0, 0.0, 0.1 * times), hidden=hidden)
    seen = found_by_colour(picture, flat, 0.2, is_round=is_round)
    assert seen.off_by == cause
    assert (flat.sd_off(seen.off) > flat.sd).any() == (cause is not None)


def test_a_box_at_the_border_is_cut_whatever_the_object_is(flat):
    for is_round in (True, False):
        picture = painted((1.0, 1.0, 0.06))
        assert found_by_colour(picture, flat, 0.12, is_round=is_round).off_by == "cut"
