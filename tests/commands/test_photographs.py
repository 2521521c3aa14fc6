"""From a photograph to an error on the command line: calibrate on clicked points, then look."""

from __future__ import annotations

import re

import numpy as np
import pytest
from PIL import Image

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.cli import main
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.perception.camera import Camera
from tests.bench.workspace.planar import demonstrations, manifest
from tests.perception.vision_server import VisionServer

GOAL = np.array([1.0, 0.05])
SCENE = make_task("basketball-v1").scene


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A photograph of a throw, points laid on the table's top, and the throw's true error."""
    folder = tmp_path_factory.mktemp("table")
    task = make_task("basketball-v1")
    (rollout,) = task.rollout(task.demonstrations("A").plans[:1], None)
    camera = Camera()
    Image.fromarray(camera.picture(rollout.key_frame, GOAL)).save(folder / "photo.png")
    marks = np.array(SCENE.marks)
    pixels = camera.find_marks(rollout.key_frame.model, np.hstack([marks, np.zeros((9, 1))]))
    camera.close()
    rows = "\n".join(
        f"{x}, {y}, {u:.1f}, {v:.1f}" for (x, y), (u, v) in zip(marks, pixels, strict=True)
    )
    (folder / "points.csv").write_text(f"x,y,u,v\n{rows}\n")
    model = rollout.key_frame.model
    return folder, tuple(model.cam("birdseye").pos.tolist()), rollout.outcome - GOAL


def look(folder, url: str, *more: str) -> int:
    given = {
        "--reached": "the orange ball",
        "--goal": "the red hoop",
        "--reached-size": "0.06",
        "--goal-size": "0.10",
        "--calibration": str(folder / "table.json"),
        "--vlm.base-url": url,
        "--vlm.max-retries": "0",
    }
    flags = [word for flag in given.items() for word in flag]
    return main(["look", str(folder / "photo.png"), *flags, *more])


def test_calibrate_replaces_only_what_it_wrote(tmp_path, run):
    points = tmp_path / "points.csv"
    points.write_text("x,y,u,v\n0,0,0,0\n1,0,0,9\n0,1,9,0\n1,1,9,9\n")
    before = points.read_text()
    status, _, err = run("calibrate", points, "--out", points)
    assert status == 2
    assert "choose another name" in err
    assert points.read_text() == before
    for _ in range(2):
        assert run("calibrate", points, "--out", tmp_path / "table.json")[0] == 0


@pytest.mark.parametrize(
    ("scale", "flags", "says"),
    [
        (100, (), "looks like centimetres"),
        (1, ("--height", "nan"), "--height must be metres"),
        (1, ("--height", "10"), "--height must be metres"),
        (1, ("--outcome-height", "inf", "--camera", "0", "0", "2"), "--outcome-height must be"),
        (1, ("--outcome-height", "0.1", "--camera", "nan", "0", "2.5"), "must be three numbers in"),
        (1, ("--outcome-height", "0.1", "--camera", "0", "0", "inf"), "must be three numbers in"),
        (1, ("--outcome-height", "0.1", "--camera", "85", "0", "255"), "must be three numbers in"),
    ],
)
def test_calibrate_takes_no_nonsense(tmp_path, run, scale, flags, says):
    points = tmp_path / "points.csv"
    corners = [(0, 0, 0, 0), (1, 0, 0, 9), (0, 1, 9, 0), (1, 1, 9, 9)]
    rows = "\n".join(f"{x * scale},{y * scale},{u},{v}" for x, y, u, v in corners)
    points.write_text(f"x,y,u,v\n{rows}\n")
    status, _, err = run("calibrate", points, "--out", tmp_path / "table.json", *flags)
    assert status == 2
    assert says in err
    assert not (tmp_path / "table.json").exists()


@pytest.mark.slow
def test_a_photograph_tells_the_error(table, capsys):
    folder, camera, truth = table
    files = (str(folder / "points.csv"), "--out", str(folder / "table.json"))
    lens = ("--outcome-height", str(SCENE.plane_height), "--camera", *map(str, camera))
    status = main(["calibrate", *files, *lens])
    assert status == 0
    assert "plane 10.0 cm above the table" in capsys.readouterr().out
    with VisionServer() as server:
        assert look(folder, server.base_url) == 0
        said = capsys.readouterr().out
        told = re.search(r"TRIAL ([-.\d]+)\+-\S+ ([-.\d]+)\+-", said)
        assert told is not None
        seen = np.array([float(told[1]), float(told[2])])
        np.testing.assert_allclose(seen, truth, atol=0.006)
        assert (folder / "photo-seen.png").stat().st_size > 10_000

        # The goal that is set counts, 4 cm nearer than the hoop that is seen.
        with Workspace.create(folder / "hoop", manifest()) as workspace:
            workspace.import_demonstrations(demonstrations(), "made up")
            workspace.learn("interpolation")
            workspace.set_goal([0.96, 0.05])
            workspace.session().ask()
        of_trial = ("--workspace", str(folder / "hoop"), "--trial", "1")
        assert look(folder, server.base_url, *of_trial) == 0
        said = capsys.readouterr()
        told = re.search(r"hoop 1 ([-.\d]+)\+-\S+ ([-.\d]+)\+-", said.out)
        assert told is not None
        seen = np.array([float(told[1]), float(told[2])])
        np.testing.assert_allclose(seen, truth + np.array([0.04, 0]), atol=0.006)
        assert re.search(r"the red hoop is seen [345]\.\d cm from the goal that is set", said.err)
        assert (folder / "hoop" / "pictures" / "trial-001-seen.png").stat().st_size > 10_000

        assert look(folder, server.base_url, "--reached-size", "0.6") == 1  # what was seen is kept
        assert "photo-seen.png and tell what you see" in capsys.readouterr().err


def test_the_photograph_is_taken_first(table, tmp_path, run):
    folder = table[0]
    photo = Image.open(folder / "photo.png")
    photo.save(tmp_path / "photo.jpg")
    (tmp_path / "feed.mjpeg").write_bytes((tmp_path / "photo.jpg").read_bytes() * 3)
    status, _, err = run("calibrate", folder / "points.csv", "--out", folder / "table.json")
    assert (status, err) == (0, "")
    taken, feed = tmp_path / "taken.png", tmp_path / "feed.mjpeg"
    objects = ["--reached", "the orange ball", "--reached-size", "0.06", "--goal", "the red hoop"]
    objects += ["--goal-size", "0.1", "--calibration", folder / "table.json"]
    nobody = "http://127.0.0.1:9/v1"  # the discard port: no model answers
    given = [*objects, "--vlm.base-url", nobody, "--vlm.max-retries", "0"]
    assert "cannot reach" in run("look", taken, "--camera", feed, *given)[2]
    assert np.abs(np.asarray(Image.open(taken), float) - photo).mean() < 3
    status, _, err = run("look", taken, "--camera", feed, *given)
    assert status == 2
    assert "is there already" in err
    status, _, err = run("look", tmp_path / "x.jpg", "--camera", tmp_path / "no", *given)
    assert status == 2
    assert "gives no picture" in err
    assert not (tmp_path / "x.jpg").exists()


def test_wrong_files_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points = tmp_path / "points.csv"

    def refused(*args: str) -> str:
        assert main(args) == 2
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1
        return said

    assert "points.csv" in refused("calibrate", "points.csv")
    points.write_text("x,y,u\n0,0,1\n")
    assert "columns x, y, u, v" in refused("calibrate", "points.csv")
    points.write_text("x,y,u,v\n" + "0.5,0,10,10\n" * 5)
    assert "are the same" in refused("calibrate", "points.csv", "--out", "t.json")
    square = "x,y,u,v\n0,0,100,200\n1,0,100,100\n1,1,0,100\n0,1,0,200\n"
    points.write_text(square)
    assert "needs --camera" in refused("calibrate", "points.csv", "--outcome-height", "0.1")
    assert [path.name for path in tmp_path.iterdir()] == ["points.csv"]
    assert main(["calibrate", "points.csv"]) == 0
    capsys.readouterr()
    (tmp_path / "photo.png").write_text("no picture")
    assert "PNG or JPEG" in refused(
        *("look", "photo.png", "--reached", "a ball", "--reached-size", "0.1"),
        *("--goal", "a hoop", "--goal-size", "0.1", "--calibration", "table.json"),
    )


def test_a_trial_is_named_with_its_workspace(folder, tmp_path, run):
    (tmp_path / "photo.png").write_text("not looked at yet")
    common = (
        "look",
        "photo.png",
        "--reached",
        "a ball",
        "--reached-size",
        "0.1",
        "--goal",
        "a hoop",
    )
    common = (*common, "--goal-size", "0.1")
    assert "say together which trial" in run(*common, "--trial", "1")[2]
    status, _, err = run(*common, "--workspace", folder, "--trial", "4")
    assert status == 2
    assert "4" in err
    assert not (tmp_path / "planar" / "pictures").exists()


@pytest.fixture
def photographed(folder, tmp_path, run):
    """A workspace with an open trial, its photograph, and a camera: all but the endpoint."""
    with Workspace(folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
    points = "x,y,u,v\n0,0,100,200\n1,0,100,100\n1,1,0,100\n0,1,0,200\n"
    (tmp_path / "points.csv").write_text(points)
    assert run("calibrate", "points.csv")[0] == 0
    Image.new("RGB", (200, 200)).save("photo.png")
    what = "--reached-size 0.06 --goal-size 0.1 --vlm.max-retries 0 --vlm.base-url"
    return ["look", "photo.png", *what.split(), "http://127.0.0.1:9/v1"]


OBJECTS = ("--reached", "the orange ball", "--goal", "the red hoop")


@pytest.mark.parametrize("linked", ["pictures", "trial-001-seen.png", "trial-001-seen.json"])
def test_what_was_seen_is_not_written_through_a_link(photographed, folder, tmp_path, run, linked):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    pictures = tmp_path / folder / "pictures"
    if linked == "pictures":
        pictures.symlink_to(elsewhere)
    else:
        pictures.mkdir()
        (pictures / "trial-001-seen.json").write_text('{"picture_size_px": 1}')
        (elsewhere / "mine").write_text('{"picture_size_px": 1}')
        (pictures / linked).unlink(missing_ok=True)
        (pictures / linked).symlink_to(elsewhere / "mine")
    before = {path: path.read_bytes() for path in elsewhere.iterdir()}
    status, _, err = run(*photographed, *OBJECTS, "--workspace", folder, "--trial", "1")
    assert status == 2
    assert "link" in err
    assert {path: path.read_bytes() for path in elsewhere.iterdir()} == before


@pytest.mark.parametrize("kind", ["GIF", "EPS", "TIFF"])
def test_only_a_png_or_a_jpeg_is_opened(photographed, run, kind):
    """Whatever its name: Pillow starts Ghostscript for PostScript."""
    Image.new("RGB", (20, 20)).save("photo.png", format=kind)
    status, _, err = run(*photographed, *OBJECTS)
    assert status == 2
    assert "expected a PNG or JPEG" in err


def test_a_picture_of_several_frames_is_read_as_its_first(photographed, run):
    frames = [Image.new("RGB", (20, 20), colour) for colour in ("red", "blue")]
    frames[0].save("photo.png", save_all=True, append_images=frames[1:])
    assert "is the server running?" in run(*photographed, *OBJECTS)[2]


def test_a_picture_of_too_many_pixels_is_refused(photographed, run, monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    assert "expected a PNG or JPEG" in run(*photographed, *OBJECTS)[2]


def test_a_calibration_that_maps_nothing_is_refused(photographed, run, tmp_path):
    path = tmp_path / "table.json"
    flat = re.sub(r'"homography": \[.*?\]\s*\]', '"homography": [[0,0,0],[0,0,0],[0,0,0]]',
                  path.read_text(), flags=re.DOTALL)  # fmt: skip
    path.write_text(flat)
    status, _, err = run(*photographed, *OBJECTS)
    assert status == 2
    assert "is not a table calibration" in err


def test_words_of_two_lines_are_refused(photographed, run):
    status, _, err = run(*photographed, "--reached", "the ball", "--goal", "a hoop\nand more")
    assert status == 2
    assert "one line" in err
