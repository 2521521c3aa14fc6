"""What made a result: software and settings, saved beside the figures."""

from __future__ import annotations

import subprocess
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from prior_reinforce.experiments.evaluation import GOAL_SEED
from prior_reinforce.experiments.recipes.base import Scale


def provenance(scale: Scale) -> dict[str, Any]:
    """Version, commit, scale and seeds, JSON-able."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parent,
        check=False,
    )
    return {
        "version": version("prior-reinforce"),
        "commit": commit.stdout.strip() or "not a checkout",
        "scale": asdict(scale),
        "goal_seed": GOAL_SEED,
    }
