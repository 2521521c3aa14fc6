"""Learning a generator with a progress line, and finding a learned one again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import DiffusionConfig, DiffusionGenerator, load_generator
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.motions import Demonstrations

_RECORD = "training.json"


@dataclass(frozen=True)
class TrainingRecord:
    """What a saved model was learned from; stands beside its weights."""

    demonstrations_sha256: str
    """Hash of the demonstrations' plans and outcomes."""
    seed: int
    """Seed of the fit."""


def fingerprint(demonstrations: Demonstrations) -> str:
    """SHA-256 of the plans and the perceived outcomes."""
    digest = hashlib.sha256()
    for array in (demonstrations.plans, demonstrations.outcomes_seen):
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def learn(
    demonstrations: Demonstrations,
    folder: Path,
    *,
    config: DiffusionConfig,
    seed: int,
    console: Console,
) -> Generator:
    """Fit the diffusion generator under a progress line and save it to a folder."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.fields[detail]}"),
    )
    with Progress(*columns, console=console) as progress:
        line = progress.add_task("learning the motion", total=None, detail="")

        def show(state: FitProgress) -> None:
            detail = f"loss {state.loss:.4f}, {state.seconds_left:.0f} s left"
            progress.update(line, total=state.n_steps, completed=state.step, detail=detail)

        generator = DiffusionGenerator(config).fit(demonstrations, seed=seed, progress=show)
        progress.update(line, detail="done")
    generator.save(folder)
    record = TrainingRecord(fingerprint(demonstrations), seed)
    (folder / _RECORD).write_text(json.dumps(asdict(record), indent=2) + "\n")
    return generator


def load_learned(folder: Path, demonstrations: Demonstrations) -> Generator:
    """Load a model that was learned from these demonstrations.

    Raises:
        FileFormatError: The folder holds no model.
        ConfigurationError: The model was learned from other demonstrations.
    """
    path = folder / _RECORD
    try:
        record = TrainingRecord(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise FileFormatError(
            f"no learned model in {folder} ({error}); make one with: prior-reinforce learn "
            f"--out {folder}"
        ) from error
    if record.demonstrations_sha256 != fingerprint(demonstrations):
        raise ConfigurationError(
            f"the model in {folder} was learned from other demonstrations; learn anew with "
            "prior-reinforce learn, or name the set it was learned from"
        )
    return load_generator(folder)
