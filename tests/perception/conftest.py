"""The table to photograph, compiled once."""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np
import pytest
from slanted_table import RIM_HEIGHT, slanted_table

from prior_reinforce.rollouts import KeyFrame


@pytest.fixture(scope="session")
def table_model():
    return slanted_table()


@pytest.fixture(scope="session")
def frame_with_ball_at(table_model):
    def make(x: float, y: float, z: float = RIM_HEIGHT) -> KeyFrame:
        return KeyFrame(table_model, np.array([x, y, z, 1.0, 0, 0, 0]), time=1.0)

    return make
