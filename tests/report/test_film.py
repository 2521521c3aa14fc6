"""Films: every picture comes back, key moments follow the motion, failures leave nothing."""

import subprocess

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from prior_reinforce.errors import ConfigurationError, RenderingUnavailableError
from prior_reinforce.report import record_film
from prior_reinforce.report.film import key_moments
from tests.report.swing_world import pictures


@pytest.mark.slow
@pytest.mark.parametrize(("height", "width"), [(48, 64), (47, 63)])
def test_a_film_reads_back_whole(tmp_path, height, width):
    shown = list(pictures(17, height, width))
    path = record_film(iter(shown), tmp_path, "film", fps=25).video
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert (count, seconds) == (17, pytest.approx(17 / 25, abs=0.005))
    read = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path)]
    raw = subprocess.run(
        [*read, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], check=True, capture_output=True
    ).stdout
    even = (height + height % 2, width + width % 2)
    frames = np.frombuffer(raw, np.uint8).reshape(17, *even, 3)
    for frame, picture in zip(frames, shown, strict=True):
        difference = np.abs(frame[:height, :width].astype(float) - picture)
        assert difference.mean() < 6  # of 255, lossy; another picture of the film is 8 away


@pytest.mark.slow
def test_a_film_and_its_strip_are_recorded_in_one_pass(tmp_path):
    film = record_film(pictures(20, 240, 640), tmp_path / "new", "throw", moments=6)
    assert film.video.name == "throw.mp4"
    with Image.open(film.strip) as strip:
        width, height = strip.size
    assert width == pytest.approx(3 * 2.2 * 200, abs=1)
    assert height == pytest.approx(2 * 2.2 * 240 / 640 * 200, abs=1)
    assert sorted(p.name for p in film.video.parent.iterdir()) == ["throw-film.png", "throw.mp4"]


def test_key_moments_follow_the_motion():
    """The ball lies still for a third of the film: at most two moments are spent on that."""
    shown = list(pictures(90))
    chosen = key_moments(shown, 6)
    assert (chosen[0], chosen[-1]) == (0, 89)
    assert np.all(np.diff(chosen) > 0)
    assert sum(i < 30 for i in chosen) <= 2


@pytest.mark.parametrize("n", [1, 3, 6, 7])
def test_any_number_of_pictures_has_key_moments(n):
    still = [np.zeros((16, 16, 3), np.uint8)] * n
    assert key_moments(still, 6) == sorted(set(key_moments(still, 6)))
    assert len(key_moments(still, 6)) == min(n, 6)


def test_one_jump_is_not_chosen_twice():
    dark, bright = np.zeros((16, 16, 3), np.uint8), np.full((16, 16, 3), 255, np.uint8)
    chosen = key_moments([dark] * 10 + [bright] * 10, 6)
    assert len(set(chosen)) == 6
    assert {9, 10} <= set(chosen)


def test_a_film_that_fails_leaves_nothing(tmp_path):
    def failing(n):
        yield from pictures(n, 48, 64)
        raise RenderingUnavailableError("no OpenGL")

    for n in (0, 3):
        with pytest.raises(RenderingUnavailableError):
            record_film(failing(n), tmp_path, "throw")
    assert list(tmp_path.iterdir()) == []


def test_an_ffmpeg_that_fails_is_quoted_and_leaves_nothing(tmp_path, monkeypatch):
    """It ends at once, or after so many pictures that a pipe cannot hold."""
    folder = tmp_path / "films"
    failing = tmp_path / "ffmpeg"
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(failing))
    for script in ("exit 1", "head -c 100 >/dev/null; echo no memory >&2; exit 1"):
        failing.write_text(f"#!/bin/sh\n{script}\n")
        failing.chmod(0o755)
        said = "no memory" if "memory" in script else "status 1"
        with pytest.raises(RenderingUnavailableError, match=said):
            record_film(pictures(40, 48, 64), folder, "throw")
        assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("shown", "message"),
    [
        ([], "at least one picture"),
        ([np.zeros((4, 4, 3))], "uint8"),
        ([np.zeros((4, 4), np.uint8)], "picture 0"),
        ([np.zeros((4, 4, 3), np.uint8), np.zeros((4, 6, 3), np.uint8)], "picture 1"),
    ],
)
def test_bad_pictures_are_named(shown, message, tmp_path):
    with pytest.raises(ConfigurationError, match=message):
        record_film(shown, tmp_path, "film")
    assert list(tmp_path.iterdir()) == []
