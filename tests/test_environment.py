"""The tasks' scenes, and pictures of them: both objects can be seen at the key frame."""

from __future__ import annotations

import os
import re
import subprocess
import sys

os.environ.setdefault("MUJOCO_GL", "egl")

from contextlib import closing

import mujoco
import numpy as np
import pytest

from prior_reinforce.environment import (
    KeyFrame,
    SeenObject,
    Task,
    make_renderer,
)
from prior_reinforce.errors import ConfigurationError, RenderingUnavailableError
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.perception.camera import Camera
from prior_reinforce.perception.colour_camera import find_by_colour
from prior_reinforce.simulation.tasks import TASKS, make_task
from prior_reinforce.simulation.tasks.curling import Curling
from prior_reinforce.simulation.tasks.fishing import Fishing


@pytest.fixture(scope="module")
def camera():
    camera = Camera()
    yield camera
    camera.close()


def errors_seen(camera: Camera, task: Task, pairs: list[tuple[KeyFrame, np.ndarray]]) -> np.ndarray:
    """Errors by the colours in the pictures of key frames and goals; NaN where one is not seen."""
    scene, model = task.scene, pairs[0][0].model
    calibration = camera.calibrate(model, np.array(scene.marks), height=scene.plane_height)
    errors = np.full((len(pairs), 2), np.nan)
    for i, (frame, goal) in enumerate(pairs):
        picture = camera.picture(frame, goal)
        boxes = [find_by_colour(picture, seen.words) for seen in (scene.reached, scene.goal)]
        if None not in boxes:
            reached, of_goal = calibration.to_table(np.array(boxes).reshape(2, 2, 2).mean(axis=1))
            errors[i] = reached - of_goal - scene.goal_offset
    return errors


@pytest.mark.parametrize("name", [each for each in TASKS.members if TASKS.resolve(each).scene])
def test_the_camera_sees_the_whole_region_and_is_calibrated_to_a_millimetre(name, camera):
    task = make_task(name)
    model, scene = task.model, task.scene
    calibration = camera.calibrate(model, np.array(scene.marks), height=scene.plane_height)
    assert calibration.left_out_error < 0.001
    low, high = task.region
    corners = np.array([low, high, [low[0], high[1]], [high[0], low[1]]])
    corners += 0.05 * np.sign(corners - (low + high) / 2)  # a margin for what goes too far
    pixels = calibration.to_pixels(corners)
    assert np.all((pixels > 0) & (pixels < [camera.config.width, camera.config.height]))


@pytest.mark.slow
def test_a_stone_as_far_as_the_target_hides_neither(camera):
    # Outcomes are measured without the target, so that a picture may show one stone in the other.
    task, goal = Curling(), np.array([0.90, 0.05])
    stone = task.model.jnt_qposadr[task.model.joint("stone").id]
    angles, distances = np.meshgrid([0.0, 0.8, 2.0, 4.0], [0.0, 0.01, 0.02, 0.035, 0.06])
    circles = distances.ravel() * np.array([np.cos(angles.ravel()), np.sin(angles.ravel())])
    places = goal - task.scene.goal_offset + circles.T
    pairs = []
    for place in places:
        state = task.model.qpos0.copy()
        state[stone : stone + 2] = place
        pairs.append((KeyFrame(task.model, state, 0.0), goal))
    seen = errors_seen(camera, task, pairs)
    np.testing.assert_allclose(seen, places - goal, atol=0.005)


@pytest.mark.slow
def test_the_rod_hides_neither_hook_nor_magnet_in_eight_casts(camera):
    task, rng = Fishing(), np.random.default_rng(21)
    rollouts = []
    for name in ("A", "B"):
        prior = task.demonstrations(name)
        learned = SmoothInterpolation().fit(align(prior).demonstrations, seed=0)
        rollouts += task.rollout(prior.plans[:2], rng)
        rollouts += task.rollout(learned.generate(task.sample_goals(2, rng)), rng)
    assert all(rollout.valid for rollout in rollouts)
    outcomes = np.array([rollout.outcome for rollout in rollouts])
    goals = np.clip(outcomes + rng.normal(0.0, 0.04, outcomes.shape), *task.region)
    frames = [rollout.key_frame for rollout in rollouts]
    seen = errors_seen(camera, task, list(zip(frames, goals, strict=True)))
    np.testing.assert_allclose(seen, outcomes - goals, atol=0.005)


@pytest.mark.parametrize(("words", "size"), [("the ball", 0.0), (" ", 0.1)])
def test_an_object_has_words_and_a_size(words, size):
    with pytest.raises(ConfigurationError, match="cannot be looked for"):
        SeenObject(words, size)


@pytest.fixture
def small_scene():
    world = '<worldbody><geom type="sphere" size=".1" rgba="1 0 0 1"/></worldbody>'
    small = '<visual><global offwidth="64" offheight="48"/></visual>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{small}{world}</mujoco>")


def test_a_picture_has_the_size_asked_for_and_the_scene_stays_as_it_was(small_scene):
    data = mujoco.MjData(small_scene)
    mujoco.mj_forward(small_scene, data)
    with closing(make_renderer(small_scene, 320, 200)) as renderer:
        renderer.update_scene(data)
        picture = renderer.render()
    assert picture.shape == (200, 320, 3)
    red, green, _ = np.moveaxis(picture.astype(int), 2, 0)
    rows, columns = np.nonzero(red > green + 50)
    np.testing.assert_allclose([rows.mean(), columns.mean()], [99.5, 159.5], atol=1.0)
    assert (small_scene.vis.global_.offwidth, small_scene.vis.global_.offheight) == (64, 48)


def test_a_picture_that_is_too_large_is_refused_and_the_next_one_drawn(small_scene):
    with pytest.raises(RenderingUnavailableError, match="framebuffer"):
        make_renderer(small_scene, 100_000, 64)
    make_renderer(small_scene, 64, 48).close()


def test_no_opengl_is_named_with_the_remedy():
    """In a program of its own: it is asked twice, at which MuJoCo's default library aborts."""
    tries = """
import mujoco
from prior_reinforce.environment import RenderingUnavailableError, make_renderer
for _ in range(3):
    try:
        make_renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 64, 48)
    except RenderingUnavailableError as error:
        print(error)
"""
    without = {"MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"}
    env = {name: value for name, value in os.environ.items() if name not in without}
    command = [sys.executable, "-W", "ignore", "-c", tries]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert len(said) == 3
    assert all(re.search(r"OpenGL is not available \(.+\); .*MUJOCO_GL=egl", it) for it in said)
