"""From a photograph to an error on the command line: calibrate on clicked points, then look."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.cli import main
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.parsing import from_words
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.camera import Camera
from prior_reinforce.simulation.tasks import make_task
from tests.arm.workspace.planar import demonstrations, manifest
from tests.perception.vision_server import VisionServer, vlm_file

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
        "--vlm": str(vlm_file(folder, url)),
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
        (
            100,
            (),
            "100 m away looks like centimetres; write x [cm] and y [cm] in the head (inches: [in])",
        ),
        (1200, (), "1200 m away looks like millimetres; write x [mm] and y [mm]"),
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
        np.testing.assert_allclose(seen(said)[::2], truth, atol=0.006)
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
        np.testing.assert_allclose(seen(said.out)[::2], truth + np.array([0.04, 0]), atol=0.006)
        assert re.search(r"the red hoop is seen [345]\.\d cm from the goal that is set", said.err)
        assert (folder / "hoop" / "pictures" / "trial-001-seen.png").stat().st_size > 10_000

        assert look(folder, server.base_url, "--reached-size", "0.6") == 1  # what was seen is kept
        assert "photo-seen.png and tell what you see" in capsys.readouterr().err


def test_the_photograph_is_taken_first(table, tmp_path, run):
    folder = table[0]
    photo = Image.open(folder / "photo.png")
    photo.save(tmp_path / "photo.jpg")
    (tmp_path / "feed.mjpeg").write_bytes((tmp_path / "photo.jpg").read_bytes() * 3)
    of = ("--picture", folder / "photo.png", "--out", folder / "table.json")
    assert run("calibrate", folder / "points.csv", *of)[::2] == (0, "")
    taken, feed = tmp_path / "taken.png", tmp_path / "feed.mjpeg"
    objects = ["--reached", "the orange ball", "--reached-size", "0.06", "--goal", "the red hoop"]
    objects += ["--goal-size", "0.1", "--calibration", folder / "table.json"]
    nobody = "http://127.0.0.1:9/v1"  # the discard port: no model answers
    given = [*objects, "--vlm", vlm_file(tmp_path, nobody)]
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
    vlm_file(tmp_path, "http://127.0.0.1:9/v1")
    return [
        "look",
        "photo.png",
        "--reached-size",
        "0.06",
        "--goal-size",
        "0.1",
        "--vlm",
        "vlm.toml",
    ]


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
    frames = [Image.new("RGB", (120, 220), colour) for colour in ("red", "blue")]
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


POINTS = [(x, y, 960 - 750 * y, 540 - 750 * (x - 0.9)) for x in (0.6, 1.2) for y in (0.4, 0, -0.4)]


def points_file(path, points=POINTS, names=("x", "y", "u", "v"), sep=",", dec=".", end="", **how):
    rows = [names, *points]
    text = "\n".join(sep.join(str(cell).replace(".", dec) for cell in row) for row in rows)
    path.write_text(f"{text}\n{end}", **how)
    return path


@pytest.mark.parametrize(
    "written",
    [
        {},
        {"encoding": "utf-8-sig"},
        {"sep": ";", "dec": ","},
        {"sep": ";", "dec": ",", "encoding": "utf-8-sig"},
        {"encoding": "utf-16"},
        {"sep": "\t"},
        {"sep": "\t", "encoding": "utf-16"},
        {"end": ",,,\n"},
        {"sep": ";", "end": ";;;\n\n"},
        {"names": ("X", "Y", "U", "V")},
        {"names": ("x", " y", "u", "v ")},
        {"names": ("x (m)", "y (m)", "u (px)", "v (px)")},
        {"names": ("x_m", "y_m", "u_px", "v_px")},
        {"names": ("x [m]", "y [m]", "u in pixels", "v/px")},
    ],
)
def test_points_are_read_as_a_spreadsheet_writes_them(tmp_path, run, written):
    points = points_file(tmp_path / "points.csv", **written)
    status, out, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert (status, err.count("\n")) == (0, 1)
    assert "without --picture" in err
    assert "calibrated to 0.00 cm" in out


@pytest.mark.parametrize(("unit", "in_m"), [("cm", 100), ("mm", 1000)])
def test_points_may_be_measured_in_other_units(tmp_path, run, unit, in_m):
    far = [(x * in_m, y * in_m, u, v) for x, y, u, v in POINTS]
    names = (f"x [{unit}]", f"y_{unit}", "u [px]", "v")
    for name, rows, heads in (("a", POINTS, ("x", "y", "u", "v")), ("b", far, names)):
        points = points_file(tmp_path / f"{name}.csv", rows, heads)
        assert run("calibrate", points, "--out", tmp_path / f"{name}.json")[0] == 0
    one, other = (
        [
            float(n)
            for n in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", (tmp_path / f"{name}.json").read_text())
        ]
        for name in "ab"
    )
    assert len(one) > 8
    np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("names", "says", "mended"),
    [
        (("x [ft]", "y [ft]", "u", "v"), "x is in ft", "x [m]"),
        (("x", "y [Zoll]", "u", "v"), "y is in Zoll", "y [m]"),
        (("x", "y", "u [%]", "v [%]"), "u is in percent", "u [px]"),
    ],
)
def test_points_in_units_that_are_not_known_say_what_to_write(tmp_path, run, names, says, mended):
    points = points_file(tmp_path / "points.csv", names=names)
    status, _, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert status == 2
    assert says in err
    assert f"in the head: {mended}" in err
    assert "--units" not in err


def test_pixels_counted_from_the_pictures_middle_are_refused(tmp_path, run):
    centred = [(x, y, u - 960, v - 540) for x, y, u, v in POINTS]
    points = points_file(tmp_path / "points.csv", centred)
    status, _, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert status == 2
    assert "from the picture's top left corner" in err


def test_points_in_other_columns_may_stand_beside(tmp_path, run):
    named = [(f"P{i}", *row) for i, row in enumerate(POINTS)]
    points = points_file(tmp_path / "points.csv", named, ("point", "x", "y", "u", "v"))
    assert run("calibrate", points, "--out", tmp_path / "table.json")[0] == 0
    points_file(tmp_path / "points.csv", [(1, 2, 3, "?")])
    status, _, err = run("calibrate", points, "--out", tmp_path / "other.json")
    assert status == 2
    assert "'?'" in err


def test_a_coarse_calibration_names_its_worst_point(tmp_path, run):
    typed = [list(row) for row in POINTS]
    typed[1][1] = 0.1
    points = points_file(tmp_path / "points.csv", typed)
    status, _, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert status == 0
    assert "2 (0.6, 0.1)" in err
    thin = [(0.6, 0.4, 660.3, 765.2), (0.605, 0, 960.4, 760.1), (0.6, -0.4, 1259.6, 764.9)]
    thin += [(0.61, 0.2, 810.2, 757.7), (0.6, 0.1, 885, 765.4)]
    said = run("calibrate", points_file(points, thin), "--out", tmp_path / "t.json")[2]
    assert "that is coarse beside the points" in said
    assert "beside" not in err


@pytest.mark.parametrize("mistyped", [0.0, 0.1])
def test_four_corners_and_the_middle_blame_no_point(mistyped, tmp_path, run):
    """Each four of the five agree, and without a corner the others do not tell where it is."""
    clicked = [(0.6, -0.4, 1184.5, 764.5), (0.6, 0.4 + mistyped, 736.5, 763.5)]
    clicked += [(1.4, 0.4, 735.5, 316.5), (1.4, -0.4, 1184.5, 316.5), (1, 0, 960.5, 539.5)]
    points = points_file(tmp_path / "points.csv", clicked)
    _, said, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert "4 points are not tested" in said
    assert ("that is coarse; give more points" in err) == (mistyped > 0)
    assert "others agree" not in err


def test_a_point_that_was_not_tested_is_not_cleared_by_blaming_another(tmp_path, run):
    """Corners, the middle and one more: the third point, 55 px off, is told by no five others."""
    places = [(0.5, 0.4), (0.5, -0.4), (1.2, 0.4), (1.2, -0.4), (0.85, 0.0), (0.6, 0.1)]
    rng, named = np.random.default_rng(0), []
    for angle in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        noise = rng.normal(0, 0.5, size=(6, 2))
        noise[2] += 55 * np.array([np.cos(angle), np.sin(angle)])
        clicked = [
            (x, y, 960 - 750 * y + u, 540 - 750 * (x - 0.9) + v)
            for (x, y), (u, v) in zip(places, noise, strict=True)
        ]
        points = points_file(tmp_path / "points.csv", clicked)
        _, said, err = run("calibrate", points, "--out", tmp_path / "table.json")
        assert "points are not tested" in said
        named += re.findall(r"without point (\d)", err)
    assert {*named} <= {"3"}


def test_a_camera_that_was_measured_from_elsewhere_is_told(tmp_path, run):
    """`POINTS` are seen from straight above (0.9, 0), at any height."""
    points = points_file(tmp_path / "points.csv")
    Image.new("RGB", (1920, 1080)).save(tmp_path / "table.png")
    common = ("calibrate", points, "--picture", tmp_path / "table.png", "--outcome-height", "0.1")
    common = (*common, "--out", tmp_path / "table.json", "--camera")
    for camera in (("0.9", "0", "2.4"), ("0.85", "0.05", "2.3")):
        assert run(*common, *camera)[::2] == (0, "")
    for camera in (("0", "0", "1.2"), ("0.9", "0.7", "2.4")):
        status, _, err = run(*common, *camera)
        assert status == 0
        assert "measure it from the table's frame" in err
        assert "between 0.90 0.00 0.77 and 0.90 0.00 10.24" in err


def drawn(path, size=(1920, 1080), ball=(1.05, 0.12), hoop=(1.0, 0.05)):
    """The table of `POINTS`, seen from straight above, in a picture of some size."""
    image, per_metre = Image.new("RGB", size, (200, 200, 200)), 750 * size[0] / 1920
    pen = ImageDraw.Draw(image)
    for (x, y), radius, colour in ((hoop, 0.05, (220, 0, 0)), (ball, 0.03, (255, 140, 0))):
        at = size[0] / 2 - y * per_metre, size[1] / 2 - (x - 0.9) * per_metre
        pen.circle(at, radius * per_metre, fill=colour)
    image.save(path)


@pytest.fixture
def drawn_table(tmp_path, run):
    drawn(tmp_path / "photo.png")
    points = points_file(tmp_path / "points.csv")
    of = ("--picture", tmp_path / "photo.png", "--out", tmp_path / "table.json")
    assert run("calibrate", points, *of)[0] == 0
    return tmp_path


def seen(out):
    """What is printed to tell: x, its sd, y and its sd, in [m]."""
    told = re.search(r'tell .* --error "(.*)"', out)
    reading = from_words(told[1])
    x, y, x_sd, y_sd = *reading.error_seen, *reading.sd
    return [x, x_sd, y, y_sd]


def test_a_picture_of_another_size_is_scaled_or_refused(drawn_table, capsys):
    with VisionServer() as server:
        drawn(drawn_table / "photo.png", (1280, 720))
        assert look(drawn_table, server.base_url) == 0
        said = capsys.readouterr()
        assert "another size" in said.err
        np.testing.assert_allclose(seen(said.out)[::2], [0.05, 0.07], atol=0.004)
        drawn(drawn_table / "photo.png", (1080, 1920))
        assert look(drawn_table, server.base_url) == 2
        assert "1920 x 1080 px" in capsys.readouterr().err


def test_a_picture_that_is_upside_down_against_the_calibrations_is_told(drawn_table, capsys, run):
    exif = Image.Exif()
    exif[0x0112] = 3
    Image.open(drawn_table / "photo.png").rotate(180).save(drawn_table / "photo.png", exif=exif)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
    assert "EXIF orientation 3, and 1" in capsys.readouterr().err


def test_objects_far_beyond_the_calibrated_points_are_told(drawn_table, capsys, run):
    few = np.array(POINTS)[[0, 2, 3, 5]]
    few[:, :2] = 0.6 + 0.1 * (few[:, :2] - few[:, :2].mean(axis=0))
    table = TableCalibration.load(drawn_table / "table.json")
    few[:, 2:] = table.to_pixels(few[:, :2])
    points_file(drawn_table / "points.csv", few.tolist())
    of = ("--picture", drawn_table / "photo.png", "--out", drawn_table / "table.json")
    assert run("calibrate", drawn_table / "points.csv", *of)[0] == 0
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
    assert "cm beyond the calibrated points" in capsys.readouterr().err


def test_points_that_were_clicked_in_a_picture_as_it_is_stored_are_told(tmp_path, run):
    """A telephone's: 1920 x 1080 px as stored, upright 1080 x 1920 px."""
    drawn(tmp_path / "photo.png")
    exif = Image.Exif()
    common = ("calibrate", tmp_path / "points.csv", "--out", tmp_path / "table.json", "--picture")

    def photographed(name, turn):
        exif[0x0112] = turn
        Image.open(tmp_path / "photo.png").save(tmp_path / name, exif=exif)
        return tmp_path / name

    turned = photographed("turned.jpg", 6)
    points_file(tmp_path / "points.csv")
    status, _, err = run(*common, turned)
    assert status == 2
    assert "EXIF orientation 6" in err
    assert "save it upright as a PNG, click there" in err
    upright = [(x, y, 1080 - v, u) for x, y, u, v in POINTS]
    points_file(tmp_path / "points.csv", upright)
    Image.open(turned).transpose(Image.Transpose.ROTATE_270).save(tmp_path / "upright.png")
    assert run(*common, tmp_path / "upright.png")[::2] == (0, "")
    assert run(*common, turned)[::2] == (0, "")
    points_file(tmp_path / "points.csv")
    status, _, err = run(*common, photographed("down.jpg", 3))  # inside it either way
    assert status == 0
    assert "EXIF orientation 3" in err
    assert run(*common, photographed("straight.jpg", 1))[::2] == (0, "")


