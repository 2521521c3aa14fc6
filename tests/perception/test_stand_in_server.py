"""The stand-in: what it finds by colour is where it was painted, and it repeats itself."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, PerceptionFailedError
from prior_reinforce.perception.colour_finder import find_by_colour
from prior_reinforce.perception.stand_in_server import StandInServer
from prior_reinforce.perception.vlm_client import ModelClient, VisionLanguageModelConfig

RED, ORANGE, WOOD = (220, 30, 25), (245, 128, 25), (204, 178, 143)


def table(*boxes: tuple[tuple[int, int, int, int], tuple[int, int, int]]) -> np.ndarray:
    """A wooden table of 300 x 200 px with painted boxes (left, top, right, bottom)."""
    picture = np.full((200, 300, 3), WOOD, dtype=np.uint8)
    for (left, top, right, bottom), colour in boxes:
        picture[top:bottom, left:right] = colour
    return picture


def test_an_object_is_found_where_it_was_painted():
    picture = table(((30, 40, 60, 55), RED), ((200, 150, 215, 170), ORANGE))
    assert find_by_colour(picture, "the red hoop") == (30.0, 40.0, 60.0, 55.0)
    assert find_by_colour(picture, "the orange ball") == (200.0, 150.0, 215.0, 170.0)
    assert find_by_colour(picture, "the blue stone") is None


def test_pieces_belong_together_and_specks_do_not():
    pieces = table(((30, 40, 45, 60), RED), ((50, 40, 55, 60), RED), ((280, 5, 283, 8), RED))
    assert find_by_colour(pieces, "the red hoop") == (30.0, 40.0, 55.0, 60.0)
    assert find_by_colour(table(((280, 5, 283, 8), RED)), "the red hoop") is None


@pytest.mark.parametrize("words", ["the ball", "the red and blue ball", "the redder ball"])
def test_words_must_name_one_colour(words):
    with pytest.raises(ConfigurationError, match="it must name one of red, orange, blue, yellow"):
        find_by_colour(table(), words)


def answers(server: StandInServer, words: str, n: int) -> list:
    client = ModelClient(VisionLanguageModelConfig(base_url=server.base_url, max_retries=0))
    picture = client.prepare(table(((30, 40, 60, 55), RED)))
    with closing(client):
        return [client.ask(words, picture).box for _ in range(n)]


def test_the_same_requests_get_the_same_answers_and_a_share_of_them_is_astray():
    runs = []
    for _ in range(2):
        with StandInServer(outlier_rate=0.3, seed=2) as server:
            runs.append(answers(server, "the red hoop", 40))
    assert runs[0] == runs[1]
    off = np.abs(np.array(runs[0]) - (30, 40, 60, 55)).max(axis=1)
    assert 5 <= np.sum(off > 2) <= 19  # 12 expected, sd 2.9
    np.testing.assert_allclose(off[off <= 2], 0, atol=0.2)  # rounded to thousandths


def test_what_it_cannot_look_for_is_refused_in_the_protocols_way():
    with (
        StandInServer() as server,
        pytest.raises(PerceptionFailedError, match=r"HTTP 400.*colours"),
    ):
        answers(server, "the ball", 1)
    for settings in ({"outlier_rate": 1.5}, {"family": "gpt"}):
        with pytest.raises(ConfigurationError, match="expected a share from 0 to 1"):
            StandInServer(**settings)
