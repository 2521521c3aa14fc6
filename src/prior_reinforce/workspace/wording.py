"""How a workspace's numbers are said: in an operator's words where they apply, else as numbers."""

from __future__ import annotations

import numpy as np

from prior_reinforce.wording import to_words
from prior_reinforce.workspace.manifest import Manifest


def say_error(manifest: Manifest, error: np.ndarray) -> str:
    """Say outcome minus goal, for instance `5 cm long, 2 cm left`, or `x +0.05 m, t -0.1 s`."""
    if manifest.in_words:
        return to_words(error)
    return _components(manifest, error, "+.4g")


def say_place(manifest: Manifest, place: np.ndarray) -> str:
    """Say a goal or a condition, for instance `x 0.92 m, y 0.1 m`."""
    return _components(manifest, place, ".4g")


def _components(manifest: Manifest, values: np.ndarray, form: str) -> str:
    # Adding 0.0 turns -0 into 0.
    return ", ".join(
        f"{name} {round(float(value), 4) + 0.0:{form}} {unit}"
        for name, value, unit in zip(
            manifest.outcome_names, values, manifest.outcome_units, strict=True
        )
    )
