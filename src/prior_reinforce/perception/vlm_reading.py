"""What a vision-language model was shown, what it said, and what was made of it: the record.

Every answer is kept as it came, so that a doubtful trial can be judged later; the boxes are drawn
on the picture for the operator.
"""

from __future__ import annotations

import io
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import Picture
from prior_reinforce.files import write
from prior_reinforce.perception.vlm_formats import Box

if TYPE_CHECKING:
    from PIL import ImageDraw

REACHED_COLOUR = (0, 90, 255)
GOAL_COLOUR = (200, 0, 160)

OffBy = Literal["cut", "hidden", "too large"]
"""Why a box's middle may be beside the object's: the picture's border cuts the object, a side is
too short for a round one, or a side is longer than any of it."""


@dataclass(frozen=True)
class Answer:
    """One answer to one request."""

    text: str
    """The model's words, untouched."""
    thinking: str | None
    """Its thoughts, where the server keeps them apart; never searched for boxes."""
    finish_reason: str | None
    """Why it stopped, in the protocol's words: `stop`, `length`, ..."""
    box: Box | None = None
    """The box read, in pixels of the picture; None where there is a problem."""
    problem: str | None = None
    """Why no box could be read."""
    absent: bool = False
    """Whether the model says that the object is not there."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """One object: all answers about it, and the place they agree on."""

    words: str
    """The object, as it was asked for."""
    answers: tuple[Answer, ...]
    box: Box | None = None
    """Median box of the answers that agree, in pixels of the picture."""
    place: Float[np.ndarray, "2"] | None = None
    """Centre of `box` on the calibrated plane, table frame, in [m]."""
    problem: str | None = None
    """Why there is no place."""
    unanswered: bool = False
    """Whether that is for want of an answer, and not of a readable one."""
    off: Float[np.ndarray, "2"] = field(default_factory=lambda: np.zeros(2))
    """How far `place` may be beside the object's middle, by the box's shape and size, in [m]."""
    off_by: OffBy | None = None
    """By what most; None where the box is around the object alone and as a whole."""


@dataclass(frozen=True, eq=False)
class PictureReading:
    """One picture, read."""

    picture: Picture
    """What was shown."""
    model: str
    """Who was asked."""
    reached: Sighting
    goal: Sighting | None
    """None where `reached` failed already, and nobody was asked."""
    goal_place: Float[np.ndarray, "2"] | None = None
    """The goal, as far from its object's centre as the scene says, in [m]."""
    goal_pixel: tuple[float, float] | None = None
    """The goal in the picture."""
    scale: float = 1.0
    """How many times as large as they are both objects look; 1 where that may be chance."""
    sd: Float[np.ndarray, "2"] | None = None
    """Standard deviation of `error_seen`, in [m]."""

    @property
    def problem(self) -> str | None:
        """Why there is no error to report; None where there is one."""
        return self.reached.problem or (self.goal.problem if self.goal else None)

    @property
    def unanswered(self) -> bool:
        """Whether the endpoint gave no answer about one of them."""
        return self.reached.unanswered or (self.goal is not None and self.goal.unanswered)

    @property
    def error_seen(self) -> Float[np.ndarray, "2"] | None:
        """Reached place minus goal, in [m]; None where there is a problem."""
        if self.reached.place is None or self.goal_place is None:
            return None
        return self.reached.place - self.goal_place

    def drawn(self) -> Picture:
        """Return the picture with boxes, agreed ones thick, single answers thin, and the error."""
        from PIL import Image, ImageDraw

        image = Image.fromarray(self.picture)
        pen = ImageDraw.Draw(image)
        found = [(self.reached, REACHED_COLOUR)]
        found += [(self.goal, GOAL_COLOUR)] if self.goal is not None else []
        for sighting, colour in found:
            for answer in sighting.answers:
                if answer.box is not None:
                    pen.rectangle(answer.box, outline=colour, width=1)
        if self.reached.box is not None and self.goal_pixel is not None:
            left, top, right, bottom = self.reached.box
            middle = ((left + right) / 2, (top + bottom) / 2)
            pen.line([self.goal_pixel, middle], fill="black", width=2)
            pen.circle(self.goal_pixel, 4, outline="black", width=2)
        agreed = [(s.words, s.box, colour) for s, colour in found if s.box is not None]
        boxes = np.array([box for _, box, _ in agreed]).reshape(-1, 4)
        # The upper object's words go above it, the lower's below it; of two that are close
        # together, above and below both, so that words never cover a box.
        apart = np.ptp(boxes[:, :2] + boxes[:, 2:], axis=0).max() if len(boxes) == 2 else np.inf
        for words, (left, top, right, bottom), colour in agreed:
            pen.rectangle((left - 3, top - 3, right + 3, bottom + 3), outline=colour, width=3)
            above = top + bottom == (boxes[:, 1] + boxes[:, 3]).min()
            if apart < 2 * image.width / 5:
                top, bottom = boxes[:, 1].min(), boxes[:, 3].max()
            at = ((left + right) / 2, top - 8 if above else bottom + 8)
            _write(pen, words, at, colour, image.size, above=above)
        return np.asarray(image)

    def save(self, folder: str | os.PathLike[str], stem: str) -> None:
        """Write `stem`.png (the picture with boxes) and `stem`.json (every answer) to a folder."""
        from PIL import Image

        folder, drawn = Path(folder), io.BytesIO()
        Image.fromarray(self.drawn()).save(drawn, format="PNG")
        write(folder / f"{stem}.png", drawn.getvalue())
        record = json.dumps(self._record(), indent=2, ensure_ascii=False)
        write(folder / f"{stem}.json", record + "\n")

    def _record(self) -> dict[str, Any]:
        return {
            "model": self.model,
            "picture_size_px": [self.picture.shape[1], self.picture.shape[0]],
            "error_seen_m": _listed(self.error_seen),
            "sd_m": _listed(self.sd),
            "problem": self.problem,
            "reached": _sighting_record(self.reached),
            "goal": None if self.goal is None else _sighting_record(self.goal),
            "goal_place_m": _listed(self.goal_place),
        }


def _listed(place: Float[np.ndarray, "2"] | None) -> list[float] | None:
    return None if place is None else place.tolist()


def _sighting_record(sighting: Sighting) -> dict[str, Any]:
    return {
        "words": sighting.words,
        "box_px": sighting.box,
        "place_m": _listed(sighting.place),
        "problem": sighting.problem,
        "answers": [vars(answer) for answer in sighting.answers],
    }


def _write(
    pen: ImageDraw.ImageDraw,
    words: str,
    at: tuple[float, float],
    colour: tuple[int, int, int],
    size: tuple[int, int],
    *,
    above: bool,
) -> None:
    """Write words centred above or below a point, shifted to stay in a picture of `size` [px]."""
    font_size = max(12, size[1] // 40)
    half = pen.textlength(words, font_size=font_size) / 2 + 4
    x = min(max(at[0], half), size[0] - half)
    y = max(at[1], font_size + 4) if above else min(at[1], size[1] - font_size - 4)
    look: Any = {"font_size": font_size, "stroke_width": 3, "stroke_fill": "white"}
    pen.text((x, y), words, fill=colour, anchor="mb" if above else "mt", **look)
