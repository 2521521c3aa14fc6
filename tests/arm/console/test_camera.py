import io
import re
from importlib import resources
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw

from prior_reinforce.arm.console.camera import Calibrate, Look, Pictures, _known_points
from prior_reinforce.arm.console.verbs import Ask, SetGoal, Tell
from prior_reinforce.errors import ConfigurationError, FileFormatError, PerceptionFailedError
from prior_reinforce.perception.calibration import CAMERA_SD, TableCalibration
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from tests.arm.console.pictures import jpeg, pixel
from tests.perception.vision_server import VisionServer

KNOWN = [[0.6, 0.4], [0.6, 0.0], [0.6, -0.4], [1.2, -0.4], [1.2, 0.0], [1.2, 0.4]]


@pytest.fixture
def pictures(verbs):
    endpoint = "http://127.0.0.1:9/v1"  # the discard port: nothing answers
    return Pictures(verbs, VisionLanguageModelConfig(base_url=endpoint, max_retries=0))


def calibrated(pictures, points=KNOWN):
    pictures.keep(jpeg(ball=(0.93, 0.07)))
    return pictures.calibrate(Calibrate([*points], [pixel(p) for p in points]))


def to_table(camera, pixel):
    u, v, w = np.array(camera.to_table) @ [*pixel, 1.0]
    return u / w, v / w


def test_before_anything_there_are_places_to_begin_with(pictures):
    camera = pictures.look_up()
    assert (camera.picture, camera.to_table) == ("", None)
    assert camera.points == [
        [0.8, 0.2],
        [0.8, 0.0],
        [0.8, -0.2],
        [1.0, -0.2],
        [1.0, 0.0],
        [1.0, 0.2],
    ]
    with pytest.raises(PerceptionFailedError, match="no picture"):
        pictures.file()


def test_places_to_begin_with_are_apart_around_a_single_demonstration():
    axes = [SimpleNamespace(axis=0), SimpleNamespace(axis=1)]
    points = _known_points(SimpleNamespace(components=axes, shown=[[0.9, 0.1]]))
    x, y = np.transpose(points)
    assert (np.ptp(x), np.ptp(y)) == pytest.approx((0.1, 0.1))
    TableCalibration.fit(points, [pixel(p) for p in points])  # which no points on a line do


def test_a_calibration_maps_pixels_to_the_table_and_is_kept(pictures, verbs):
    camera = calibrated(pictures)
    for place in ([0.7, 0.3], [1.1, -0.35]):
        np.testing.assert_allclose(to_table(camera, pixel(place)), place, atol=1e-6)
    assert Pictures(verbs, VisionLanguageModelConfig()).look_up().to_table == camera.to_table
    assert camera.sd == CAMERA_SD
    assert "calibrated to 0.00 cm" in camera.summary


def test_a_point_that_was_touched_wrongly_shows_in_the_residual_and_in_what_is_told(pictures):
    pictures.keep(jpeg())
    touched = [pixel(point) for point in KNOWN]
    touched[2][0] += 25
    camera = pictures.calibrate(Calibrate(KNOWN, touched))
    assert camera.sd > 0.01
    assert f"{100 * camera.sd:.2f} cm" in camera.summary


@pytest.mark.parametrize("points", [KNOWN[:3], [[0.6, 0.0]] * 4, KNOWN[::-1]])
def test_points_that_fix_no_plane_are_refused(pictures, points):
    pictures.keep(jpeg())
    with pytest.raises(ConfigurationError):
        pictures.calibrate(Calibrate(points, [pixel(p) for p in KNOWN[: len(points)]]))
    assert pictures.look_up().to_table is None