def test_what_is_told_is_no_surer_than_the_calibration(drawn_table, capsys, run):
    typed = [list(row) for row in POINTS]
    typed[1][1] = 0.05
    points_file(drawn_table / "points.csv", typed)
    run("calibrate", drawn_table / "points.csv", "--out", drawn_table / "table.json")
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
    assert seen(capsys.readouterr().out)[1] > 0.02


def test_four_points_tell_no_spread(drawn_table, capsys, run):
    points_file(drawn_table / "points.csv", np.array(POINTS)[[0, 2, 3, 5]].tolist())
    run("calibrate", drawn_table / "points.csv", "--out", drawn_table / "table.json")
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
    assert "4 points are not tested by the others" in capsys.readouterr().err


def trial_for(goal, folder, names=("x", "y"), units=("m", "m"), scale=1.0):
    """A workspace that waits for the outcome of its first trial for a goal."""
    form = {"outcome_names": str([*names]), "outcome_units": str([*units])}
    form |= {"tolerance": 0.015 * scale}
    made, order = demonstrations(), slice(None, None, 1 if names[0] == "x" else -1)
    made = replace(
        made,
        outcomes_seen=scale * made.outcomes_seen[:, order],
        outcome_format=OutcomeFormat((*names,), (*units,)),
    )
    with Workspace.create(folder / "hoop", manifest(**form)) as workspace:
        workspace.import_demonstrations(made, "made up")
        workspace.learn("interpolation")
        workspace.set_goal(goal)
        workspace.session().ask()
    return "--workspace", str(folder / "hoop"), "--trial", "1"


