"""Reading boxes: each line is an answer that a served model has been seen to give."""

from __future__ import annotations

import json
from contextlib import nullcontext, suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prior_reinforce.perception.vlm_formats import (
    FORMATS,
    MOST_PIXELS,
    NotInPictureError,
    UnreadableAnswerError,
    read_box,
    size_to_send,
)

GLM = FORMATS["glm-4.5v"]
BOX = "<|begin_of_box|>[[100, 200, 300, 500]]<|end_of_box|>"
DRAFT = "<|begin_of_box|>[[1, 2, 3, 4]]<|end_of_box|>"
EXPECTED = (100.0, 200.0, 300.0, 500.0)


@pytest.mark.parametrize(
    "answer",
    [
        BOX,
        "[[100,200,300,500]]",
        "[100, 200, 300, 500]",
        "<|begin_of_box|>(100, 200, 300, 500)<|end_of_box|>",
        "<|begin_of_box|>(100,200),(300,500)<|end_of_box|>",
        "<|begin_of_box|><100,200,300,500><|end_of_box|>",
        "<|begin_of_box|>{100, 200, 300, 500}<|end_of_box|>",
        "<|begin_of_box|>100, 200, 300, 500<|end_of_box|>",
        "[[100.0, 200.0, 300.0, 500.0]]",
        "[[300, 500, 100, 200]]",
        "[[300, 200, 100, 500]]",
        "[[100, 500, 300, 200]]",
        "The ball (6 cm wide) is at [[100, 200, 300, 500]]. I looked 2 times, at 1 ball.",
        f"{DRAFT} Looking again: {BOX}",
        f"{BOX} That is the same as [[9, 9, 10, 10]] in the other picture.",
        "At first [[1, 2, 3, 4]]. On second thought [[100, 200, 300, 500]].",
        f"<think>It may be {DRAFT}</think>{BOX}",
        f"It may be {DRAFT} hm {DRAFT}</think>\n{BOX}",
        "<think>[[1, 2, 3, 4]]</think>So: [100, 200, 300, 500]",
        BOX + "<|user|>",
        "<|begin_of_box|>[[100, 200, 300, 500]]",
        "[[100, 200, 300, 500]]<|end_of_box|>",
        "[[100, 200, 300, 500]], as I said: [[100, 200, 300, 500]]",
        "[[100, 200, 300, 500], [100, 200, 300, 500]]",
        "[] would be wrong, it is there: [[100, 200, 300, 500]]",
        "<|begin_of_box|>here<|end_of_box|> [[100, 200, 300, 500]]",
        '```json\n[{"bbox_2d": [100, 200, 300, 500], "label": "the 2, 3, 4 ball"}]\n```',
        "<|box_start|>(100,200),(300,500)<|box_end|>",
        f"◁think▷It may be {DRAFT}◁/think▷{BOX}",
        f"[THINK]It may be {DRAFT}[/THINK]{BOX}",
        f"{BOX} Hope that helps!",
        '[{"bbox_2d": [100, 200, 300, 500], "label": "the ball, not the hoop"}]',
    ],
)
def test_the_box_is_read(answer):
    assert read_box(answer, GLM, (1000, 1000)) == EXPECTED


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("", "no box"),
        ("I'm sorry, I cannot help with that.", "no box in the answer \"I'm sorry"),
        ("There is no orange ball in this image.", "no box"),
        ("At first I thought [[100, 200, 300, 500]], but it is hidden.", "but it is hidden"),
        (f"{BOX} Sorry, that is another ball.", "another ball"),
        (f"{BOX} On a closer look the ball isn't in the image.", "isn't in the image"),
        (f"◁think▷It may be {DRAFT}◁/think▷ The ball is not in the image.", "no box"),
        (f"[THINK]It may be {DRAFT}[/THINK]It is not there.", "no box"),
        (f"<seed:think>It may be {DRAFT}", "still thinking"),
        ("[[100, 200, 300", "no box"),
        ("[[100, 200, 300]]", "no box"),
        (f"<think>It may be {BOX}", "still thinking"),
        ("[[100, 200, 300, 500], [600, 700, 800, 900]]", "2 boxes"),
        ("[[100, 200, 300, 500]], [[600, 700, 800, 900]]", "2 boxes"),
        ("<|begin_of_box|>[[1, 2, 3, 4], [5, 6, 7, 8], [5, 6, 9, 9]]<|end_of_box|>", "3 boxes"),
        (
            '[{"bbox_2d": [1, 2, 3, 4], "label": "b"}, {"bbox_2d": [5, 6, 7, 8], "label": "b"}]',
            "2 boxes",
        ),
        ("[[100, 200, 300, 1001]]", "leaves the picture"),
        ("[[-1, 200, 300, 500]]", "leaves the picture"),
        ("[[100, 200, 1400, 500]]", "family set right"),
        ("[[100, 200, 100, 500]]", "no area"),
    ],
)
def test_what_holds_no_single_box_is_refused(answer, message):
    with pytest.raises(UnreadableAnswerError, match=message):
        read_box(answer, GLM, (1000, 1000))


