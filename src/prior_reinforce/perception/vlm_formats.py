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
import unicodedata
from dataclasses import dataclass, replace
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


def read_box(answer: str, box_format: BoxFormat, size: tuple[int, int], words: str = "") -> Box:
    """Read where an answer says the object is, in pixels of the picture of `size` that was sent.

    Thinking text is skipped, and where boxes are marked only they count. A box that is restated or
    corrected gives way to the later one, and one that is labelled as something else than the
    `words` asked for to one that is not. Swapped corners are put right. NotInPictureError if the
    answer is an empty list; UnreadableAnswerError for no box, several, one that the answer itself
    denies, or one that cannot be in the picture.
    """
    thoughts = [*_THOUGHTS.finditer(answer)]
    if thoughts and not thoughts[-1]["ends"]:
        raise UnreadableAnswerError("the answer ends while the model is still thinking")
    said = unicodedata.normalize("NFKC", answer[thoughts[-1].end() if thoughts else 0 :])
    said = " ".join(said.split())
    if len(said) > _LONGEST:
        raise UnreadableAnswerError(f"an answer of {len(said)} characters to a plain question")
    statements, behind = _statements(said)
    if not statements:
        shown = said if len(said) <= 80 else said[:77] + "..."
        raise UnreadableAnswerError(f"no box in the answer {shown!r}")
    if not statements[-1].boxes:
        raise NotInPictureError("the model says that it is not in the picture")
    own = [each for each in statements if _may_be(each.label, words)]
    if not own:
        label = statements[-1].label
        raise UnreadableAnswerError(
            f"the box is labelled {label!r}; if that is right, ask for it so"
        )
    if not all(each.boxes for each in own):
        raise UnreadableAnswerError("both an empty list and a box for one object")
    boxes: dict[tuple[float, ...], str] = {}
    for key, numbers in (box for each in own for box in each.boxes):
        boxes[numbers] = key or boxes.get(numbers, "")
    if len(boxes) > 1:
        raise UnreadableAnswerError(f"{len(boxes)} boxes for one object")
    around = "".join(s.before + s.held * (s in own) for s in statements) + behind
    denial = _FLAG.search(around) or _DENIED.search(_about(around, words))
    if denial := denial or _TAKEN_BACK.search(behind):
        shown = denial.string[denial.start() :][:80].strip()
        raise UnreadableAnswerError(f"of its box the answer says {shown!r}")
    ((numbers, key),) = boxes.items()
    if key == "box_2d":
        box_format = FORMATS["gemini"]
    elif key:
        box_format = replace(box_format, y_first=False)
    return _in_pixels(numbers, box_format, size)


@dataclass(frozen=True)
class _Statement:
    """What an answer says of one place."""

    before: str
    """The words since the last place."""
    held: str
    """The JSON object, or the list, that holds the boxes."""

    @property
    def label(self) -> str:
        """What is said to be there; empty where nothing is."""
        labels = _LABEL.findall(self.held)[:1] or _LABEL.findall(self.before)[-1:]
        return "".join(labels[0]) if labels else ""

    @property
    def boxes(self) -> list[tuple[str, tuple[float, ...]]]:
        """Each box with its key, empty where there is none; none for an empty list."""
        boxes = []
        for run in _RUN.finditer(self.held):
            numbers = [float(number) for number in re.findall(_NUMBER, run[2])]
            if len(numbers) % 4 == 1 and 0 <= numbers[-1] <= 1:
                numbers.pop()  # a score
            boxes += [(run[1] or "", (*numbers[i : i + 4],)) for i in range(0, len(numbers), 4)]
        return boxes