def test_a_goal_that_is_seen_far_from_the_one_that_is_set_is_no_reading(drawn_table, capsys):
    of_trial = trial_for([0.8, 0.05], drawn_table)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *of_trial) == 1
    said = capsys.readouterr()
    assert "20.0 cm from the goal that is set" in said.err
    assert "tell" not in said.out


@pytest.mark.parametrize(
    ("flip", "goal", "how"),
    [
        (Image.Transpose.ROTATE_180, [0.85, 0.05], "turned by half a turn"),
        (Image.Transpose.FLIP_LEFT_RIGHT, [0.85, 0.05], "mirrored"),
    ],
)
def test_a_picture_that_is_turned_or_mirrored_is_no_reading(drawn_table, capsys, flip, goal, how):
    drawn(drawn_table / "photo.png", hoop=goal)
    Image.open(drawn_table / "photo.png").transpose(flip).save(drawn_table / "photo.png")
    of_trial = trial_for(goal, drawn_table)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *of_trial) == 1
    said = capsys.readouterr()
    assert f"in the picture {how} it would be seen 0" in said.err
    assert "tell" not in said.out


def test_a_goal_that_is_seen_a_little_beside_makes_what_is_told_as_unsure(drawn_table, capsys):
    of_trial = trial_for([0.96, 0.05], drawn_table)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *of_trial) == 0
    said = capsys.readouterr()
    assert "4.0 cm from the goal that is set" in said.err
    # To the side it is seen where it is set.
    np.testing.assert_allclose(seen(said.out), [0.09, 0.04, 0.07, 0.003], atol=0.004)


