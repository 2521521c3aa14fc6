"""What made a result: software and settings, saved beside the figures."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from prior_reinforce.experiments.evaluation import GOAL_SEED
from prior_reinforce.experiments.recipes.base import Scale


def provenance(command: str, scale: Scale, commits: Collection[str]) -> dict[str, Any]:
    """What makes the figures again, version, commits of the units, scale and seeds, JSON-able."""
    return {
        "command": command,
        "version": version("prior-reinforce"),
        "commit": ", ".join(sorted(commits)),
        "scale": asdict(scale),
        "goal_seed": GOAL_SEED,
    }
