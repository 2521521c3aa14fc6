"""From a photograph to an error on the command line: calibrate on clicked points, then look."""

from __future__ import annotations

import re

import imageio.v3 as imageio
import numpy as np
import pytest

from prior_reinforce.commands.photographs import Calibrate, Look
from prior_reinforce.errors import ConfigurationError, FileFormatError, PerceptionFailedError
from prior_reinforce.perception import Camera, VisionLanguageModelConfig, scene_of
from prior_reinforce.perception.stand_in_server import StandInServer
from prior_reinforce.tasks import make_task

GOAL = np.array([1.0, 0.05])
SCENE = scene_of("basketball-v1")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A photograph of a throw, points laid on the table's top, and the throw's true error."""
    folder = tmp_path_factory.mktemp("table")
    task = make_task("basketball-v1")
    (rollout,) = task.rollout(task.demonstrations("A").plans[:1], None)
    camera = Camera()
    imageio.imwrite(folder / "photo.png", camera.picture(rollout.key_frame, GOAL))
    marks = np.array(SCENE.marks)
    pixels = camera.find_marks(rollout.key_frame.model, np.hstack([marks, np.zeros((9, 1))]))
    camera.close()
    rows = "\n".join(
        f"{x}, {y}, {u:.1f}, {v:.1f}" for (x, y), (u, v) in zip(marks, pixels, strict=True)
    )
    (folder / "points.csv").write_text(f"x,y,u,v\n{rows}\n")
    model = rollout.key_frame.model
    return folder, tuple(model.cam("birdseye").pos.tolist()), rollout.outcome - GOAL


def look(folder, url: str, **settings) -> None:
    vlm = VisionLanguageModelConfig(base_url=url, max_retries=0)
    sizes = {"reached_size": 0.06, "goal_size": 0.10, **settings}
    Look(
        folder / "photo.png",
        "the orange ball",
        goal="the red hoop",
        calibration=folder / "table.json",
        vlm=vlm,
        **sizes,
    ).run()


@pytest.mark.slow
def test_a_photograph_tells_the_error(table, capsys):
    folder, camera, truth = table
    Calibrate(
        folder / "points.csv",
        outcome_height=SCENE.plane_height,
        camera=camera,
        out=folder / "table.json",
    ).run()
    assert "plane 10.0 cm above the table" in capsys.readouterr().out
    with StandInServer() as server:
        look(folder, server.base_url)
        said = capsys.readouterr().out
        told = re.search(r"--error (\S+) (\S+)", said)
        assert told is not None
        seen = np.array([float(told[1]), float(told[2])])
        np.testing.assert_allclose(seen, truth, atol=0.006)
        assert (folder / "photo-seen.png").stat().st_size > 10_000

        with pytest.raises(PerceptionFailedError, match=r"photo-seen\.png and tell what you see"):
            look(folder, server.base_url, reached_size=0.6)


def test_wrong_files_are_named(tmp_path):
    points = tmp_path / "points.csv"
    with pytest.raises(FileFormatError, match=r"points\.csv"):
        Calibrate(points).run()
    points.write_text("x,y,u\n0,0,1\n")
    with pytest.raises(FileFormatError, match="columns x, y, u, v"):
        Calibrate(points).run()
    points.write_text("x,y,u,v\n" + "0.5,0,10,10\n" * 5)
    with pytest.raises(ConfigurationError, match="are the same"):
        Calibrate(points, out=tmp_path / "t.json").run()
    assert not (tmp_path / "t.json").exists()
    square = "x,y,u,v\n0,0,100,200\n1,0,100,100\n1,1,0,100\n0,1,0,200\n"
    points.write_text(square)
    with pytest.raises(ConfigurationError, match="needs --camera"):
        Calibrate(points, outcome_height=0.1, out=tmp_path / "t.json").run()
    Calibrate(points, out=tmp_path / "t.json").run()
    (tmp_path / "photo.png").write_text("no picture")
    with pytest.raises(FileFormatError, match="PNG or JPEG"):
        Look(
            tmp_path / "photo.png",
            "a ball",
            0.1,
            "a hoop",
            0.1,
            calibration=tmp_path / "t.json",
        ).run()
