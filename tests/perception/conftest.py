"""The table to photograph, compiled once, and a perception that asks a server about it."""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np
import pytest

from prior_reinforce.environment import KeyFrame
from prior_reinforce.perception.camera import Camera, CameraConfig
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from tests.perception.slanted_table import BALL, GOAL, RIM_HEIGHT, SCENE, slanted_table
from tests.perception.vision_server import VisionServer


@pytest.fixture(scope="session")
def table_model():
    return slanted_table()


@pytest.fixture(scope="session")
def frame_with_ball_at(table_model):
    def make(x: float, y: float, z: float = RIM_HEIGHT) -> KeyFrame:
        return KeyFrame(table_model, np.array([x, y, z, 1.0, 0, 0, 0]), time=1.0)

    return make


@pytest.fixture(scope="package")
def camera():
    camera = Camera(CameraConfig(width=640, height=480))
    yield camera
    camera.close()


@pytest.fixture(scope="package")
def picture(camera, frame_with_ball_at):
    return camera.picture(frame_with_ball_at(*BALL), GOAL)


@pytest.fixture(scope="package")
def calibration(camera, table_model):
    return camera.calibrate(table_model, np.array(SCENE.marks), height=RIM_HEIGHT)


@pytest.fixture
def looking(camera, calibration):
    """Make a perception that asks a server."""
    made = []

    def make(answering: VisionServer, **settings) -> VisionLanguageModel:
        settings = {"family": answering.family, "timeout": 5.0, **settings}
        config = VisionLanguageModelConfig(base_url=answering.base_url, **settings)
        made.append(VisionLanguageModel(SCENE, config, camera=camera, calibration=calibration))
        return made[-1]

    yield make
    for perception in made:
        perception._client.close()