@pytest.mark.parametrize("of_trial", [True, False])
@pytest.mark.parametrize(
    ("names", "unit", "scale"),
    [("xy", "cm", 100), ("xy", "in", 1 / 0.0254), ("yx", "m", 1), ("yx", "mm", 1000)],
)
def test_what_is_printed_is_read_in_the_units_and_order_of_the_workspace(
    names, unit, scale, of_trial, drawn_table, capsys, run
):
    """A ball 5 cm long and 7 cm left is that in a workspace in centimetres, or of y and x."""
    in_order = slice(None, None, 1 if names == "xy" else -1)
    goal = scale * np.array([1.0, 0.05])[in_order]
    where = trial_for(goal.tolist(), drawn_table, names, (unit, unit), scale)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *(where if of_trial else ())) == 0
    printed = capsys.readouterr().out.splitlines()[-1].partition("prior-reinforce ")[2]
    told = printed.replace("FOLDER TRIAL", f"{drawn_table / 'hoop'} 1")
    assert run(*shlex.split(told))[0] == 0
    with Workspace(drawn_table / "hoop") as workspace:
        error = workspace.state.trial(1).reading.error_seen
    np.testing.assert_allclose(error / scale, np.array([0.05, 0.07])[in_order], atol=0.004)


def test_a_workspace_of_other_outcomes_than_a_photograph_shows_is_named(drawn_table, capsys):
    where = trial_for([1.0, 0.05], drawn_table, ("x", "z"))
    assert look(drawn_table, "http://127.0.0.1:9/v1", *where) == 2
    err = capsys.readouterr().err
    assert "x [m], z [m]" in err
    assert 'tell --error "_cm long, _cm high"' in err


