"""What nobody can have measured or seen is refused; the rest is told, but not of true points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception import doubts
from prior_reinforce.perception.vlm_reading import Sighting
from tests.perception.test_viewpoint import FOCAL, POINTS, SIZE, seen

ABOVE, SIDE = (np.array([0.85, 0.0, 2.0]), 0.0), (np.array([0.0, 0.0, 1.2]), 0.6)
SIX = POINTS[[0, 1, 2, 6, 7, 8]]


def calibrated(points=SIX, view=ABOVE, noise=0.0, **how):
    pixels = seen(SIX, *view) + noise * np.random.default_rng(0).normal(size=(6, 2))
    made = doubts.calibrate(points, pixels, picture=SIZE, **how)
    return made, doubts.of_calibration(made, points, pixels)


@pytest.mark.parametrize("view", [ABOVE, SIDE])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_points_that_are_measured_and_clicked_well_leave_no_doubt(view, noise):
    assert calibrated(view=view, noise=noise)[1] == []


def test_a_side_that_is_a_little_too_long_is_told_and_a_much_longer_one_refused():
    made, said = calibrated(SIX * [1, 1.1])
    assert made.left_out_error < 1e-6  # the points agree with one another
    assert any("typed too long" in doubt for doubt in said)
    for stretch in (1.5, 2.0, 0.5):
        with pytest.raises(ConfigurationError, match="no camera sees"):
            calibrated(SIX * [1, stretch])
    with pytest.raises(ConfigurationError, match="no camera sees"):
        calibrated(SIX * [1, 2], SIDE)


def test_a_rectangle_that_begins_at_the_wrong_corner_is_refused():
    corners = np.array([[0.6, 0.2], [0.6, -0.2], [1.2, -0.2], [1.2, 0.2]])
    with pytest.raises(ConfigurationError, match="same corner"):
        doubts.calibrate(np.roll(corners, 1, axis=0), seen(corners, *ABOVE), picture=SIZE)


@pytest.mark.parametrize(("times", "says"), [(100, "centimetres"), (0.01, "metres are typed")])
def test_points_in_another_unit_are_refused(times, says):
    with pytest.raises(ConfigurationError, match=says):
        calibrated(SIX * times)


def test_points_that_are_no_numbers_are_not_said_to_be_far():
    with pytest.raises(ConfigurationError, match="finite"):
        calibrated(np.where(SIX == 0.0, np.nan, SIX))


@pytest.mark.parametrize(("before", "now"), [(1, 3), (3, 1), (1, 2), (1, 4), (6, 8)])
def test_a_picture_that_says_that_it_is_turned_or_mirrored_is_told(before, now):
    made, _ = calibrated(exif=before)
    assert f"EXIF orientation {now}, and {before}" in doubts.of_picture(made, SIZE, now)[0]
    assert doubts.of_picture(made, SIZE, before) == []


def test_upright_pixels_of_a_telephone_that_was_saved_as_a_png_are_no_other_picture():
    made, _ = calibrated(exif=1)
    assert doubts.of_picture(made, SIZE, 6) == []


def box_of(place, size, view, *, ball):
    """Box around a ball that rests on the table, or a disc that lies there."""
    around, up = np.meshgrid(
        np.linspace(0, 2 * np.pi, 90), np.linspace(0, np.pi, 45 if ball else 1)
    )
    camera, tilt = view
    cos, sin = np.cos(tilt), np.sin(tilt)
    axes = np.array([[0, -1, 0], [-cos, 0, -sin], [sin, 0, -cos]])
    radii, heights = (np.sin(up), 1 + np.cos(up)) if ball else (np.ones_like(around), 0 * around)
    on = np.stack([radii * np.cos(around), radii * np.sin(around), heights], axis=-1)
    at = (np.array([*place, 0.0]) + size / 2 * on.reshape(-1, 3) - camera) @ axes.T
    pixels = np.array([640.0, 360.0]) + FOCAL * at[:, :2] / at[:, 2:]
    return (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())


def sighted(made, box):
    middle = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2])
    return Sighting("the ball", (), box, made.to_table(middle))


@pytest.mark.parametrize("by", ["colour", "model"])
def test_a_ball_that_rests_on_the_table_is_as_unsure_as_it_is_seen_behind_its_foot(by):
    made, place = calibrated(view=SIDE)[0], np.array([0.95, 0.1])
    ball = sighted(made, box_of(place, 0.06, SIDE, ball=True))
    off = doubts.behind(made, ball, 0.06, by)
    assert 0.02 < np.linalg.norm(ball.place - place) < 0.03
    np.testing.assert_allclose(off, np.abs(ball.place - place), atol=0.004)
    (said,) = doubts.of_slant(made, "the ball", 0.06, off)
    assert "--outcome-height 0.03" in said
    assert not doubts.behind(replace(made, height=0.03), ball, 0.06, by).any()
    disc = sighted(made, box_of(place, 0.06, SIDE, ball=False))
    assert not doubts.behind(made, disc, 0.06, by).any()


def test_from_above_a_ball_is_where_it_stands():
    made, place = calibrated()[0], np.array([0.95, 0.1])
    ball = sighted(made, box_of(place, 0.06, ABOVE, ball=True))
    assert doubts.of_slant(made, "the ball", 0.06, doubts.behind(made, ball, 0.06, "model")) == []


@pytest.mark.parametrize("view", [ABOVE, SIDE])
@pytest.mark.parametrize("ball", [True, False])
def test_a_models_box_in_another_scale_is_no_box_of_that_object(view, ball):
    made = calibrated(view=view)[0]
    box = np.array(box_of([0.95, 0.1], 0.06, view, ball=ball))
    assert doubts.misread(made, sighted(made, box.tolist()), 0.06, round=True) == ""
    if view is SIDE:  # where a smaller box fits a place that is farther
        return
    for per in ((1, SIZE[1] / SIZE[0]), (0.78, 0.78), (0.78, 1.39)):  # thousandths, pixels, order
        other = sighted(made, (box * np.tile(per, 2)).tolist())
        assert "model family" in doubts.misread(made, other, 0.06, round=True)


def test_a_box_that_is_drawn_a_little_too_wide_is_none_in_another_scale():
    """In a picture of 4 to 3 it is nearly as flat as that."""
    pixels = seen(SIX, *ABOVE) + np.array([0, 120])
    made = doubts.calibrate(SIX, pixels, picture=(1280, 960))
    left, top, right, bottom = box_of([0.95, 0.1], 0.06, ABOVE, ball=True)
    loose = sighted(made, (left - 3, top + 120, right + 3, bottom + 120))
    assert doubts.misread(made, loose, 0.06, round=True) == ""
