"""Which model looks at pictures, as commands are told."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

Vlm = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="FILE",
        help="TOML file whose section [vlm] says which model looks, and where "
        "(docs/perception.md).",
    ),
]


def model_of(file: Path | None, folder: Path | None = None) -> VisionLanguageModelConfig:
    """Return which model looks: that of a file, else of a workspace's manifest, else the default.

    FileFormatError if there is no such file, or it has no section [vlm]; ConfigurationError for an
    unknown setting, or a value out of range.
    """
    if file is None and folder is None:
        return VisionLanguageModelConfig()
    from prior_reinforce.arm.workspace.manifest import MANIFEST_FILE

    where = file or (folder or Path()) / MANIFEST_FILE
    return VisionLanguageModelConfig.load(where, needed=file is not None)
