"""How each family of vision-language models is asked for a box, and how its answer is read.

Which scale a model answers in cannot be told from its numbers: 412 is a plausible value in
thousandths and in pixels. So the scale belongs to the family, and the family is a setting. A key
that is another family's own (`box_2d`), or that says which side a number is (`xmin`), counts more.

Sources: zai-org/GLM-V README, "Grounding" (prompt, markers, brackets, scale), issue #118 (drafts
inside the thinking text); QwenLM/Qwen3-VL issues #676 and #866 (absolute pixels of the resized
image for Qwen2.5-VL), #1486 and #1640 (0-1000 for Qwen3-VL); ai.google.dev/gemini-api/docs,
"Image understanding" (`box_2d`, y first, 0-1000).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal

from prior_reinforce.errors import PerceptionFailedError

Family = Literal["glm-4.5v", "qwen2-vl", "qwen2.5-vl", "qwen3-vl", "gemini"]
"""GLM-4.1V, 4.5V and 4.6V are one family in this respect."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, in pixels of the picture that was sent."""


class UnreadableAnswerError(PerceptionFailedError):
    """One answer holds no box that can be trusted; another answer may."""


class NotInPictureError(UnreadableAnswerError):
    """The model says that the object is not there."""


@dataclass(frozen=True)
class BoxFormat:
    """The request and the answer of one family."""

    prompt: str
    """What to ask; `{words}` stands for the object."""
    scale: Literal["thousandths", "pixels"]
    """Unit of the answer: 1/1000 of the picture's width (x) and height (y), or pixels."""
    y_first: bool = False
    """Whether the answer is top, left, bottom, right."""
    side_multiple: int = 1
    """The sent picture's sides are multiples of this, in [px]. Where the answer is in pixels, they
    are pixels of the picture as the server resizes it; this leaves it no reason to."""


# The smallest limit in use for pictures of these families: 1280 tokens of 28 x 28 px
# (qwen-vl-utils; the models' own preprocessor_config.json allow more). Above it a server shrinks.
MOST_PIXELS = 1280 * 28 * 28

_QWEN_PROMPT = (
    "Locate {words} in the image. There is at most one. Output its bounding box in JSON as "
    '[{{"bbox_2d": [x1, y1, x2, y2], "label": "{words}"}}], or [] if it is not in the image.'
)

FORMATS: dict[Family, BoxFormat] = {
    # The first sentence is the README's form; the rest is ours: one object, and a way to say no.
    "glm-4.5v": BoxFormat(
        prompt="Help me to locate {words} in the image and give me its bounding box. "
        "There is at most one. Answer [] if it is not in the image.",
        scale="thousandths",
    ),
    "qwen2-vl": BoxFormat(_QWEN_PROMPT, "thousandths"),
    "qwen2.5-vl": BoxFormat(_QWEN_PROMPT, "pixels", side_multiple=28),
    "qwen3-vl": BoxFormat(_QWEN_PROMPT, "thousandths"),
    "gemini": BoxFormat(
        "Locate {words} in the image. There is at most one. Output its bounding box in JSON as "
        '[{{"box_2d": [ymin, xmin, ymax, xmax], "label": "{words}"}}], scaled to 0-1000, or [] if '
        "it is not in the image.",
        "thousandths",
        y_first=True,
    ),
}


def size_to_send(width: int, height: int, most_side: int, box_format: BoxFormat) -> tuple[int, int]:
    """Return the largest size, at most a picture's own, that a server will leave as it is.

    All are in [px], `most_side` is the longest to send; the shape may change by less than a
    multiple of the format's.
    """
    step = box_format.side_multiple
    shrink = min(1.0, most_side / max(width, height), math.sqrt(MOST_PIXELS / (width * height)))
    return max(1, int(width * shrink / step)) * step, max(1, int(height * shrink / step)) * step


def read_box(answer: str, box_format: BoxFormat, size: tuple[int, int]) -> Box:
    """Read the one box of an answer, in pixels of the picture of `size` that was sent.

    Thinking text is skipped; of several boxes the last marked one counts, else the last one in the
    text, as models restate and correct themselves. Swapped corners are put right. NotInPictureError
    if the answer is an empty list; UnreadableAnswerError for no box, several at once, or one that
    cannot be in the picture.
    """
    thoughts = [*_THOUGHTS.finditer(answer)]
    if thoughts and not thoughts[-1]["ends"]:
        raise UnreadableAnswerError("the answer ends while the model is still thinking")
    said = " ".join(answer[thoughts[-1].end() if thoughts else 0 :].split())
    if len(said) > _LONGEST:
        raise UnreadableAnswerError(f"an answer of {len(said)} characters to a plain question")
    said = _OBJECT.sub(_as_list, said)
    marked = _MARKED.findall(said)
    boxes = _last_boxes(marked[-1] if marked else said)
    if boxes is None and marked:
        boxes = _last_boxes(said)
    if boxes is None:
        shown = said if len(said) <= 80 else said[:77] + "..."
        raise UnreadableAnswerError(f"no box in the answer {shown!r}")
    if not boxes:
        raise NotInPictureError("the model says that it is not in the picture")
    if len(boxes) > 1:
        raise UnreadableAnswerError(f"{len(boxes)} boxes for one object")
    *_, last = _BOX_OR_EMPTY.finditer(said)
    behind = _QUOTED.sub("", said[last.end() :])
    if _TAKEN_BACK.search(behind):
        raise UnreadableAnswerError(f"behind its box the answer says {behind[:80].strip()!r}")
    key, *numbers = boxes[0]
    if key == "box_2d":
        box_format = FORMATS["gemini"]
    elif key:
        box_format = replace(box_format, y_first=False)
    return _in_pixels(numbers, box_format, size)


