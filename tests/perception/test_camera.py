"""The camera: pictures that show what is where, and marks that are found where optics puts them."""

from __future__ import annotations

import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from prior_reinforce.environment import KeyFrame
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.camera import Camera, CameraConfig
from prior_reinforce.perception.colour_camera import find_by_colour
from tests.perception.slanted_table import RIM_HEIGHT

MARKS = np.array([(x, y) for x in (0.45, 0.85, 1.25) for y in (-0.4, 0.0, 0.4)])
PLACES = np.array([(x, y) for x in (0.5, 0.85, 1.2) for y in (-0.35, 0.05, 0.35)])


@pytest.fixture(scope="module")
def camera():
    camera = Camera(CameraConfig(width=448, height=336))
    yield camera
    camera.close()


def through_pinhole(model: mujoco.MjModel, points: np.ndarray, config: CameraConfig) -> np.ndarray:
    """Pixels of points (n, 3) by the camera's published pose and opening angle."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seen = (points - data.camera("birdseye").xpos) @ data.camera("birdseye").xmat.reshape(3, 3)
    focal = config.height / 2 / np.tan(np.deg2rad(model.cam("birdseye").fovy[0]) / 2)
    middle = np.array([config.width, config.height]) / 2
    return middle + focal * seen[:, :2] / -seen[:, 2:] * [1, -1]


def centre(box) -> np.ndarray:
    return np.array([box[0] + box[2], box[1] + box[3]]) / 2


def test_marks_are_found_where_optics_puts_them(camera, table_model):
    points = np.hstack([MARKS, np.full((9, 1), RIM_HEIGHT)])
    found = camera.find_marks(table_model, points)
    np.testing.assert_allclose(found, through_pinhole(table_model, points, camera.config), atol=0.1)


def test_calibration_holds_between_the_marks(camera, table_model):
    calibration = camera.calibrate(table_model, MARKS, height=RIM_HEIGHT)
    assert calibration.left_out_error < 0.0005
    points = np.hstack([PLACES, np.full((9, 1), RIM_HEIGHT)])
    pixels = through_pinhole(table_model, points, camera.config)
    np.testing.assert_allclose(calibration.to_table(pixels), PLACES, atol=0.0005)


def test_ball_and_ring_are_seen_where_they_are_all_over_the_table(
    camera, table_model, frame_with_ball_at
):
    at_rim = camera.calibrate(table_model, MARKS, height=RIM_HEIGHT)
    at_table = camera.calibrate(table_model, MARKS, height=0.0)
    worst_of_table_plane = 0.0
    for ball, goal in zip(PLACES, PLACES[::-1] + 0.04, strict=True):
        picture = camera.picture(frame_with_ball_at(*ball), goal)
        ball_pixel = centre(find_by_colour(picture, "the orange ball"))
        goal_pixel = centre(find_by_colour(picture, "the red ring"))
        # A pixel is 4 mm here, and a box's edge lies on one.
        np.testing.assert_allclose(at_rim.to_table(ball_pixel), ball, atol=0.004)
        np.testing.assert_allclose(at_rim.to_table(goal_pixel), goal, atol=0.004)
        away = np.linalg.norm(at_table.to_table(ball_pixel) - ball)
        worst_of_table_plane = max(worst_of_table_plane, away)
    assert worst_of_table_plane > 0.02  # parallax: calibrated on the table itself it would be wrong


def test_drawing_changes_neither_frame_nor_model_and_repeats(
    camera, table_model, frame_with_ball_at
):
    frame = frame_with_ball_at(0.8, 0.1)
    goal = np.array([0.9, -0.1])
    state, width = frame.state.copy(), table_model.vis.global_.offwidth
    big = Camera(CameraConfig(width=1200, height=900))  # more than the scene's frame buffer
    assert big.picture(frame, goal).shape == (900, 1200, 3)
    big.close()
    first = camera.picture(frame, goal)
    assert first.shape == (336, 448, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(camera.picture(frame, goal), first)
    np.testing.assert_array_equal(frame.state, state)
    np.testing.assert_array_equal(goal, [0.9, -0.1])
    assert table_model.vis.global_.offwidth == width


def test_one_camera_serves_scenes_in_turn(camera, table_model, frame_with_ball_at):
    frame = frame_with_ball_at(0.8, 0.1)
    goal = np.array([0.9, -0.1])
    first = camera.picture(frame, goal)
    bare = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><camera name="birdseye" pos="0 0 2"/>'
        '<body name="goal" mocap="true"><geom size=".1"/></body></worldbody></mujoco>'
    )
    assert find_by_colour(camera.picture(KeyFrame(bare, np.zeros(0), 0.0), goal), "red") is None
    np.testing.assert_array_equal(camera.picture(frame, goal), first)


def test_after_a_calibration_that_fails_a_picture_has_its_shadows(camera):
    lit = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><camera name="birdseye" pos="0 0 2"/><light pos="1 0 2" dir="-1 0 -2"/>'
        '<geom type="plane" size="1 1 1"/><geom type="box" size=".1 .1 .1" pos="0 0 .3"/>'
        '<body name="goal" mocap="true"><geom size=".05"/></body></worldbody></mujoco>'
    )
    frame, goal = KeyFrame(lit, np.zeros(0), 0.0), np.zeros(2)
    before = camera.picture(frame, goal)
    with pytest.raises(ConfigurationError, match="not wholly"):
        camera.find_marks(lit, np.array([[5.0, 0.0, 0.1]]))
    np.testing.assert_array_equal(camera.picture(frame, goal), before)


def test_what_the_scene_lacks_is_named(camera, table_model, frame_with_ball_at):
    with pytest.raises(ConfigurationError, match="no camera 'side'; its cameras are birdseye"):
        Camera(CameraConfig(name="side")).picture(frame_with_ball_at(0.8, 0), np.zeros(2))
    bare = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><camera name="birdseye" pos="0 0 2"/></worldbody></mujoco>'
    )
    with pytest.raises(ConfigurationError, match="no mocap body 'goal'"):
        camera.picture(KeyFrame(bare, np.zeros(0), 0.0), np.zeros(2))
    with pytest.raises(ConfigurationError, match=r"\[5.0, 0.0, 0.1\] m is not wholly in the pic"):
        camera.find_marks(table_model, np.array([[5.0, 0.0, 0.1]]))
    with pytest.raises(ConfigurationError, match="width: Expected `int` >= 1, got 0"):
        Camera(CameraConfig(width=0, height=336))


def test_without_opengl_the_remedy_is_named():
    code = """
import mujoco, numpy as np
from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.perception.camera import Camera
from prior_reinforce.environment import KeyFrame
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><camera name="birdseye"/></worldbody></mujoco>')
try:
    Camera().picture(KeyFrame(model, np.zeros(0), 0.0), np.zeros(2))
except RenderingUnavailableError as error:
    print(error)
"""
    without = {**os.environ, "MUJOCO_GL": "off"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=without, capture_output=True, text=True, check=True
    )
    assert "set MUJOCO_GL=egl" in done.stdout