@pytest.mark.parametrize(
    "answer",
    [
        "[]",
        "[[]]",
        "<|begin_of_box|>[]<|end_of_box|>",
        "```json\n[]\n```",
        "Not there: []",
        "At first [[1, 2, 3, 4]], but no: []",
        f"<think>{DRAFT}</think>[]",
    ],
)
def test_an_empty_list_means_not_there(answer):
    with pytest.raises(NotInPictureError):
        read_box(answer, GLM, (1000, 1000))


def test_the_scale_belongs_to_the_family():
    answer = '[{"bbox_2d": [100, 200, 300, 500], "label": "the ball"}]'
    thousandths = (50.0, 140.0, 150.0, 350.0)
    for family in ("glm-4.5v", "qwen2-vl", "qwen3-vl"):
        assert read_box(answer, FORMATS[family], (500, 700)) == thousandths
    assert read_box(answer, FORMATS["qwen2.5-vl"], (504, 700)) == EXPECTED
    with pytest.raises(UnreadableAnswerError, match=r"ends at \(280, 700\)"):
        read_box(answer, FORMATS["qwen2.5-vl"], (280, 700))


@pytest.mark.parametrize(
    "answer",
    [
        "[" * 300_000,
        "1" * 300_000,
        "[1, 2, 3, 4] " * 20_000,
        " " * 300_000 + "x",
        "[" * 19_000,
        "1" * 19_000,
        "1, " * 6_000,
        "[1,2,3,4]x" * 1_900,
        "<|begin_of_box|>" * 1_200,
        "<|" + "a" * 19_000,
    ],
)
def test_no_answer_takes_long_to_search(answer):
    """None of these ended within a minute, or their like at this length took seconds."""
    with suppress(UnreadableAnswerError):
        read_box(answer, GLM, (1000, 1000))


def test_a_number_is_never_read_from_its_middle():
    with pytest.raises(UnreadableAnswerError, match="no box"):
        read_box("[1000000000100, 200, 300, 500]", GLM, (1000, 1000))


@pytest.mark.slow
@settings(max_examples=200)
@given(st.text(alphabet="[](){}<>,.-0123456789 |abox_nd", max_size=300))
def test_any_text_is_a_box_in_the_picture_or_unreadable(text):
    try:
        left, top, right, bottom = read_box(text, GLM, (640, 480))
    except UnreadableAnswerError:
        return
    assert 0 <= left < right <= 640
    assert 0 <= top < bottom <= 480


@pytest.mark.parametrize("width", [280, 640, 896, 1000, 1920, 6000])
@pytest.mark.parametrize("height", [280, 480, 896, 1080])
def test_a_server_has_no_reason_to_resize_what_is_sent(width, height):
    sent = size_to_send(width, height, 1000, FORMATS["qwen2.5-vl"])
    assert all(side % 28 == 0 and 28 <= side <= 1000 for side in sent)
    assert sent[0] * sent[1] <= MOST_PIXELS
    shrunk = min(1.0, 1000 / max(width, height))
    assert abs(sent[0] - width * shrunk) < 28 * 2
    assert abs(sent[1] - height * shrunk) < 28 * 2


