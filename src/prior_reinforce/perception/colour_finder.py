"""Finding an object in a picture by its colour: no model, and it knows nothing of the scene."""

from __future__ import annotations

import re

import numpy as np
from PIL import Image
from scipy import ndimage

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.vlm_formats import Box

COLOURS = {
    "red": (-12.0, 10.0, 0.62),
    "orange": (14.0, 36.0, 0.72),
    "blue": (195.0, 245.0, 0.55),
    "yellow": (44.0, 60.0, 0.72),
}
"""Least and greatest hue in degrees, and least saturation, of each colour that is told apart
(ours). Table, floor, arm and shadows of our scenes are all paler."""

_DARKEST = 60
"""Least value of a pixel whose hue means anything, of 255 (ours)."""
_SPECK = 12
"""Fewer connected pixels are noise, in [px] (ours)."""
_PIECE = 0.2
"""A piece of this share of the largest belongs to the object (ours): something, a bead on a ring,
may lie across it."""


def find_by_colour(picture: np.ndarray, words: str) -> Box | None:
    """Find the bounding box of what has the colour that the words name.

    Args:
        picture: Shape (height, width, 3), dtype uint8.
        words: For instance `the orange ball`; they name exactly one of `COLOURS`.

    Returns:
        The box in pixels; None if nothing in the picture has that colour.

    Raises:
        ConfigurationError: The words name no colour, or several.
    """
    low, high, least_saturation = COLOURS[_named_colour(words)]
    hue, saturation, value = np.moveaxis(np.asarray(Image.fromarray(picture).convert("HSV")), 2, 0)
    degrees = (hue * (360 / 256) - low) % 360 + low
    of_colour = (degrees <= high) & (saturation > 255 * least_saturation) & (value > _DARKEST)
    pieces, n_pieces = ndimage.label(of_colour, np.ones((3, 3)))
    areas = np.bincount(pieces.ravel(), minlength=n_pieces + 1)
    areas[0] = 0  # the background
    if areas.max() < _SPECK:
        return None
    rows, columns = np.nonzero((areas > areas.max() * _PIECE)[pieces])
    return float(columns.min()), float(rows.min()), columns.max() + 1.0, rows.max() + 1.0


def _named_colour(words: str) -> str:
    named = [colour for colour in COLOURS if re.search(rf"\b{colour}\b", words)]
    if len(named) != 1:
        raise ConfigurationError(
            f"{words!r} names {len(named)} colours; to be found by colour it must name one of "
            f"{', '.join(COLOURS)}"
        )
    return named[0]
