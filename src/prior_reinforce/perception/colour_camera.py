"""P = the overhead camera, and objects found in its picture by their colour.

A camera of centimetre accuracy for simulated trials. Its readings take the same path as those of a
vision-language model: the picture resized as for a server, a box in whole thousandths, an answer in
a model family's words, the parser, the votes. Only the objects are not found by a model, so that
these readings are no evidence about models.
"""

from __future__ import annotations

import json
import re

import numpy as np

from prior_reinforce.environment import Picture, TableScene
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.camera import Camera
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.perception.vlm_formats import FORMATS, Box, Family
from prior_reinforce.perception.vlm_reading import Answer

COLOURS = {
    "red": (-12.0, 10.0, 0.62),
    "orange": (14.0, 36.0, 0.72),
    "blue": (195.0, 245.0, 0.55),
    "yellow": (44.0, 60.0, 0.72),
}
"""Least and greatest hue in degrees, and least saturation, of each colour that is told apart
(ours). Table, floor, arm and shadows of our scenes are all paler."""

_SHADES = "light|pale|dark|deep|navy|sky|not|no|non|without"
"""Words before a colour that make it another one than is found."""
_DARKEST = 60
"""Least value of a pixel whose hue means anything, of 255 (ours)."""
_SPECK = 12
"""Fewer connected pixels are noise, in [px] (ours)."""
_PIECE = 0.2
"""A piece of this share of the largest belongs to the object (ours): something, a bead on a ring,
may lie across it."""


class ColourCamera(VisionLanguageModel):
    """Reads the error in a simulated trial's picture; the objects' words name their colours."""

    def __init__(
        self,
        scene: TableScene | None,
        config: VisionLanguageModelConfig | None = None,
        *,
        seed: int = 0,
        outlier_rate: float = 0.0,
        camera: Camera | None = None,
        calibration: TableCalibration | None = None,
    ) -> None:
        """Make the camera, as `VisionLanguageModel` does; nothing is drawn yet.

        Of `config`, family and votes are used, and no endpoint. A share `outlier_rate` of answers,
        drawn from `seed`, has a box of the right size that lies anywhere. ConfigurationError if
        there is no scene, or the rate is no share.
        """
        config = config or VisionLanguageModelConfig()
        client = ColourClient(config.family, outlier_rate=outlier_rate, seed=seed)
        super().__init__(scene, config, client=client, camera=camera, calibration=calibration)


class ColourClient:
    """Answers as a model of some family would; the same questions in order, the same answers."""

    model = "found by colour"

    def __init__(
        self, family: Family = "glm-4.5v", *, outlier_rate: float = 0.0, seed: int = 0
    ) -> None:
        """Take the settings; arguments and errors as in `ColourCamera`."""
        if not 0 <= outlier_rate <= 1:
            raise ConfigurationError(f"outlier_rate = {outlier_rate}; expected a share from 0 to 1")
        self._family = family
        self._outlier_rate = outlier_rate
        self._rng = np.random.default_rng(seed)
        self._found: tuple[object, str, Box | None] = (None, "", None)

    def ask(self, words: str, picture: Picture) -> Answer:
        """Find what has the colour that the words name, and say where."""
        size = (picture.shape[1], picture.shape[0])
        astray = self._rng.random() < self._outlier_rate
        if self._found[0] is not picture or self._found[1] != words:  # it is asked several times
            self._found = (picture, words, find_by_colour(picture, words))
        box = self._found[2]
        if box is not None and astray:  # of the same size, anywhere in the picture
            width, height = box[2] - box[0], box[3] - box[1]
            left = self._rng.uniform(0, size[0] - width)
            top = self._rng.uniform(0, size[1] - height)
            box = left, top, left + width, top + height
        return Answer(say_box(box, size, words, self._family), None, "stop")

    def close(self) -> None:
        """Nothing is held."""


def say_box(box: Box | None, size: tuple[int, int], words: str, family: Family) -> str:
    """Return the answer of a model of some family: the box in its scale, an empty list for none.

    The box is in pixels of the picture that was sent, and `size` that picture's width and height.
    """
    if box is None:
        numbers = []
    else:
        step = FORMATS[family].side_multiple
        pixels = FORMATS[family].scale == "pixels"
        seen = [step * round(side / step) if pixels else 1000 for side in size]
        numbers = [[round(v * seen[i % 2] / size[i % 2]) for i, v in enumerate(box)]]
    if family == "glm-4.5v":
        return f"The bounding box is <|begin_of_box|>{json.dumps(numbers)}<|end_of_box|>."
    key, order = ("box_2d", (1, 0, 3, 2)) if FORMATS[family].y_first else ("bbox_2d", range(4))
    labelled = [{key: [found[i] for i in order], "label": words} for found in numbers]
    return f"```json\n{json.dumps(labelled)}\n```"


def find_by_colour(picture: Picture, words: str) -> Box | None:
    """Find the box, in pixels, around what has the colour that the words name; None if nothing has.

    ConfigurationError if the words name none of `COLOURS`, several, or a shade or the lack of one.
    """
    from PIL import Image
    from scipy import ndimage

    named = [colour for colour in COLOURS if re.search(rf"\b{colour}\b", words, re.IGNORECASE)]
    if len(named) != 1:
        raise ConfigurationError(
            f"{words!r} names {len(named)} colours; to be found by colour it must name one of "
            f"{', '.join(COLOURS)}"
        )
    if shade := re.search(rf"\b({_SHADES})[\s-]*{named[0]}\b", words, re.IGNORECASE):
        raise ConfigurationError(
            f"{words!r}: {shade[0]!r} is not told from {named[0]} by its colour; touch it, have it "
            "found by a model, or use an object of another colour"
        )
    low, high, least_saturation = COLOURS[named[0]]
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
