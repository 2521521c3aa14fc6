"""Models on disk: `config.json` says what it is, `model.safetensors` holds the numbers.

Both are data; reading them runs no code. A SHA-256 of either file's content is kept in
`config.json`, so that a damaged copy is an error rather than a slightly different throw.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import sha256, write

_FILE_FORMAT = "prior-reinforce generator"
_FILE_VERSION = 4
"""3: start times and alignment are a `timed` generator around another, no setting of its own."""
CONFIG_FILE = "config.json"
TENSOR_FILE = "model.safetensors"

Tensors = Mapping[str, Shaped[np.ndarray, "..."]]


@dataclass(frozen=True)
class SavedModel:
    """What the two files of a model folder say."""

    generator: str
    """`Generator.name` of what was saved."""
    settings: Mapping[str, Any]
    """JSON types."""
    tensors: Tensors


def write_model(folder: Path, model: SavedModel) -> None:
    """Write both files, `config.json` last; files of these names in the folder are replaced."""
    from safetensors.numpy import save

    packed = save({name: np.ascontiguousarray(array) for name, array in model.tensors.items()})
    content = {
        "file_format": _FILE_FORMAT,
        "version": _FILE_VERSION,
        "generator": model.generator,
        "settings": dict(model.settings),
        "tensors_sha256": sha256(packed),
    }
    content["config_sha256"] = _digest(content)
    write(folder / TENSOR_FILE, packed)
    write(folder / CONFIG_FILE, json.dumps(content, indent=2) + "\n")


def read_model(folder: Path, expected: str | None = None) -> SavedModel:
    """Read what `write_model` wrote.

    Args:
        folder: Of the model.
        expected: The `Generator.name` that it must be of; any when None.

    Raises:
        FileFormatError: Files are missing, truncated, damaged, or of another generator.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    content = _read_config(folder / CONFIG_FILE)
    generator = content["generator"]
    if expected is not None and generator != expected:
        raise FileFormatError(
            f"{folder} holds a {generator} generator, not {expected}; load it with load_generator"
        )
    packed = _read(folder / TENSOR_FILE)
    if sha256(packed) != content["tensors_sha256"]:
        raise FileFormatError(
            f"{folder / TENSOR_FILE} is damaged or belongs to another model: its checksum is not "
            f"the one in {CONFIG_FILE}; copy the folder again, or learn the model again"
        )
    try:
        return SavedModel(generator, content["settings"], load(packed))
    except SafetensorError as error:
        raise FileFormatError(
            f"{folder / TENSOR_FILE} is not a safetensors file: {error}"
        ) from error


def _read_config(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(_read(path))
        if content["file_format"] != _FILE_FORMAT or content["version"] != _FILE_VERSION:
            raise ValueError(f"it says {content['file_format']!r} {content['version']!r}")
        digest = content.pop("config_sha256")
        for name, kind in (("generator", str), ("settings", dict), ("tensors_sha256", str)):
            if not isinstance(content[name], kind):
                raise TypeError(f"{name} is {content[name]!r:.40}")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FileFormatError(
            f"{path} is not the {CONFIG_FILE} of a saved generator (version {_FILE_VERSION}): "
            f"{error}; learn the model again"
        ) from error
    if digest != _digest(content):
        raise FileFormatError(
            f"{path} was changed after it was saved, its checksum does not fit; copy the folder "
            "again, or learn the model again"
        )
    return dict(content)


def _digest(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode())


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileFormatError(
            f"cannot read {path} ({error.strerror}); give the folder that a generator was saved to"
        ) from error
