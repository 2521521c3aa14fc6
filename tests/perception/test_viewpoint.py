"""Where the camera hangs: against pinholes that hang where we put them."""

from __future__ import annotations

import numpy as np
import pytest

from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.viewpoint import (
    camera_costs,
    least_miss,
    miss_from,
    possible_places,
    slope_at,
)

POINTS = np.array([(x, y) for x in (0.5, 0.85, 1.2) for y in (-0.4, 0.0, 0.4)])
SIZE, FOCAL = (1280, 720), 1000.0


def seen(points, camera, tilt, middle=(640.0, 360.0)):
    """Pixels of table points, for a camera that looks down, tilted forward."""
    cos, sin = np.cos(tilt), np.sin(tilt)
    axes = np.array([[0, -1, 0], [-cos, 0, -sin], [sin, 0, -cos]])
    at = (np.column_stack([points, np.zeros(len(points))]) - camera) @ axes.T
    return middle + FOCAL * at[:, :2] / at[:, 2:]


def calibrated(camera, tilt, noise=0.0, middle=(640.0, 360.0), picture=SIZE):
    pixels = seen(POINTS, camera, tilt, middle)
    pixels += noise * np.random.default_rng(0).normal(size=pixels.shape)
    return TableCalibration.fit(POINTS, pixels, picture=picture)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "tilt"), [((0.75, 0.0, 2.4), 0.1), ((0.0, 0.1, 2.2), 0.4), ((-0.4, 0.0, 1.6), 0.7)]
)
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_the_camera_is_among_the_places_and_another_origin_is_not(camera, tilt, noise):
    camera = np.array(camera)
    calibration = calibrated(camera, tilt, noise)
    places = possible_places(calibration)
    assert np.linalg.norm(places - camera, axis=1).min() < 0.12
    assert camera_costs(calibration, 0.1, camera) < 0.004
    taped = camera + np.array([0.05, -0.05, 0.05])
    assert camera_costs(calibration, 0.1, taped) < 0.008
    for wrong in np.array([[-0.75, 0.0, -0.4], [0.7, 0.0, 0.0], [0.0, -0.8, 0.0]]):
        assert camera_costs(calibration, 0.1, camera + wrong) > 0.02


def test_a_steep_view_tells_the_height_and_one_from_straight_above_does_not():
    steep = possible_places(calibrated(np.array([-0.4, 0.0, 1.6]), 0.7))[:, 2]
    above = calibrated(np.array([0.85, 0.0, 2.4]), 0.0, noise=1.0)
    assert np.ptp(steep) < 0.3
    assert np.ptp(possible_places(above)[:, 2]) > 5
    assert camera_costs(above, 0.1, np.array([0.85, 0.0, 1.6])) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize(
    "points",
    [
        0.7 + 0.15 * POINTS,  # 10 cm wide
        POINTS[[0, 2, 6, 8]] * [1, 0.1],
        POINTS * [0.1, 1] + [0.7, 0.0],
    ],
    ids=["small", "four on a strip", "strip across"],
)
def test_points_whose_perspective_is_lost_in_the_noise_accuse_no_camera(points):
    camera, noise = np.array([0.8, 0.0, 2.4]), np.random.default_rng(0)
    for tilt in (0.0, 0.1) * 10:
        pixels = seen(points, camera, tilt)
        pixels += noise.normal(size=pixels.shape)
        calibration = TableCalibration.fit(points, pixels, picture=SIZE)
        assert camera_costs(calibration, 0.1, camera + np.array([0.03, -0.03, 0.03])) == 0.0


def test_the_points_are_seen_so_from_the_camera_and_not_from_elsewhere():
    camera = np.array([0.0, 0.1, 2.2])
    calibration = calibrated(camera, 0.4)
    assert miss_from(calibration, camera) < 1.0  # f is tried in steps
    assert miss_from(calibration, camera + np.array([0.7, 0.0, 0.0])) > 10
    assert miss_from(calibrated(camera, 0.4, picture=None), camera) == 0.0


def test_an_axis_a_little_beside_the_pictures_middle_is_no_other_camera():
    camera = np.array([0.75, 0.0, 2.4])
    calibration = calibrated(camera, 0.1, noise=1.0, middle=(680.0, 330.0))
    assert camera_costs(calibration, 0.1, camera) < 0.012


def test_without_the_pictures_size_nothing_is_said():
    calibration = calibrated(np.array([0.75, 0.0, 2.4]), 0.1, picture=None)
    assert len(possible_places(calibration)) == 0
    assert camera_costs(calibration, 0.1, np.array([0.0, 0.0, 1.2])) == 0.0


def test_the_best_camera_misses_points_that_are_stretched():
    camera = np.array([0.75, 0.0, 2.4])
    pixels = seen(POINTS, camera, 0.1)
    stretched = TableCalibration.fit(POINTS * [1, 1.5], pixels, picture=SIZE)
    assert least_miss(calibrated(camera, 0.1), pixels) < 0.5
    assert least_miss(stretched, pixels) > 20
    assert least_miss(calibrated(camera, 0.1, picture=None), pixels) == 0.0


def test_corners_seen_aslant_by_a_camera_that_is_turned_are_where_a_camera_sees_them():
    middle, turned = np.array([640.0, 640.0]), np.sqrt(0.5) * np.array([[1, 1], [-1, 1]])
    corners, size = POINTS[[0, 2, 8, 6]], (1280, 1280)
    pixels = middle + (seen(corners, np.array([-0.1, 0.0, 0.4]), 1.1, middle) - middle) @ turned
    pixels += np.random.default_rng(0).normal(size=pixels.shape)
    assert least_miss(TableCalibration.fit(corners, pixels, picture=size), pixels) < 3


@pytest.mark.parametrize(("camera", "tilt"), [((0.0, 0.1, 1.2), 0.6), ((0.8, 0.0, 2.0), 0.0)])
def test_what_stands_high_is_seen_as_far_behind_as_the_cameras_ray_slopes(camera, tilt):
    place = np.array([1.1, 0.3])
    slope = slope_at(calibrated(np.array(camera), tilt), place)
    np.testing.assert_allclose(slope, (place - camera[:2]) / camera[2], rtol=0.15)
    assert not slope_at(calibrated(np.array(camera), tilt, picture=None), place).any()