def test_printed_tags_on_the_known_points_are_found_at_their_centres(pictures):
    pictures.keep(jpeg(tags=KNOWN))
    tags = pictures.tags()
    assert [*sorted(tags)] == [1, 2, 3, 4, 5, 6]
    touched = [tags[number] for number in sorted(tags)]
    np.testing.assert_allclose(touched, [pixel(point) for point in KNOWN], atol=1.0)
    camera = pictures.calibrate(Calibrate(KNOWN, touched))
    assert camera.sd < 0.004
    np.testing.assert_allclose(to_table(camera, pixel([0.8, 0.2])), [0.8, 0.2], atol=0.002)


def test_the_sheet_that_is_printed_has_these_tags_with_their_centres_where_they_are(pictures):
    """At 10 px a millimetre; each tag is a path of rectangles of so many modules."""
    drawn = resources.files("prior_reinforce.arm.console").joinpath("tags.svg").read_text()
    sheet = np.full((2100, 1900), 255, np.uint8)
    centres = []
    for left, top, path in re.findall(r'translate\((\d+) (\d+)\)"><path.* d="(.*?)"', drawn):
        for column, row, wide in re.findall(r"M(\d) (\d)h(\d)v1", path):
            u, v = (10 * (int(at) + 5 * int(k)) for at, k in ((left, column), (top, row)))
            sheet[v : v + 50, u : u + 50 * int(wide)] = 0
        centres.append([10 * int(left) + 200, 10 * int(top) + 200])
    encoded = io.BytesIO()
    Image.fromarray(sheet).save(encoded, "PNG")
    pictures.keep(encoded.getvalue())
    tags = pictures.tags()
    assert [*sorted(tags)] == [1, 2, 3, 4, 5, 6]
    np.testing.assert_allclose([tags[number] for number in sorted(tags)], centres, atol=2)


@pytest.mark.parametrize("family", ["5X5", "4X4", "APRILTAG_25h9"])
def test_tags_of_another_family_are_named(pictures, family):
    name = next(name for name in dir(cv2.aruco) if name.startswith(f"DICT_{family}"))
    pictures.keep(jpeg(tags=KNOWN, family=getattr(cv2.aruco, name)))
    with pytest.raises(PerceptionFailedError, match=f"(?i)6 of DICT_{family}.*'Tags to print'"):
        pictures.tags()


def test_no_tag_is_no_error(pictures):
    pictures.keep(jpeg())
    assert pictures.tags() == {}


def test_the_ball_is_found_by_its_colour(pictures):
    with pytest.raises(ConfigurationError, match="not calibrated"):
        pictures.find(Look("the orange ball", 0.04))
    calibrated(pictures)
    found = pictures.find(Look("the orange ball", 0.04))
    np.testing.assert_allclose(found.place, [0.93, 0.07], atol=0.003)
    assert found.sd == pictures.look_up().sd
    # What is 2.4 cm wide is somewhere in a box of 3.8 cm.
    assert pictures.find(Look("the orange ball", 0.024)).sd == pytest.approx(0.007, abs=0.001)
    left, top, right, bottom = found.box
    u, v = pixel([0.93, 0.07])
    assert left < u < right
    assert top < v < bottom
    with pytest.raises(PerceptionFailedError, match="touch it"):
        pictures.find(Look("the blue ball", 0.04))
    with pytest.raises(PerceptionFailedError, match="is the server running"):
        pictures.find(Look("the orange ball", 0.04, "model"))


def test_what_is_not_round_may_look_flat(pictures):
    image = Image.open(io.BytesIO(jpeg()))
    (left, bottom), (right, top) = pixel([0.9, 0.1]), pixel([1.0, -0.1])
    ImageDraw.Draw(image).rectangle((left, top, right, bottom), fill=(255, 140, 0))
    encoded = io.BytesIO()
    image.save(encoded, "JPEG", quality=95)
    calibrated(pictures)
    pictures.keep(encoded.getvalue())
    found = pictures.find(Look("the orange book", 0.2, round=False))
    np.testing.assert_allclose(found.place, [0.95, 0.0], atol=0.005)
    assert found.sd == pictures.look_up().sd
    # Of a ball of that size, half would be hidden.
    assert pictures.find(Look("the orange ball", 0.2)).sd == pytest.approx(0.05, abs=0.005)


