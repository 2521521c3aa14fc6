"""Perceptions by their names, with the scene and the model that some of them need."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from prior_reinforce.perception import make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.tasks import make_task

MODEL, STAND_IN = "vlm", "stand-in"


@contextmanager
def open_sight(
    name: str, task: str, config: VisionLanguageModelConfig | None = None, *, seed: int = 0
) -> Iterator[Perception]:
    """Make a perception by its name, or one's own by `module:Class`, and free what it holds."""
    name = "camera" if name == STAND_IN else name
    scene = make_task(task).scene
    with make_perception(name, scene=scene, config=config, seed=seed) as perception:
        yield perception
