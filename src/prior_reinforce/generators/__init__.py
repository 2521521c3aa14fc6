"""pi: conditional motion generators. One file each; all share the interface of `base`."""

from __future__ import annotations

import os

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.diffusion_config import DiffusionConfig
from prior_reinforce.generators.dmp import (
    DynamicMovementPrimitives,
    DynamicMovementPrimitivesConfig,
)
from prior_reinforce.generators.interpolation import (
    SmoothInterpolation,
    SmoothInterpolationConfig,
)
from prior_reinforce.generators.nearest import NearestNeighbours, NearestNeighboursConfig
from prior_reinforce.generators.regression import UNetRegression
from prior_reinforce.generators.regression_config import UNetRegressionConfig
from prior_reinforce.generators.saving import read_model
from prior_reinforce.plans.alignment import Alignment, AlignmentConfig, align

FAMILY: tuple[type[Generator], ...] = (
    DiffusionGenerator,
    NearestNeighbours,
    SmoothInterpolation,
    DynamicMovementPrimitives,
    UNetRegression,
)
"""Every generator that can be loaded from disk."""


def load_generator(folder: str | os.PathLike[str], *, own=None, device: str = "cpu") -> Generator:
    """Read a saved generator of any kind.

    Args:
        folder: Of the model.
        device: Where torch computes, `cpu` or `cuda`; only diffusion runs on the latter.

    Raises:
        FileFormatError: Files are missing, damaged, or of a generator that is not known here.
        ConfigurationError: The device is not there, or the generator does not run on it.
    """
    name = read_model(folder).generator
    if name == DiffusionGenerator.name:
        return DiffusionGenerator.load(folder, device=device)
    if device != "cpu":
        raise ConfigurationError(f"a {name} generator runs on the CPU only, got device {device!r}")
    for kind in FAMILY:
        if kind.name == name:
            return kind.load(folder)
    raise FileFormatError(
        f"{folder} holds a generator {name!r}; known here are "
        f"{', '.join(kind.name for kind in FAMILY)}"
    )


__all__ = [
    "FAMILY",
    "Alignment",
    "AlignmentConfig",
    "DiffusionConfig",
    "DiffusionGenerator",
    "DynamicMovementPrimitives",
    "DynamicMovementPrimitivesConfig",
    "FitProgress",
    "Generator",
    "NearestNeighbours",
    "NearestNeighboursConfig",
    "SmoothInterpolation",
    "SmoothInterpolationConfig",
    "UNetRegression",
    "UNetRegressionConfig",
    "align",
    "load_generator",
]

from prior_reinforce.generators.base import Generator as _G

_G.remarks = ()


def make_generator(choice):
    from prior_reinforce.generators.by_name import make_generator as make

    return make(choice)