def test_a_picture_is_of_the_trial_that_waits(pictures, verbs):
    pictures.keep(jpeg())
    assert pictures.file().name == "table.jpg"
    state = verbs.goal(SetGoal(seen=verbs.state().id, goal=[0.9, 0.0]))
    verbs.ask(Ask(seen=state.id))
    pictures.keep(jpeg())
    assert pictures.file().name == "trial-001.jpg"


@pytest.mark.parametrize("content", [b"", b"<svg onload=alert(1)>", b"GIF89a" + b"0" * 99])
def test_what_is_no_picture_is_refused(pictures, content):
    with pytest.raises(FileFormatError, match="cannot read that as a picture"):
        pictures.keep(content)
    assert pictures.look_up().picture == ""


def test_a_flood_of_pixels_is_refused_before_it_is_unpacked(pictures):
    encoded = io.BytesIO()
    Image.new("1", (20_000, 20_000)).save(encoded, "PNG")
    assert len(encoded.getvalue()) < 100_000
    with pytest.raises(FileFormatError, match="cannot read that as a picture"):
        pictures.keep(encoded.getvalue())


def test_what_a_picture_hides_does_not_come_in(pictures):
    pictures.keep(jpeg() + b"<script>alert(1)</script>")
    assert b"script" not in pictures.file().read_bytes()


def test_the_calibration_is_scaled_to_a_picture_of_its_shape_and_kept_from_others(pictures):
    camera = calibrated(pictures)
    picture = Image.open(io.BytesIO(jpeg(ball=(0.93, 0.07))))

    def shown(size, **how):
        encoded = io.BytesIO()
        picture.resize(size).save(encoded, "JPEG", **how)
        return pictures.keep(encoded.getvalue())

    smaller = shown((640, 360))
    assert "another size" in " ".join(smaller.doubts)
    at = np.array(pixel([0.8, 0.2])) / 2
    np.testing.assert_allclose(to_table(smaller, at), [0.8, 0.2], atol=1e-6)
    found = pictures.find(Look("the orange ball", 0.04))
    np.testing.assert_allclose(found.place, [0.93, 0.07], atol=0.005)
    for size in ((720, 1280), (960, 720)):
        other = shown(size)
        assert other.to_table is None
        assert "calibrate again" in other.summary
        with pytest.raises(ConfigurationError, match="calibrate again"):
            pictures.find(Look("the orange ball", 0.04))
    assert shown((1280, 720)).to_table == camera.to_table


def test_a_tag_that_is_seen_twice_is_named(pictures):
    other = jpeg(tags=[*KNOWN[:2]])
    left, right = (Image.open(io.BytesIO(content)) for content in (other, jpeg(tags=[KNOWN[4]])))
    both = Image.new("RGB", (2560, 720))
    both.paste(left, (0, 0))
    both.paste(right, (1280, 0))
    encoded = io.BytesIO()
    both.save(encoded, "PNG")
    pictures.keep(encoded.getvalue())
    with pytest.raises(PerceptionFailedError, match="tag 1 is seen 2 times"):
        pictures.tags()


def test_the_picture_of_a_trial_is_not_read_for_the_next(pictures, verbs):
    calibrated(pictures)
    state = verbs.goal(SetGoal(seen=verbs.state().id, goal=[0.9, 0.0]))
    state = verbs.ask(Ask(seen=state.id))
    with pytest.raises(PerceptionFailedError, match="take one"):
        pictures.find(Look("the orange ball", 0.04))
    pictures.keep(jpeg(ball=(0.93, 0.07)))
    pictures.find(Look("the orange ball", 0.04))
    state = verbs.tell(Tell(seen=state.id, trial=1, error=[0.03, 0.07]))
    assert pictures.look_up().of == "trial 1"  # and says so
    verbs.ask(Ask(seen=state.id))
    assert pictures.look_up().picture == ""
    with pytest.raises(PerceptionFailedError, match="take one"):
        pictures.find(Look("the orange ball", 0.04))
    # The first trial is corrected: its picture counts, and another one is kept as its own.
    assert pictures.look_up(1).of == "trial 1"
    pictures.keep(jpeg(ball=(0.8, 0.1)), 1)
    found = pictures.find(Look("the orange ball", 0.04, trial=1))
    np.testing.assert_allclose(found.place, [0.8, 0.1], atol=0.003)
    assert pictures.look_up().picture == ""