def cut_in_shape(path, times):
    """A picture's middle in the same shape, so many times as large."""
    image = Image.open(path)
    wide, tall = (round(side / times) for side in image.size)
    left, top = 600 - wide // 4, 300 - tall // 4
    image.crop((left, top, left + wide, top + tall)).save(path)


@pytest.mark.parametrize("times", [1.1, 1.15])
def test_a_picture_that_is_cut_in_the_same_shape_is_no_sure_reading(drawn_table, capsys, times):
    cut_in_shape(drawn_table / "photo.png", times)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
        said = capsys.readouterr()
        assert "if it was cut instead" in said.err
        x, sd, y, _ = seen(said.out)
        assert np.abs([x - 0.05, y - 0.07]).max() <= max(0.006, 1.5 * sd)
        assert look(drawn_table, server.base_url, *trial_for([1.0, 0.05], drawn_table)) == 1
    said = capsys.readouterr()
    assert "from the goal that is set" in said.err
    assert "tell" not in said.out


def test_an_object_that_the_border_cuts_is_told(drawn_table, capsys):
    drawn(drawn_table / "photo.png", ball=(0.9, 1.28), hoop=(1.0, 1.1))
    in_plane = replace(TableCalibration.load(drawn_table / "table.json"), height=0.03)
    in_plane.save(drawn_table / "table.json")  # the ball's middle, which is drawn in it
    with VisionServer() as server:
        assert look(drawn_table, server.base_url) == 0
    said = capsys.readouterr()
    assert "the orange ball is cut" in said.err
    assert seen(said.out)[3] == pytest.approx(0.015, abs=0.001)


