"""Photographs as people's cameras and telephones save them."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from prior_reinforce.environment import Picture
from prior_reinforce.errors import FileFormatError

_MOST_PIXELS = 50_000_000
"""Of a photograph; ours: four times a telephone's."""


_ORIENTATION = 0x0112
"""EXIF's tag for how a picture is stored: 1 upright, 2 to 4 mirrored or upside down, 5 to 8 with
its sides swapped (CIPA DC-008, 4.6.4)."""


def stored_turn(source: Path | BinaryIO) -> int:
    """Return how a picture that can be read is stored: its EXIF orientation, 1 for upright."""
    from PIL import Image

    with Image.open(source, formats=("PNG", "JPEG")) as image:
        turn = image.getexif().get(_ORIENTATION, 1)
    return turn if turn in range(1, 9) else 1


def read_picture(source: Path | BinaryIO) -> Picture:
    """Read a PNG or a JPEG: RGB, upright as the camera says; of several frames the first.

    Pictures of more than 8 bits are brightened until the brightest pixel is white, and what is
    transparent is seen on white. FileFormatError if it is neither, is damaged, or has too many
    pixels.
    """
    from PIL import Image, ImageOps

    try:
        # Pillow goes by content and not by name, and starts other programs for some formats.
        with Image.open(source, formats=("PNG", "JPEG")) as image:
            if image.width * image.height > _MOST_PIXELS:  # before any is read
                raise ValueError("too many pixels")
            deep = ";16" in str(image.tile[0][3])  # of which Pillow reads the upper 8 in colour
            upright = ImageOps.exif_transpose(image)
            if deep or upright.mode[0] in "IF":
                grey = upright.mode[0] in "IF"
                levels = np.asarray(upright if grey else upright.convert("RGB"), dtype=float)
                upright = Image.fromarray((levels * (255 / max(levels.max(), 1))).astype(np.uint8))
            elif upright.has_transparency_data:
                seen = upright.convert("RGBA")
                upright = Image.alpha_composite(Image.new("RGBA", seen.size, "white"), seen)
            return np.asarray(upright.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        what = f"the picture {source}" if isinstance(source, Path) else "that as a picture"
        raise FileFormatError(
            f"cannot read {what} ({str(error).partition(chr(10))[0]}); expected a PNG or JPEG"
        ) from error