@pytest.mark.parametrize("turn", [2, 3, 4])
def test_a_telephones_picture_that_is_turned_or_mirrored_is_told(pictures, turn):
    calibrated(pictures)
    assert pictures.look_up().doubts == []
    encoded, exif = io.BytesIO(), Image.Exif()
    exif[0x0112] = turn
    Image.open(io.BytesIO(jpeg(ball=(0.93, 0.07)))).save(encoded, "JPEG", exif=exif)
    camera = pictures.keep(encoded.getvalue())
    assert f"EXIF orientation {turn}, and 1" in camera.doubts[0]
    assert camera.doubts == pictures.look_up().doubts
    pictures.calibrate(Calibrate(KNOWN, [pixel(p) for p in KNOWN]))  # as its viewer shows it
    assert pictures.look_up().doubts == []


@pytest.mark.parametrize("per", [100.0, 0.01])
def test_points_in_metres_for_centimetres_or_the_other_way_round_are_refused(pictures, per):
    pictures.keep(jpeg())
    points = [[per * x, per * y] for x, y in KNOWN]
    with pytest.raises(ConfigurationError, match="centimetres"):
        pictures.calibrate(Calibrate(points, [pixel(p) for p in KNOWN]))


def test_a_table_that_is_typed_twice_as_wide_is_refused(pictures):
    pictures.keep(jpeg())
    with pytest.raises(ConfigurationError, match="Measure both sides"):
        pictures.calibrate(Calibrate([[x, 2 * y] for x, y in KNOWN], [pixel(p) for p in KNOWN]))
    assert pictures.look_up().to_table is None


def test_a_ball_that_is_seen_from_the_side_is_as_unsure_as_that_makes_it(pictures):
    """On its table it stands where its ring lies; its middle, 2 cm up, is seen 1.1 cm behind."""
    calibrated(pictures)
    image = Image.open(io.BytesIO(jpeg()))
    u, v = pixel([0.95, 0.0])
    r = np.linalg.norm(np.subtract(pixel([0.95, 0.02]), [u, v]))
    ImageDraw.Draw(image).circle((u, v), r, fill=(255, 140, 0))
    encoded = io.BytesIO()
    image.save(encoded, "JPEG", quality=95)
    pictures.keep(encoded.getvalue())
    found = pictures.find(Look("the orange ball", 0.04))
    assert found.sd == pytest.approx(0.02 * (0.95 - 0.34) / 1.0, rel=0.15)
    assert "--outcome-height 0.02" in found.doubts[0]


def test_a_model_that_answers_in_another_scale_is_not_believed(verbs):
    with VisionServer("qwen2.5-vl") as server:  # in pixels, read as thousandths
        config = VisionLanguageModelConfig(base_url=server.base_url, family="qwen3-vl", votes=1)
        pictures = Pictures(verbs, config)
        pictures.keep(jpeg(ball=(0.7, 0.2)))
        pictures.calibrate(Calibrate(KNOWN, [pixel(p) for p in KNOWN]))
        with pytest.raises(PerceptionFailedError, match="Touch it"):
            pictures.find(Look("the orange ball", 0.04, "model"))


def test_an_object_beyond_the_known_points_is_told(pictures):
    near = [[0.6 + 0.2 * (x - 0.6), 0.3 * y] for x, y in KNOWN]
    calibrated(pictures, near)
    assert "beyond" in " ".join(pictures.find(Look("the orange ball", 0.04)).doubts)