def test_a_small_picture_is_sent_as_it_is():
    assert size_to_send(640, 481, 1000, GLM) == (640, 481)
    assert size_to_send(896, 896, 1000, FORMATS["qwen2.5-vl"]) == (896, 896)


def test_the_prompt_names_the_object_once_asked():
    for box_format in FORMATS.values():
        prompt = box_format.prompt.format(words="the orange ball")
        assert "the orange ball" in prompt
        assert "{{" not in prompt


@pytest.mark.parametrize(
    ("family", "answer"),
    [
        ("glm-4.5v", '```json\n[{"box_2d": [200, 100, 500, 300], "label": "ball"}]\n```'),
        ("qwen2.5-vl", '[{"box_2d": [200, 100, 500, 300]}]'),
        ("gemini", "[[200, 100, 500, 300]]"),
        ("gemini", "[{'bbox_2d': [100, 200, 300, 500]}]"),
        ("gemini", '{"ymin": 200, "xmin": 100, "ymax": 500, "xmax": 300, "label": "ball"}'),
        ("glm-4.5v", '{"box": {"x1": 100, "y1": 200, "x2": 300, "y2": 500}}'),
        ("qwen3-vl", '{"left": 100.0, "top": 200, "right": 300, "bottom": 500}'),
    ],
)
def test_a_key_says_which_side_a_number_is(family, answer):
    assert read_box(answer, FORMATS[family], (1000, 1000)) == EXPECTED


BALL = "the orange ball"
HERE, THERE = [412, 300, 450, 340], [600, 300, 660, 360]


def seen_at(answer, family="qwen3-vl", words=BALL):
    return [*read_box(answer, FORMATS[family], (1000, 1000), words)]


def labelled(box=HERE, label=BALL, **more):
    return json.dumps({"bbox_2d": box, "label": label, **more}, ensure_ascii=False)


@pytest.mark.parametrize(
    "answer",
    [
        f"The orange ball is not in the image. There is only a yellow ball at {HERE}.",
        f"There is no orange ball, but a lemon at <|begin_of_box|>[{HERE}]<|end_of_box|>.",
        f"I cannot see an orange ball. The closest match is the hoop: [{HERE}]",
        f"I'm unable to find it. A similar object: ```json\n[{labelled()}]\n```",
        f"图中没有橙色的球，只有一个红色的圆环：{HERE}",
        f"[]. The closest object is at {HERE}.",
        f"The orange ball is at {HERE}. It is a lemon, not the orange ball.",
        f"{HERE}. This is not the object you asked for.",
        f"{HERE}, not to be confused with the orange ball.",
        f"{HERE}. There is no ball other than this yellow one.",
        labelled(label="a lemon, not the orange ball"),
        labelled(label="the orange ball (not visible)"),
        labelled(present=False),
        labelled(confidence=0.02),
        labelled(confidence="low"),
        labelled(reasoning="There is no orange ball, so this is the lemon."),
        json.dumps({"found": False, "box": {"x1": 412, "y1": 300, "x2": 450, "y2": 340}}),
    ],
)
def test_a_box_that_its_answer_denies_is_none(answer):
    with pytest.raises(UnreadableAnswerError):
        seen_at(answer)


@pytest.mark.parametrize(
    "answer",
    [
        f"1. Orange ball: {HERE}\n2. Orange ball: {THERE}",
        f"{labelled()}\n{labelled(THERE)}",
        f"```json\n[{labelled()}]\n```\nand\n```json\n[{labelled(THERE)}]\n```",
        f"<|begin_of_box|>[{HERE}]<|end_of_box|> and <|begin_of_box|>[{THERE}]<|end_of_box|>",
        f"The orange ball could be {HERE} or {THERE}.",
        f"{HERE}; a second orange ball is at {THERE}",
        f"The ball is at {HERE}. The hoop is at {THERE}.",
        f"The ball is at {HERE}. Finally, the hoop is at {THERE}.",
        f"The ball is at {HERE}. Actually, there is also one at {THERE}.",
        f"{labelled()} {THERE}",
        f"{HERE} in an image of [0, 0, 1000, 1000]",
        "(431, 320), (412, 300), (450, 340)",
        "[0.98, 412, 300, 450, 340]",
    ],
)
def test_several_boxes_are_none_wherever_they_stand(answer):
    with pytest.raises(UnreadableAnswerError, match=r"\d boxes"):
        seen_at(answer)