@pytest.mark.parametrize(
    ("size", "flags", "says"),
    [
        ("0.08", (), None),  # drawn loosely
        ("0.06", (), "is its size right"),
        ("0.06", ("--no-goal-round",), "is its size right"),
        ("0.15", (), "--no-goal-round"),
        ("0.15", ("--no-goal-round",), None),
    ],
)
def test_a_goal_that_is_whole_is_not_said_to_be_cut(drawn_table, capsys, size, flags, says):
    """A hoop of 0.1 m, which a post of its colour makes 0.15 m long where it is that large."""
    if size == "0.15":
        photo = Image.open(drawn_table / "photo.png")
        ImageDraw.Draw(photo).rectangle((866, 450, 979, 480), fill=(220, 0, 0))
        photo.save(drawn_table / "photo.png")
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, "--goal-size", size, *flags) == 0
    said = capsys.readouterr()
    assert ("the red hoop" in said.err) == (says is not None)
    assert (says or "") in said.err
    assert ("--no-" in said.err) == (says == "--no-goal-round")
    assert "cut" not in said.err


def test_a_calibration_that_is_none_names_the_command_that_writes_one(drawn_table, run):
    for name in ("points.csv", "nothing.json"):
        objects = ("--reached", "the ball", "--reached-size", "0.06", "--goal", "the hoop")
        given = (*objects, "--goal-size", "0.1", "--calibration", drawn_table / name)
        status, _, err = run("look", drawn_table / "photo.png", *given)
        assert status == 2
        assert "`calibrate`" in err


def test_which_model_looks_may_stand_in_the_workspaces_manifest(drawn_table, capsys):
    objects = ["--reached", "the orange ball", "--reached-size", "0.06", "--goal", "the red hoop"]
    objects += ["--goal-size", "0.1", "--calibration", str(drawn_table / "table.json")]
    where = trial_for([1.0, 0.05], drawn_table)
    with VisionServer("gemini") as server:
        section = f'\n[vlm]\nbase_url = "{server.base_url}"\nfamily = "gemini"\n'
        with (drawn_table / "hoop" / "workspace.toml").open("a") as file:
            file.write(section)
        assert main(["look", str(drawn_table / "photo.png"), *objects, *where]) == 0
    np.testing.assert_allclose(seen(capsys.readouterr().out)[::2], [0.05, 0.07], atol=0.004)


def test_a_column_z_is_the_points_height(tmp_path, run):
    for name, rough in (("z", 0.0), ("height", 0.0), ("z [m]", 0.0), ("z", 0.001)):
        high = points_file(
            tmp_path / "points.csv",
            [(x, y, 0.3 + rough * (i % 2), u, v) for i, (x, y, u, v) in enumerate(POINTS)],
            ("x", "y", name, "u", "v"),
        )
        status, out, _ = run("calibrate", high, "--out", tmp_path / "table.json")
        assert status == 0
        assert "plane 30.0 cm above the table" in out
    assert run("calibrate", high, "--out", tmp_path / "t.json", "--height", "0.1")[0] == 2
    mixed = [(x, y, 0.1 * (i % 2), u, v) for i, (x, y, u, v) in enumerate(POINTS)]
    points_file(high, mixed, ("x", "y", "z", "u", "v"))
    status, _, err = run("calibrate", high, "--out", tmp_path / "t.json")
    assert status == 2
    assert "give those of one height" in err


