"""Ways of seeing by their names, with the camera and the model that some of them need."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.experiments.methods import make_perception
from prior_reinforce.perception import (
    Perception,
    VisionLanguageModel,
    VisionLanguageModelConfig,
    scene_of,
)
from prior_reinforce.perception.stand_in_server import StandInServer

MODEL, STAND_IN = "vlm", "stand-in"
SIGHTS = ("exact", "eye", "amplified", MODEL, STAND_IN)
"""Every way of seeing that has a name."""


@contextmanager
def open_sight(
    name: str,
    task: str,
    config: VisionLanguageModelConfig | None = None,
    *,
    outlier_rate: float = 0.0,
    seed: int = 0,
) -> Iterator[Perception]:
    """Make a perception by its name, or one's own by `module:Class`, and free what it holds.

    `vlm` asks the endpoint of `config`. `stand-in` goes the same way, picture, HTTP, boxes and
    all, but starts a server of its own that finds the objects by colour: no model's eyesight.

    Args:
        name: One of `SIGHTS`, or `module:Class`.
        task: Name of the task whose pictures are looked at.
        config: Endpoint, model and votes; the defaults where not given.
        outlier_rate: Share of wrong answers that the stand-in gives.
        seed: Of those answers.

    Yields:
        The perception; a `VisionLanguageModel` for the first two names.

    Raises:
        ConfigurationError: There is no such perception, or no scene is described for the task.
        MissingExtraError: The extra [vlm] is not installed.
    """
    if name not in SIGHTS and ":" not in name:
        raise ConfigurationError(
            f"no perception {name!r}; known are {', '.join(SIGHTS)}, or give your own as "
            "module:Class"
        )
    if name not in (MODEL, STAND_IN):
        yield make_perception(name)
        return
    config = config or VisionLanguageModelConfig()
    with ExitStack() as stack:
        if name == STAND_IN:
            server = StandInServer(config.family, outlier_rate=outlier_rate, seed=seed)
            url = stack.enter_context(server).base_url
            config = replace(config, base_url=url, api_key_variable=None)
        perception = VisionLanguageModel(scene_of(task), config)
        stack.callback(perception.close)
        yield perception
