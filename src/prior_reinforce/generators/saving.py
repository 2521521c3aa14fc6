"""Models on disk: `config.json` describes a model, `model.safetensors` holds its arrays.

A model is a stack of layers, the outermost first: a generator, and the one it wraps. Both files are
data, and reading them runs no code. `config.json` holds a SHA-256 of either file's content, so that
a damaged copy is an error rather than a slightly different throw.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from jaxtyping import Shaped

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import sha256, write

CONFIG_FILE = "config.json"
TENSOR_FILE = "model.safetensors"

Tensors = Mapping[str, Shaped[np.ndarray, "..."]]


class SavedLayer(msgspec.Struct, omit_defaults=True):
    """One generator of a stack, without the one it wraps."""

    name: str
    """`Generator.name`."""
    outcome_dim: Annotated[int, msgspec.Meta(ge=1)]
    """k."""
    remarks: tuple[str, ...]
    """`Generator.remarks`."""
    settings: dict[str, Any]
    """JSON types."""
    tensors: dict[str, np.ndarray] = {}
    """`Tensors`; they stand in the other file."""


class _Config(msgspec.Struct):
    """What `config.json` holds, beside its own checksum."""

    layers: Annotated[list[SavedLayer], msgspec.Meta(min_length=1)]
    tensors_sha256: str
    file_format: Literal["prior-reinforce generator"] = "prior-reinforce generator"
    version: Literal[6] = 6


def write_model(folder: Path, layers: Sequence[SavedLayer]) -> None:
    """Write both files, `config.json` last, replacing older ones; the outermost layer is first."""
    from safetensors.numpy import save

    packed = save(
        {
            f"{depth}.{name}": np.ascontiguousarray(array)
            for depth, layer in enumerate(layers)
            for name, array in layer.tensors.items()
        }
    )
    described = [msgspec.structs.replace(layer, tensors={}) for layer in layers]
    content = msgspec.to_builtins(_Config(described, sha256(packed)))
    write(folder / TENSOR_FILE, packed)
    content["config_sha256"] = _digest(content)
    write(folder / CONFIG_FILE, json.dumps(content, indent=2) + "\n")


def read_model(folder: Path) -> list[SavedLayer]:
    """Read the layers that `write_model` wrote, at least one, the outermost first.

    FileFormatError if files are missing, truncated or damaged.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    config = _read_config(folder / CONFIG_FILE)
    packed = _read(folder / TENSOR_FILE)
    if sha256(packed) != config.tensors_sha256:
        raise FileFormatError(
            f"{folder / TENSOR_FILE} is damaged or belongs to another model: its checksum is not "
            f"the one in {CONFIG_FILE}; copy the folder again, or learn the model again"
        )
    try:
        for key, array in load(packed).items():
            depth, _, name = key.partition(".")
            config.layers[int(depth)].tensors[name] = array
    except (SafetensorError, ValueError, IndexError) as error:
        raise FileFormatError(
            f"{folder / TENSOR_FILE} does not hold the tensors of this model: {error}"
        ) from error
    return config.layers


def _read_config(path: Path) -> _Config:
    try:
        content = json.loads(_read(path))
        config = msgspec.convert(content, _Config)
        digest = content.pop("config_sha256")
    except (ValueError, KeyError, RecursionError) as error:
        raise FileFormatError(
            f"{path} is not the {CONFIG_FILE} of a saved generator: {error}; learn the model again"
        ) from error
    if digest != _digest(content):
        raise FileFormatError(
            f"{path} was changed after it was saved, its checksum does not fit; copy the folder "
            "again, or learn the model again"
        )
    return config


def without_prefix(prefix: str, tensors: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tensors whose names have a prefix, by their names without it."""
    named = (name for name in tensors if name.startswith(prefix))
    return {name.removeprefix(prefix): tensors[name] for name in named}


def _digest(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode())


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileFormatError(
            f"cannot read {path} ({error.strerror}); give the folder that a generator was saved to"
        ) from error