_LONGEST = 20_000
"""Characters of an answer that is read, without its thinking; ours: a box takes fifty."""
# Every part has a limit, so that no answer takes long to search; white space is single by then.
_NUMBER = r"[\"']?(-?(?<![\d.])\d{1,9}(?:\.\d{1,20})?(?![\d%]))(?: ?px)?[\"']?"
_BETWEEN = r"(?: ?[\])>]? ?[,;] ?[\[(<]? ?| )"  # "(x1, y1), (x2, y2)" counts as one box
_KEY = r"(?:[\"'](box_2d|bbox_2d|sides)[\"'] ?: ?[\[( ]{0,4})?"
_RUN = re.compile(_KEY + rf"({_NUMBER}(?:{_BETWEEN}{_NUMBER}){{3,}})")
_OBJECT = re.compile(r"(?P<inner>[\"'] ?: ?)?\{(?P<body>[^{}]*)(?:\}|$)")
_EMPTY = r"\[[ \[\]]{0,40}\]"
_PLACE = re.compile(
    r"<\|(?P<mark>[a-z_]+)\|>"
    rf"|(?P<aside>(?:\bothers?\b[^.\[\]]{{0,40}}|[\"']\w{{1,20}}[\"'] ?: ?){_EMPTY})"
    rf"|(?P<held>\{{[^{{}}]*(?:\}}|$)|{_RUN.pattern}|{_EMPTY})",
    re.IGNORECASE,
)
"""Boxes, or an empty list for none; one of other objects or of something else is an aside."""
_SIDE = re.compile(rf"[\"'](\w{{1,8}})[\"'] ?: ?{_NUMBER}")
_SIDES = (
    ("x1", "y1", "x2", "y2"),
    ("xmin", "ymin", "xmax", "ymax"),
    ("x_min", "y_min", "x_max", "y_max"),
    ("left", "top", "right", "bottom"),
    ("left", "top", "width", "height"),
    ("x", "y", "width", "height"),
    ("x", "y", "w", "h"),
)
"""Keys of a box whose numbers stand each under one of its own."""
_CORNERS = re.compile(
    rf"[\"']top_left[\"'] ?: ?([\[(] ?{_NUMBER} ?, ?{_NUMBER} ?[\])]) ?, ?"
    rf"[\"']bottom_right[\"'] ?: ?([\[(] ?{_NUMBER} ?, ?{_NUMBER} ?[\])])"
)
_LABEL = re.compile(
    r"[\"'](?:object_|class_)?(?:label|name|object|class|category)[\"'] ?: ?"
    r"(?:\"([^\"]{0,200})\"|'([^']{0,200})')"
    r"|<ref>(.{0,200}?)</ref>|<\|object_ref_start\|>(.{0,200}?)<\|object_ref_end\|>"
)
_THOUGHTS = re.compile(
    r"[<\[◁](?P<ends>/?)(?:\w{1,9}:)?(?:think|thinking|thought|reasoning|analysis)[>\]▷]",
    re.IGNORECASE,
)
"""Begin and end of thinking text: `<think>`, `[/THINK]`, `◁/think▷`, `</seed:think>`."""
_RESTATED = re.compile(
    r"\b(?:again|second thought|correct(?:ion|ed|ing)|actually|wait|sorry|wrong|final\b|therefore"
    r"|thus|closer look|(?:re-?|double-)check|refin|revis|adjust|updat|more precise"
    r"|answer\W{0,3}(?:is\b|:))|更正|修正|最终",
    re.IGNORECASE,
)
"""Words between two boxes of which the later one replaces the earlier; these words are ours."""
_FURTHER = re.compile(r"\b(?:or|also|another|others?|a second|two|both)\b", re.IGNORECASE)
"""Words between two boxes that are both meant."""
_DENIED = re.compile(
    r"\b(?:no|not|never|none|nothing|neither|cannot|unable|absent|missing|instead)\b"
    r"|\w{1,9}n['’]t\b|[不没未无]",
    re.IGNORECASE,
)
_OF_OTHERS = re.compile(
    r"(?:\bno|\bnot|n['’]t)(?: (?:see|find|have|any|be|partly|partially))* (?:others?|problem|doubt"
    r"|occlu\w{1,6}|obstruct\w{1,6}|obscured|hidden|cut|moving|perfectly|pixels?)\b|没有其[他它]"
    r"|\bnot (?:to be \w{1,9} (?:with|for) )?(?:the|an?) "
    r"(?!(?:object|target|thing|one|right|correct)\b)(?P<thing>[^.,;:]{1,80})",
    re.IGNORECASE,
)
"""Denials that are of other objects, unless the thing is the one that was asked for, or that say
nothing against a box."""
_FLAG = re.compile(
    r"[\"'](?:is_)?(?:present|found|visible|exists?|detected|confidence|score)[\"'] ?: ?"
    r"[\"']?(?:false|no|low|0?\.[0-4]\d{0,20}|0(?:\.0{1,20})?)(?![\w.])",
    re.IGNORECASE,
)
"""A flag that the object is not there, or a confidence below one half."""
_TAKEN_BACK = re.compile(r"\b(?:but|however|wait|sorry|wrong|mistake)\b", re.IGNORECASE)
"""Words behind a box of an answer that does not stand by it: models that do say little."""
_ONE_WORD = re.compile(r"\"[^\"\s]*\"")
_NAME = re.compile(r"[一-鿿]|[^\W_一-鿿]+")
_NAMELESS = {"the", "a", "an", "it", "object", "target", "thing"}