_LONGEST = 20_000
"""Characters of an answer that is read, without its thinking; ours: a box takes fifty."""
# Every part has a limit, so that no answer takes long to search; white space is single by then.
_NUMBER = r"(-?(?<![\d.])\d{1,9}(?:\.\d{1,20})?(?![\d]))"
_BETWEEN = r" ?[\])>]? ?, ?[\[(<]? ?"  # "(x1, y1), (x2, y2)" counts as one box
_KEY = r"(?:[\"'](box_2d|bbox_2d|sides)[\"'] ?: ?[\[( ]{0,4})?"
_BOX_OR_EMPTY = re.compile(_KEY + _BETWEEN.join([_NUMBER] * 4) + r"|\[[ \[\]]{0,40}\]")
_OBJECT = re.compile(r"\{[^{}]{0,400}\}")
_SIDE = re.compile(rf"[\"'](\w{{1,8}})[\"'] ?: ?{_NUMBER}")
_SIDES = (
    ("x1", "y1", "x2", "y2"),
    ("xmin", "ymin", "xmax", "ymax"),
    ("x_min", "y_min", "x_max", "y_max"),
    ("left", "top", "right", "bottom"),
)
"""Keys of a box whose numbers stand each under one of its own."""
_MARKED = re.compile(
    r"<\|(?:begin_of_box|box_start)\|>(.*?)(?:<\|(?:end_of_box|box_end)\|>|\Z)", re.DOTALL
)
_THOUGHTS = re.compile(
    r"[<\[◁](?P<ends>/?)(?:\w{1,9}:)?(?:think|thinking|thought|reasoning)[>\]▷]", re.IGNORECASE
)
"""Begin and end of thinking text: `<think>`, `[/THINK]`, `◁/think▷`, `</seed:think>`."""
_QUOTED = re.compile(r"\"[^\"]*\"")
_TAKEN_BACK = re.compile(
    r"\b(?:no|not|never|none|cannot|but|however|wait|sorry|wrong|mistake)\b|n['’]t\b|[不没]",
    re.IGNORECASE,
)
"""Words behind a box of an answer that does not stand by it; ours: models that do say little."""
_SEPARATORS = re.compile(r"[\s,;\[\](){}<>]*")
_MARKER = re.compile(r"<\|[a-z_]+\|>")


def _as_list(found: re.Match[str]) -> str:
    """An object with a number for each side as a list of them; any other as it is."""
    said = dict(_SIDE.findall(found[0]))
    for keys in _SIDES:
        if all(key in said for key in keys):
            return f'"sides": [{", ".join(said[key] for key in keys)}]'
    return found[0]


def _last_boxes(said: str) -> list[tuple[str, float, float, float, float]] | None:
    """Return the different boxes of the last list in a text; [] for an empty list, None for none.

    Each has its key before it, empty where there is none.

    Boxes belong to one list if they share an outer bracket, or follow each other with nothing but
    separators between them.
    """
    text = " ".join(_MARKER.sub(" ", said).split())
    depths = list(accumulate((c in "[({") - (c in "])}") for c in text))
    last: list[tuple[str, float, float, float, float]] | None = None
    end = 0
    for found in _BOX_OR_EMPTY.finditer(text):
        start, is_box = found.start(), found[2] is not None
        follows = _SEPARATORS.fullmatch(text, end, start) or min(depths[end:start]) > 0
        if last is None or not follows or not is_box:
            last = []
        if is_box:
            key, *sides = found.groups()
            one, two, three, four = map(float, sides)
            last += [box for box in [(key or "", one, two, three, four)] if box not in last]
        end = found.end()
    return last


def _in_pixels(numbers: list[float], box_format: BoxFormat, size: tuple[int, int]) -> Box:
    most_x, most_y = (1000, 1000) if box_format.scale == "thousandths" else size
    (left, right), (top, bottom) = sorted(numbers[::2]), sorted(numbers[1::2])
    if box_format.y_first:
        left, right, top, bottom = top, bottom, left, right
    if left < 0 or top < 0 or right > most_x or bottom > most_y:
        raise UnreadableAnswerError(
            f"box {list(numbers)} leaves the picture, which ends at ({most_x}, {most_y}) in this "
            "family's scale; is the model family set right?"
        )
    if not (right > left and bottom > top):
        raise UnreadableAnswerError(f"box {list(numbers)} has no area")
    per_x, per_y = size[0] / most_x, size[1] / most_y
    return left * per_x, top * per_y, right * per_x, bottom * per_y
