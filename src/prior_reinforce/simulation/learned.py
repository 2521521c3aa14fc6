"""Models of simulated tasks, saved together with what they were learned from."""

from __future__ import annotations

from pathlib import Path

import msgspec

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import write
from prior_reinforce.generators import Generator, load_generator
from prior_reinforce.plans.motions import Demonstrations

_RECORD = "training.json"


class TrainingRecord(msgspec.Struct, frozen=True):
    """What a saved model was learned from; stands beside its weights."""

    demonstrations_sha256: str
    """Hash of the demonstrations' plans and outcomes."""
    seed: int
    """Seed of the fit."""


def save_learned(
    folder: Path, generator: Generator, demonstrations: Demonstrations, seed: int
) -> None:
    """Save a fitted generator and the record of what it was fitted to, for `load_learned`."""
    generator.save(folder)
    record = TrainingRecord(demonstrations.sha256, seed)
    write(folder / _RECORD, msgspec.json.encode(record))


def load_learned(folder: Path, demonstrations: Demonstrations) -> Generator:
    """Load a model that was learned from these demonstrations.

    Args:
        folder: Made by `save_learned`.
        demonstrations: What it must have been learned from.

    Raises:
        FileFormatError: The folder holds no model.
        ConfigurationError: The model was learned from other demonstrations.
    """
    path = folder / _RECORD
    try:
        record = msgspec.json.decode(path.read_bytes(), type=TrainingRecord)
    except (OSError, ValueError) as error:
        raise FileFormatError(
            f"no learned model in {folder} ({error}); let adapt learn one: prior-reinforce "
            "adapt --out FOLDER writes FOLDER/model"
        ) from error
    if record.demonstrations_sha256 != demonstrations.sha256:
        raise ConfigurationError(
            f"the model in {folder} was learned from other demonstrations; leave out "
            "--model to learn again, or name what it was learned from with --demonstrations"
        )
    return load_generator(folder)
