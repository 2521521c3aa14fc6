"""`rollout`: one plan executed, and filmed."""

from __future__ import annotations

import imageio_ffmpeg
import pytest

from prior_reinforce.cli import main


@pytest.mark.slow
def test_one_command_makes_a_tasks_film(tmp_path, capsys):
    film = tmp_path / "slide.mp4"
    # Seed 2 disturbs this one by 2 mm, within curling's tolerance of 1 cm.
    throw = ["--task", "curling", "--demonstration", "5", "--seed", "2"]
    assert main(["rollout", *throw, "--film", str(film)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "within the tolerance" in said
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    lasts = 0.1 + 139 * 0.0125 + 1.5  # before, during and after the plan
    assert seconds == pytest.approx(lasts, abs=0.1)
    assert count == pytest.approx(30 * lasts, abs=2)
    assert (tmp_path / "slide-film.png").is_file()


def test_a_film_that_is_no_mp4_is_refused_before_anything_is_written(tmp_path, capsys):
    film = tmp_path / "throw.avi"
    assert main(["rollout", "--demonstration", "0", "--film", str(film)]) == 2
    assert "--film must name an .mp4 file" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_demonstration_that_is_not_there_is_named(capsys):
    assert main(["rollout", "--demonstration", "6"]) == 2
    assert "--demonstration must be 0 to 5, got 6" in capsys.readouterr().err
