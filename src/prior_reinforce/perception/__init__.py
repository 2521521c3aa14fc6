"""P: ways of perceiving a trial's error. One file each; all share the interface of `base`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prior_reinforce.registry import Member, Registry

if TYPE_CHECKING:
    from prior_reinforce.environment import TableScene
    from prior_reinforce.perception.base import Perception
    from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

_HERE = "prior_reinforce.perception"

PERCEPTIONS: Registry[Perception] = Registry(
    "perception",
    f"{_HERE}.base:Perception",
    {
        "exact": Member(f"{_HERE}.exact:Exact", "the true error"),
        "eye": Member(f"{_HERE}.eye:Eye", "rounded as an observer's estimate is"),
        "amplified": Member(f"{_HERE}.amplified:Amplified", "scaled by 0.7 to 1.4, with noise"),
        "camera": Member(
            f"{_HERE}.colour_camera:ColourCamera",
            "objects found by colour in the overhead camera's picture",
        ),
        "vlm": Member(
            f"{_HERE}.vlm:VisionLanguageModel",
            "objects found in that picture by a vision-language model",
        ),
    },
)


def make_perception(
    choice: str,
    *,
    scene: TableScene | None = None,
    config: VisionLanguageModelConfig | None = None,
    seed: int = 0,
) -> Perception:
    """Make a perception by its name.

    Args:
        choice: Its name, with settings if need be: `amplified,noise_sd=0.02`.
        scene: What to look for in pictures: the task's `scene`.
        config: Endpoint, model and votes of `vlm`, votes of `camera`; settings in `choice` come
            on top.
        seed: Of a perception that draws random numbers of its own.

    Returns:
        The perception; its `close` frees what it holds, or use it as a context manager.

    Raises:
        ConfigurationError: There is no such perception, or it needs a scene and there is none.
        MissingExtraError: `vlm` without the extra [vlm].
    """
    return PERCEPTIONS.make(choice, scene=scene, config=config, seed=seed)