def _statements(said: str) -> tuple[list[_Statement], str]:
    """Split an answer into what it says of each place and the words behind the last one.

    What it replaces by a later statement is left out.
    """
    for _ in range(3):  # as deep as one object is within another
        said = _OBJECT.sub(_opened, _CORNERS.sub(r'"sides": [\1, \4]', said))
    found, is_marked = [], False
    for place in _PLACE.finditer(said):
        if place["mark"]:
            is_marked = place["mark"] in ("begin_of_box", "box_start")
        elif place[0][0] != "{" or _RUN.search(place[0]):
            found.append((place, is_marked))
    marked = [place for place, is_marked in found if is_marked]
    places = marked or [place for place, _ in found if place["held"]] or [p for p, _ in found]
    statements: list[_Statement] = []
    end = 0
    for place in places:
        before, end = said[end : place.start()], place.end()
        again = [*_RESTATED.finditer(before)]
        if statements and again and not _FURTHER.search(before):
            statements, before = [], before[again[-1].start() :]
        statements.append(_Statement(before, place[0]))
    return statements, said[end:]


def _opened(found: re.Match[str]) -> str:
    """A JSON object with its numbers in a list; without braces if it is a value or has no box."""
    inner, body = found["inner"] or "", found["body"]
    said = dict(_SIDE.findall(body))
    for keys in _SIDES:
        if all(key in said for key in keys) and "sides" not in body:
            numbers = [float(said[key]) for key in keys]
            if keys[-1][0] == "h":
                numbers[2:] = numbers[0] + numbers[2], numbers[1] + numbers[3]
            body = f'"sides": {numbers}, {body}'
    if inner and {"x", "y"} == said.keys():
        body = f"[{said['x']}, {said['y']}]"
    return inner + body if inner or not _RUN.search(body) else f"{{{body}}}"


def _names(text: str) -> set[str]:
    """Words that can tell objects apart, without the plural's s."""
    return {name.rstrip("s") for name in _NAME.findall(text.lower())} - _NAMELESS


def _about(text: str, words: str) -> str:
    """A text with what it denies of others left out, and `it` for the object's words."""
    if words:
        text = re.sub(re.escape(words), "it", text, flags=re.IGNORECASE)
    asked, text = _names(words), _ONE_WORD.sub('""', text)
    return _OF_OTHERS.sub(lambda of: of[0] if _names(of["thing"] or "") & asked else "", text)


def _may_be(label: str, words: str) -> bool:
    """Whether a label is of what was asked for: of less or more words than that, or of none."""
    asked, named = _names(words), _names(_OF_OTHERS.sub("", label))
    return not asked or len(label) < 2 or named <= asked or asked <= named


def _in_pixels(numbers: tuple[float, ...], box_format: BoxFormat, size: tuple[int, int]) -> Box:
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
