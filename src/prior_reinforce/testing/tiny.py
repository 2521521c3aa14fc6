"""Settings with which our networks learn in a moment: for tests that are not about quality."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from prior_reinforce.generators import GENERATORS

_NETWORK = {"widths": (8, 16), "groups": 2, "step_width": 8, "condition_width": 8}

TINY: Mapping[str, Mapping[str, Any]] = {
    "diffusion": {
        "perceptron": {"members": 2, "width": 16, "depth": 1, "step_width": 8}, "training_steps": 8,
        "warmup_steps": 2, "sampling_steps": 3,
    },
    "diffusion-paper": {
        "network": _NETWORK, "training_steps": 8, "warmup_steps": 2, "noise_levels": 6,
        "sampling_steps": 6,
    },
}  # fmt: skip
"""By name of the generator; what is not here learns in a moment anyway."""


@contextmanager
def tiny_networks(
    settings: Mapping[str, Mapping[str, Any]] = TINY,
) -> Iterator[None]:
    """Make every network that is chosen by name, here or by a command, tiny meanwhile.

    Args:
        settings: By name of a generator that is chosen; of one's own, too.
    """
    before = dict(GENERATORS.members)
    try:
        for name, tiny in settings.items():
            member = before[name]
            GENERATORS.members[name] = replace(member, settings={**member.settings, **tiny})
        yield
    finally:
        GENERATORS.members.update(before)