@pytest.mark.parametrize(
    ("label", "words", "is_read"),
    [
        ("the red hoop", BALL, False),
        ("not found", BALL, False),
        ("none", BALL, False),
        ("yellow ball", BALL, False),
        ("orange cup", BALL, False),
        ("cup 1", "the cup 2", False),
        ("红色的圆环", "橙色的球", False),
        ("橙色球", "橙色的球", True),
        ("Orange balls", BALL, True),
        ("ball", BALL, True),
        ("small orange ball", BALL, True),
        ("the orange ball, not the hoop", BALL, True),
        ("target object", BALL, True),
        ("the ball with no stripes", "the ball with no stripes", True),
    ],
)
def test_a_box_is_of_what_its_label_says(label, words, is_read):
    for answer in (
        labelled(label=label),
        f"<ref>{label}</ref><box>[{HERE}]</box>",
        labelled(label=label).replace(str(HERE), '{"x1": 412, "y1": 300, "x2": 450, "y2": 340}'),
    ):
        with nullcontext() if is_read else pytest.raises(UnreadableAnswerError, match="labelled"):
            assert seen_at(answer, words=words) == HERE


@pytest.mark.parametrize(
    "answer",
    [
        f"[{labelled()}, {labelled(THERE, 'the red hoop')}]",
        f"{labelled(THERE, 'the red hoop')}\n{labelled()}",
        f"```json\n{labelled()}\n```\n```json\n{labelled(THERE, 'the red hoop')}\n```",
        f"<ref>the orange ball</ref><box>[{HERE}]</box><ref>the hoop</ref><box>[{THERE}]</box>",
        f"{THERE}. Correction: {HERE}",
        f"The ball is at {THERE}. Wait, that is wrong. It is at {HERE}.",
        f"I first thought of {THERE}, but that is not orange. **Final answer:** {HERE}",
        f"The object at {THERE} is the red hoop. Therefore, the answer is {HERE}",
        f"First, {THERE}, which is red. Second, {HERE}, which is orange. Final answer: {HERE}",
        f"<analysis>maybe {THERE}</analysis> {HERE}",
        f"It is at {HERE}: {labelled()}",
    ],
)
def test_of_several_boxes_the_one_that_is_meant_is_read(answer):
    assert seen_at(answer) == HERE


@pytest.mark.parametrize(
    "answer",
    [
        labelled(attributes=[]),
        labelled(occluded=False, truncation="none", confidence=0.97),
        f"{HERE}. Other objects: []",
        json.dumps({"objects": [{"bbox_2d": HERE}], "warnings": []}),
        f"{HERE}. There are no other balls in the image.",
        f"{HERE}. I do not see any other ball.",
        f"{HERE}, not to be confused with the hoop.",
        f"The orange ball is fully visible and not occluded, at {HERE}.",
        f"I see an orange ball, not cut by the border: {HERE}. It may not be perfectly round.",
        labelled(description="No obstruction; in thousandths, not pixels."),
        f"橙色的球：{HERE}。没有其他球。",
        str(HERE).replace(", ", "，"),
        "［４１２，３００，４５０，３４０］",
        '["412", "300", "450", "340"]',
        '{"x1": "412", "y1": "300", "x2": "450", "y2": "340"}',
        "[412px, 300px, 450px, 340 px]",
        "<box>412 300 450 340</box>",
        '{"x": 412, "y": 300, "width": 38, "height": 40}',
        '{"left": 412, "top": 300, "width": 38, "height": 40}',
        '{"top_left": [412, 300], "bottom_right": [450, 340]}',
        '{"top_left": {"x": 412, "y": 300}, "bottom_right": {"x": 450, "y": 340}}',
        "[412, 300, 450, 340, 0.98]",
    ],
)
def test_a_clear_answer_is_read_in_whatever_form(answer):
    assert seen_at(answer) == HERE