def test_a_height_beside_a_width_is_the_pictures(tmp_path, run):
    rows = [(*row, 1280, 720) for row in POINTS]
    path = points_file(tmp_path / "points.csv", rows, (*"xyuv", "width", "height"))
    status, out, _ = run("calibrate", path, "--out", tmp_path / "table.json")
    assert (status, "plane 0.0 cm above the table" in out) == (0, True)


def test_columns_of_two_cameras_are_refused(tmp_path, run):
    both = [(*row, 1, 2) for row in POINTS]
    points = points_file(tmp_path / "points.csv", both, ("x", "y", "u", "v", "u", "v"))
    status, _, err = run("calibrate", points, "--out", tmp_path / "table.json")
    assert status == 2
    assert "several columns u" in err


@pytest.mark.parametrize(
    ("head", "says"), [("x (ft)", "x is in ft"), ("cell", "save a spreadsheet")]
)
def test_what_is_wrong_in_a_head_is_named(tmp_path, run, head, says):
    points = points_file(tmp_path / "points.csv", names=(head, "y", "u", "v"))
    assert says in run("calibrate", points, "--out", tmp_path / "table.json")[2]


def test_a_camera_in_another_unit_or_for_nothing_is_told(tmp_path, run):
    points = points_file(tmp_path / "points.csv")
    common = ("calibrate", points, "--out", tmp_path / "table.json", "--camera")
    assert "needs --camera" in run(*common, "85", "0", "255")[2]
    feet = run(*common, "2.79", "0", "8.37", "--outcome-height", "0.1")
    assert "in metres" in feet[2]
    assert "in metres" not in run(*common, "0.9", "0", "2.4", "--outcome-height", "0.1")[2]


def test_a_table_that_is_typed_twice_as_wide_is_refused(drawn_table, run):
    wide = points_file(drawn_table / "points.csv", [(x, 2 * y, u, v) for x, y, u, v in POINTS])
    of = ("--picture", drawn_table / "photo.png", "--out", drawn_table / "wide.json")
    status, _, err = run("calibrate", wide, *of)
    assert status == 2
    assert "Measure both sides" in err


def test_a_goals_offset_in_centimetres_is_refused(drawn_table, capsys):
    assert look(drawn_table, "http://127.0.0.1:9/v1", "--goal-offset", "0", "10") == 2
    assert "metres" in capsys.readouterr().err


def test_of_a_trial_that_was_told_what_is_printed_amends_it(drawn_table, capsys, run):
    of_trial = trial_for([1.0, 0.05], drawn_table)
    assert run("tell", drawn_table / "hoop", "1", "--error", "2 cm long, 0 cm left")[0] == 0
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *of_trial) == 0
    printed = capsys.readouterr().out.splitlines()[-1].partition("prior-reinforce ")[2]
    assert run(*shlex.split(printed))[0] == 0
    with Workspace(drawn_table / "hoop") as workspace:
        error = workspace.state.trial(1).reading.error_seen
    np.testing.assert_allclose(error, [0.05, 0.07], atol=0.004)


def test_a_goal_that_tells_no_mirrored_picture_says_so_once(drawn_table, capsys):
    """Straight ahead: mirrored, the ball's 7 cm left is 7 cm right, and the hoop where it was."""
    drawn(drawn_table / "photo.png", hoop=(1.0, 0.0))
    of_trial = trial_for([1.0, 0.0], drawn_table)
    with VisionServer() as server:
        assert look(drawn_table, server.base_url, *of_trial) == 0
        assert "mirrored" in capsys.readouterr().err
        (drawn_table / "hoop/pictures/trial-000-seen.json").write_text("{}")
        assert look(drawn_table, server.base_url, *of_trial) == 0
    assert "mirrored" not in capsys.readouterr().err
