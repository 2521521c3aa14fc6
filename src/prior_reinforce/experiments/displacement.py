"""The unit behind displacement fields: where a dense grid of conditions lands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.experiments.evaluation import Training
from prior_reinforce.experiments.units import Unit
from prior_reinforce.tasks import make_task


@dataclass(frozen=True)
class Displacement(Unit):
    """Where a dense grid of conditions lands, over the reachable region and beyond its edge."""

    training: Training
    """What was learned; its task has two-dimensional outcomes."""
    spacing: float = 0.025
    """Of the grid, in [m]."""
    margin: float = 0.05
    """How far the grid goes beyond the reachable region, in [m]."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""
        return f"displacement of {self.training.label.removeprefix('learn ')}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Throw once for each condition, with execution's disturbances switched off."""
        task = make_task(self.training.task)
        low, high = task.region[0] - self.margin, task.region[1] + self.margin
        counts = np.round((high - low) / self.spacing).astype(int) + 1
        axes = [np.linspace(*ends) for ends in zip(low, high, counts, strict=True)]
        conditions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        plans = self.training.learned(folder).generator.generate(conditions.reshape(-1, len(axes)))
        rollouts = task.rollout(plans, None)
        landed = np.array([rollout.outcome for rollout in rollouts]).reshape(conditions.shape)
        return {
            "axes_m": [axis.tolist() for axis in axes],
            "displacements_m": np.round(landed - conditions, 5).tolist(),
            "lost": sum(not rollout.valid for rollout in rollouts),
        }
