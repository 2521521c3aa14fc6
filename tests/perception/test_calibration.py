"""Calibration: against the pinhole's own formulas, and against what a lab does wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.perception.calibration import (
    CAMERA_SD,
    TableCalibration,
    _direct_linear_transform,
    left_out_errors,
)

CORNERS = np.array([[0.4, -0.4], [1.2, -0.4], [1.2, 0.4], [0.4, 0.4]])
GRID = np.array([(x, y) for x in (0.4, 0.8, 1.2) for y in (-0.4, 0.0, 0.4)])
CAMERA = np.array([0.3, 0.1, 2.2])


def through_pinhole(points: np.ndarray) -> np.ndarray:
    """Pixels of points (n, 3) in a slanted camera at CAMERA with a focal length of 1500 px."""
    forward = np.array([0.22, -0.05, -0.97]) / np.linalg.norm([0.22, -0.05, -0.97])
    right = np.cross(forward, [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    seen = (points - CAMERA) @ np.stack([right, down, forward], axis=1)
    return 448 + 1500 * seen[:, :2] / seen[:, 2:]


def at(points: np.ndarray, height: float) -> np.ndarray:
    return np.hstack([points, np.full((len(points), 1), height)])


@pytest.mark.parametrize("height", [0.0, 0.1])
def test_four_points_fix_every_other_point_of_their_plane(height):
    calibration = TableCalibration.fit(CORNERS, through_pinhole(at(CORNERS, height)))
    others = np.random.default_rng(0).uniform([0.2, -0.6], [1.4, 0.6], size=(50, 2))
    pixels = through_pinhole(at(others, height))
    np.testing.assert_allclose(calibration.to_table(pixels), others, atol=1e-9)
    np.testing.assert_allclose(calibration.to_pixels(others), pixels, atol=1e-6)


def test_camera_straight_above_is_similar_triangles():
    # 2 m up with f = 1000 px: half a metre is 250 px; x forward is up, y left is left.
    pixels = 400 - 1000 * CORNERS[:, ::-1] / 2.0
    calibration = TableCalibration.fit(CORNERS, pixels)
    np.testing.assert_allclose(calibration.to_table([400.0, 400.0]), [0, 0], atol=1e-9)
    np.testing.assert_allclose(calibration.to_table([150.0, -100.0]), [1.0, 0.5], atol=1e-9)


@pytest.mark.slow
def test_errors_are_in_metres_and_left_out_points_are_judged_harder():
    pixels = through_pinhole(at(GRID, 0.0))
    metre_per_pixel = 2.2 / 1500
    noise = np.random.default_rng(1).normal(size=(200, *pixels.shape))
    fits = [TableCalibration.fit(GRID, pixels + n) for n in noise]
    fitted = np.sqrt(np.mean([fit.fit_error**2 for fit in fits]))
    left_out = np.sqrt(np.mean([fit.left_out_error**2 for fit in fits]))
    # 18 numbers, 8 parameters: the residuals keep 10/18 of the noise's variance.
    assert fitted == pytest.approx(np.sqrt(2) * np.sqrt(10 / 18) * metre_per_pixel, rel=0.15)
    assert left_out > np.sqrt(2) * metre_per_pixel


def test_four_points_say_nothing_of_the_error():
    pixels = through_pinhole(at(CORNERS, 0.0)) + np.random.default_rng(2).normal(size=(4, 2))
    calibration = TableCalibration.fit(CORNERS, pixels)
    assert calibration.fit_error < 1e-9
    assert calibration.left_out_error is None
    assert calibration.untested == 4
    assert "4 points are not tested" in calibration.summary()


@pytest.mark.parametrize(("made_at", "wanted_at"), [(0.0, 0.1), (0.1, 0.0), (0.03, 0.2)])
def test_a_calibration_moves_to_a_parallel_plane(made_at, wanted_at):
    made = TableCalibration.fit(GRID, through_pinhole(at(GRID, made_at)), height=made_at)
    moved = made.at_height(wanted_at, CAMERA)
    pixels = through_pinhole(at(GRID, wanted_at))
    np.testing.assert_allclose(moved.to_table(pixels), GRID, atol=1e-9)
    assert moved.height == wanted_at
    assert np.abs(made.to_table(pixels) - GRID).max() > 0.01  # it had to be moved


def test_a_tape_measured_camera_costs_almost_nothing_in_a_difference():
    made = TableCalibration.fit(GRID, through_pinhole(at(GRID, 0.0)))
    moved = made.at_height(0.1, CAMERA + np.array([0.02, -0.02, 0.02]))
    seen = moved.to_table(through_pinhole(at(GRID, 0.1)))
    differences = (seen[1:] - seen[:1]) - (GRID[1:] - GRID[:1])
    assert np.abs(differences).max() < 0.001


@pytest.mark.parametrize(
    ("points", "pixels", "message"),
    [
        (CORNERS[:3], CORNERS[:3], "at least four"),
        (CORNERS, CORNERS[:3], "expected"),
        (CORNERS[:, :1], CORNERS[:, :1], "expected"),
        (np.outer(np.arange(5.0), [1, 1]), np.outer(np.arange(5.0), [1, 2]), "on one line"),
        (np.ones((4, 2)), through_pinhole(at(CORNERS, 0.0)), "the same"),
        (CORNERS * [np.nan, 1], through_pinhole(at(CORNERS, 0.0)), "finite"),
        (CORNERS * 1e200, through_pinhole(at(CORNERS, 0.0)), r"at most 1e\+06"),
        (CORNERS, through_pinhole(at(CORNERS, 0.0))[[0, 2, 1, 3]], "order"),
        (CORNERS, through_pinhole(at(CORNERS, 0.0))[[0, 3, 2, 1]], "order"),
    ],
    ids=["three", "unequal", "flat", "line", "one place", "nan", "vast", "crossed", "mirrored"],
)
def test_points_that_fix_no_camera_are_refused(points, pixels, message):
    with pytest.raises(ConfigurationError, match=message):
        TableCalibration.fit(points, pixels)


def test_a_camera_below_the_plane_is_refused():
    calibration = TableCalibration.fit(CORNERS, through_pinhole(at(CORNERS, 0.0)))
    with pytest.raises(ConfigurationError, match="higher than"):
        calibration.at_height(0.1, np.array([0.5, 0.0, 0.05]))


def test_a_saved_calibration_comes_back(tmp_path):
    made = TableCalibration.fit(GRID, through_pinhole(at(GRID, 0.1)).round(), height=0.1)
    made = made.at_height(0.05, CAMERA)
    made.save(f"{tmp_path}/table.json")
    loaded = TableCalibration.load(f"{tmp_path}/table.json")
    np.testing.assert_array_equal(loaded.homography, made.homography)
    assert loaded.summary() == made.summary()
    assert (loaded.height, loaded.fit_error) == (made.height, made.fit_error)


@pytest.mark.parametrize(
    "damage", ["missing", "cut", "another kind", "no kind", "no homography", "nan", "no text"]
)
def test_a_file_that_is_no_calibration_is_refused(tmp_path, damage):
    path = tmp_path / "table.json"
    TableCalibration.fit(CORNERS, through_pinhole(at(CORNERS, 0.0))).save(path)
    content = json.loads(path.read_text())
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_text(path.read_text()[:40])
    elif damage == "no text":
        path.write_bytes(path.read_bytes().replace(b"prior-", b"\xff"))
    else:
        content.pop(damage.removeprefix("no ")) if damage.startswith("no ") else None
        content.update({"kind": "x"} if damage == "another kind" else {})
        content.update({"homography": [[float("nan")] * 3] * 3} if damage == "nan" else {})
        path.write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=r"table\.json"):
        TableCalibration.load(path)


def test_a_calibration_is_of_a_picture_and_scaled_to_others_of_its_shape(tmp_path):
    pixels = through_pinhole(at(GRID, 0.0))
    calibration = TableCalibration.fit(GRID, pixels, picture=(1920, 1080))
    calibration.save(tmp_path / "table.json")
    again = TableCalibration.load(tmp_path / "table.json")
    assert again.picture == (1920, 1080)
    assert again.in_picture((1920, 1080)) is again
    smaller = again.in_picture((1280, 720))
    np.testing.assert_allclose(smaller.to_table(pixels * 2 / 3), GRID, atol=1e-9)
    np.testing.assert_allclose(smaller.clicked, np.multiply(again.clicked, 2 / 3))
    for size in ((1080, 1920), (1440, 1080), (1920, 1200)):
        with pytest.raises(ConfigurationError, match="calibrate again"):
            again.in_picture(size)
    with pytest.raises(ConfigurationError, match="outside a picture"):
        TableCalibration.fit(GRID, pixels, picture=(640, 480))
    assert again.at_height(0.1, CAMERA).picture == (1920, 1080)


def test_a_picture_that_cannot_hold_the_points_is_another_one(tmp_path):
    made = TableCalibration.fit(GRID, through_pinhole(at(GRID, 0.0)))
    made.save(tmp_path / "table.json")
    again = TableCalibration.load(tmp_path / "table.json")
    u, v = through_pinhole(at(GRID, 0.0)).max(axis=0)
    assert again.in_picture((int(u) + 5, int(v) + 5)) is again
    for size in ((int(u) - 5, int(v) + 5), (int(u) + 5, int(v) - 5)):
        with pytest.raises(
            ConfigurationError, match=r"outside this picture.* turned or of another"
        ):
            again.in_picture(size)


def test_the_spread_is_no_smaller_than_what_is_left_out():
    pixels = through_pinhole(at(GRID, 0.0))
    assert TableCalibration.fit(GRID, pixels).sd == CAMERA_SD
    typed = GRID.copy()
    typed[1, 1] += 0.1
    calibration = TableCalibration.fit(typed, pixels)
    assert calibration.sd == calibration.left_out_error > 0.02
    off, others_off = left_out_errors(typed, pixels)
    assert np.argmin(others_off) == 1
    assert off[1] > 0.08


@pytest.mark.parametrize("beside", [0.0, 0.003, 0.02])
def test_a_corner_that_the_other_points_cannot_predict_does_not_count(beside):
    """Without a corner, the middle is on the line of two others; a click's noise hides that."""
    points = np.vstack([CORNERS, np.add(CORNERS.mean(axis=0), (beside, 0.0))])
    clicks = np.array([[-0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [0.5, 0.5], [0.5, 0.0]])
    pixels = through_pinhole(at(points, 0.0)) + clicks
    off, others_off = left_out_errors(points, pixels)
    np.testing.assert_array_equal(np.isnan(off), [True, True, True, True, False])
    np.testing.assert_array_equal(np.isnan(others_off), np.isnan(off))
    calibration = TableCalibration.fit(points, pixels)
    assert calibration.left_out_error == pytest.approx(off[4])
    assert calibration.sd < 0.004
    assert calibration.untested == 4


@pytest.mark.parametrize("wrong", [0, 30, 100])
def test_points_that_the_others_do_not_test_are_counted_until_the_remedy_is_followed(
    wrong, tmp_path
):
    """Of four corners and the middle, no residual shows a corner that is off along its diagonal."""

    def clicked(points):
        pixels = through_pinhole(at(points, 0.0))
        diagonal = pixels[2] - pixels[0]
        pixels[2] += wrong * diagonal / np.linalg.norm(diagonal)
        return TableCalibration.fit(points, pixels)

    low, high = CORNERS.min(axis=0), CORNERS.max(axis=0)
    five = np.array([low, (low[0], high[1]), high, (high[0], low[1]), (low + high) / 2])
    blind = clicked(five)
    assert blind.fit_error < 1e-5
    assert "calibrated to" not in blind.summary()
    assert "add the middles of two opposite sides" in blind.summary()
    blind.save(tmp_path / "table.json")
    assert TableCalibration.load(tmp_path / "table.json").summary() == blind.summary()
    middles = [(low[0], five[4, 1]), (high[0], five[4, 1])]
    followed = clicked(np.vstack([five, middles]))
    assert followed.untested == 0
    assert "calibrated to" in followed.summary()
    assert (followed.sd > CAMERA_SD) == (wrong > 0)


@pytest.mark.parametrize("aside", [0.01, 0.05, 0.2])
def test_what_points_near_a_line_leave_open_beside_it_is_stated(aside):
    """Over fits to noisy pixels, places in the square spread no wider than is said."""
    line = np.column_stack([np.linspace(0.4, 1.2, 6), aside * np.array([0, 1, -1, 1, 0, -1])])
    pixels = through_pinhole(at(line, 0.0))
    stated = TableCalibration.fit(line, pixels).worst_sd
    around = np.array([(x, y) for x in (0.4, 0.8, 1.2) for y in (-0.4, 0.0, 0.4)])
    noise = np.random.default_rng(0).normal(size=(300, *pixels.shape)) / 5  # still linear
    seen = [
        TableCalibration(_direct_linear_transform(line, pixels + n), 0.0, 0.0, None).to_table(
            through_pinhole(at(around, 0.0))
        )
        for n in noise
    ]
    assert np.std(seen, axis=0).max() * 5 == pytest.approx(stated, rel=0.25)
    assert (stated > 0.02) == (aside < 0.1)


def test_a_summary_states_the_worst_place_and_a_file_keeps_it(tmp_path):
    thin = GRID * [1, 0.02]
    made = TableCalibration.fit(thin, through_pinhole(at(thin, 0.0)))
    assert made.sd == made.worst_sd > 0.05
    assert f"{100 * made.worst_sd:.2f} cm at worst" in made.summary()
    made.save(tmp_path / "table.json")
    assert TableCalibration.load(tmp_path / "table.json").sd == made.sd
    assert made.at_height(0.1, CAMERA).sd < made.sd  # nearer to the camera
    content = json.loads((tmp_path / "table.json").read_text())
    del content["worst_sd_m"], content["clicked_px"]  # as before they were stated
    (tmp_path / "table.json").write_text(json.dumps(content))
    assert TableCalibration.load(tmp_path / "table.json").sd == CAMERA_SD


def test_noisy_pixels_show_in_the_worst_place_and_only_what_the_picture_shows_counts():
    pixels = through_pinhole(at(GRID, 0.0))
    noise = np.random.default_rng(0).normal(size=pixels.shape)
    fine, rough = (TableCalibration.fit(GRID, pixels + k * noise) for k in (1, 8))
    assert rough.worst_sd > 4 * fine.worst_sd
    strip = GRID * [1, 0.2]
    cut = tuple(through_pinhole(at(strip, 0.0)).max(axis=0).astype(int) + 5)
    whole = TableCalibration.fit(strip, through_pinhole(at(strip, 0.0)))
    shown = TableCalibration.fit(strip, through_pinhole(at(strip, 0.0)), picture=cut)
    assert shown.worst_sd < whole.worst_sd


def test_pixels_in_shares_of_the_pictures_sides_are_named():
    pixels = through_pinhole(at(GRID, 0.0)) / [1280, 720]
    with pytest.raises(ConfigurationError, match="multiply u by its width and v by its height"):
        TableCalibration.fit(GRID, pixels, picture=(1280, 720))
    TableCalibration.fit(GRID, pixels * [1280, 720])


@pytest.mark.parametrize("what", ["place", "pixel"])
def test_a_point_given_twice_is_named(what):
    points, pixels = GRID.copy(), through_pinhole(at(GRID, 0.0))
    (points if what == "place" else pixels)[5] = (points if what == "place" else pixels)[2]
    with pytest.raises(ConfigurationError, match=f"points 3 and 6 have one {what}"):
        TableCalibration.fit(points, pixels)


def test_an_objects_size_in_the_picture_is_that_of_a_disc_or_a_ball():
    camera = TableCalibration.fit(CORNERS, 400 - 1000 * CORNERS[:, ::-1] / 2.0)
    disc, ball = camera.seen(np.array([400.0, 400.0]), 0.06)  # from straight above
    np.testing.assert_allclose([*disc, ball], 30.0, rtol=1e-3)
    slanted = TableCalibration.fit(GRID, through_pinhole(at(GRID, 0.0)))
    disc, ball = slanted.seen(slanted.to_pixels([0.8, 0.0]), 0.06)
    assert disc.min() < disc.max() <= ball * 1.001
