"""What makes a calibration, or a photograph that is read by it, doubtful: on both command and page.

What no camera can see, or nobody can have measured, is a ConfigurationError; each other doubt is a
sentence with its remedy, for the operator.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.calibration import TableCalibration, left_out_errors
from prior_reinforce.perception.viewpoint import least_miss, slope_at
from prior_reinforce.perception.vlm import another_scale, sides_of
from prior_reinforce.perception.vlm_reading import Sighting
from prior_reinforce.units import UNITS, looks_like

COARSE = 0.02
"""Spread of a calibration that is warned of, in [m]; ours: more than any task's tolerance."""
_CLOSE = 0.03
"""Known points all within so much, in [m], are said in another unit; ours: two tags wide at least,
and a metre typed for a centimetre makes 3 m of it."""
_STRETCHED, _IMPOSSIBLE = 0.0035, 0.015
"""From which miss of the best camera on a calibration is warned of, and refused, as a share of the
picture's longer side. Ours: clicks that are 1 px off in 1280 come to 0.0021 from any side, a bent
lens to 0.0004, from above a side that is a tenth too long to 0.006 to 0.016, another corner to 0.05
or more. From the side a focal length hides up to a half."""
_NOISE = 3.0
"""Below so many [px] a miss is the clicks'; ours: as in a small picture."""
_BESIDE = 5.0
"""From how many times the points' own errors on the points fix no places beside them; ours: it is
1 to 3 where they stand in the corners of the table, with a wrong one or without."""
_FAR_BEYOND = 0.25
"""How far beyond the calibrated points an object is warned of, as a part of how far these are
apart. Ours: places are extrapolated there."""
_FLAT, _TOLD = {"colour": 1.05, "model": 1.1}, {"colour": 1.1, "model": 1.2}
"""An object is flat whose box is at most so many times a flat disc's, where a ball's is at least so
many times that (ours): a colour's is a pixel or two too large, a model's is drawn loosely."""


def calibrate(
    points: ArrayLike,
    pixels: ArrayLike,
    *,
    height: float = 0.0,
    picture: tuple[int, int] | None = None,
    exif: int | None = None,
) -> TableCalibration:
    """Fit a calibration to points that a person measured and clicked.

    Arguments as of `TableCalibration.fit`; `exif` is the photograph's orientation.

    Raises:
        ConfigurationError: As `TableCalibration.fit`; points in another unit than metres, or that
            no camera sees so.
    """
    places = np.asarray(points, dtype=float)
    farthest = float(np.abs(places).max(initial=0.0))
    if np.isfinite(farthest) and (looks := looks_like("m", farthest)):
        raise ConfigurationError(
            f"a point {farthest:g} m away looks like {UNITS[looks].plural}; write "
            f"x [{looks}] and y [{looks}] in the head (inches: [in]), or metres; on the page type "
            "centimetres"
        )
    calibration = TableCalibration.fit(places, pixels, height=height, picture=picture)
    apart = float(np.ptp(places, axis=0).max())
    if apart < _CLOSE:
        raise ConfigurationError(
            f"all points lie within {100 * apart:.1f} cm, as where metres are typed for "
            "centimetres; a file is in metres, the page in centimetres"
        )
    miss = least_miss(calibration, np.asarray(pixels, dtype=float))
    if picture is not None and miss > max(_NOISE, _IMPOSSIBLE * max(picture)):
        raise ConfigurationError(
            f"no camera sees the points there: the best is {miss:.0f} px off. Measure both sides "
            "again, begin at the same corner in the picture, give u and v in its pixels, and the "
            "whole picture if it is cut"
        )
    return replace(calibration, exif=exif)


def of_calibration(
    calibration: TableCalibration, points: ArrayLike, pixels: ArrayLike
) -> list[str]:
    """Return why a calibration, by these points [m] and pixels, is coarse, or may be stretched."""
    said, picture = [], calibration.picture
    places, seen = np.asarray(points, dtype=float), np.asarray(pixels, dtype=float)
    miss = least_miss(calibration, seen)
    if picture is not None and miss > max(_NOISE, _STRETCHED * max(picture)):
        said.append(
            f"the best camera sees the points {miss:.0f} px off, as where one side is measured or "
            "typed too long: measure both again (a picture that is cut looks so, too)"
        )
    if calibration.sd <= COARSE:
        return said
    _, others_off = left_out_errors(places, seen)
    # Without the point that is wrong the others agree, where they are enough to disagree; one that
    # is not tested may be the wrong one.
    agree = others_off <= 2 * np.nan_to_num(others_off, nan=np.inf).min() + 0.001
    blamed = " or ".join(
        f"{i + 1} ({x:g}, {y:g})" for i, (x, y) in enumerate(places.tolist()) if agree[i]
    )
    if calibration.worst_sd > max(COARSE, _BESIDE * calibration.fit_error):
        remedy = " beside the points; give more, in all corners of the table"
    elif not calibration.untested and agree.sum() <= len(agree) / 2:
        remedy = f"; without point {blamed} the others agree: measure and click it again"
    else:
        remedy = "; give more points, in all corners; two may be exchanged, as two tags are"
    return [*said, f"that is coarse{remedy}"]


def of_picture(calibration: TableCalibration, size: tuple[int, int], turn: int) -> list[str]:
    """Return why the calibration may not be of a picture of this size [px] and EXIF orientation.

    ConfigurationError if it is not.
    """
    said, exif = [], calibration.exif
    # Upright 6 as a PNG is 1, and 8 as well: only among those of one shape is one turned.
    if exif is not None and exif != turn and (exif > 4) == (turn > 4):
        said.append(
            "this picture says that it is upside down or mirrored against that of the calibration "
            f"(EXIF orientation {turn}, and {exif}); if the camera hangs as it did then, errors' "
            "signs are wrong: save both as PNG, and calibrate again"
        )
    here = calibration.in_picture(size)
    if here.untested:
        said.append(f"{here.summary()}, and calibrate again")
    if here is not calibration:
        said.append(
            "the picture has another size than that of the calibration, and is scaled to it; if it "
            "was cut instead, all places are wrong: take it as before"
        )
    return said


def of_sighting(calibration: TableCalibration, sighting: Sighting, not_round: str) -> list[str]:
    """Return why an object may not stand where it is seen; `not_round` says how to say so."""
    if sighting.box is None or sighting.place is None:
        return []
    said = [_beyond(calibration, sighting)]
    if sighting.off_by is not None and (calibration.sd_off(sighting.off) > calibration.sd).any():
        may_be = f"its middle may be {100 * np.linalg.norm(sighting.off):.1f} cm off"
        said.append(
            {
                "cut": f"{sighting.words} is cut by the picture's border: {may_be}; show all of it",
                "hidden": f"{sighting.words} is half hidden: {may_be}; show all of it, or "
                f"{not_round} if it is not round",
                "too large": f"the box of {sighting.words} is larger than it is: {may_be}; is "
                "something else in it, is its size right?",
            }[sighting.off_by]
        )
    return [doubt for doubt in said if doubt]


def _beyond(calibration: TableCalibration, sighting: Sighting) -> str:
    """What to say of an object that is seen far outside the box around the clicked points."""
    if calibration.clicked is None or sighting.box is None:
        return ""
    left, top, right, bottom = calibration.clicked
    u, v = (sighting.box[0] + sighting.box[2]) / 2, (sighting.box[1] + sighting.box[3]) / 2
    nearest = np.array([np.clip(u, left, right), np.clip(v, top, bottom)])
    place, edge = calibration.to_table(np.array([u, v])), calibration.to_table(nearest)
    ends = calibration.to_table(np.array([[left, top], [right, bottom]]))
    beyond, across = np.linalg.norm(place - edge), np.linalg.norm(ends[1] - ends[0])
    if beyond <= _FAR_BEYOND * across:
        return ""
    return (
        f"{sighting.words} is seen {100 * beyond:.0f} cm beyond the calibrated points, which are "
        f"{100 * across:.0f} cm apart: there nothing tells how far off its place is; calibrate "
        "with points all around"
    )


def behind(
    calibration: TableCalibration, sighting: Sighting, size: float, by: Literal["colour", "model"]
) -> Float[np.ndarray, "2"]:
    """Return how far behind its foot an object of this size [m] may be seen, in [m].

    What rests on the table, a ball, has its middle at half its size; from the side that covers a
    place farther from the camera. Zero where the box is as flat as a disc's, or where the plane is
    as high as that: then the object is in the plane.
    """
    assert sighting.box is not None
    assert sighting.place is not None
    sides, disc, ball = sides_of(sighting.box, calibration, size)
    flat = (sides <= _FLAT[by] * disc).all() and (ball >= _TOLD[by] * disc).any()
    lift = 0.0 if flat else max(size / 2 - calibration.height, 0.0)
    off: Float[np.ndarray, "2"] = lift * np.abs(slope_at(calibration, sighting.place))
    return off


def of_slant(
    calibration: TableCalibration, words: str, size: float, off: Float[np.ndarray, "2"]
) -> list[str]:
    """Return what to say of an object of this size [m] that is seen so far `behind` its foot."""
    if (calibration.sd_off(off) <= calibration.sd).all():
        return []
    return [
        f"from the side, {words} is seen up to {100 * np.linalg.norm(off):.1f} cm behind where it "
        "touches the table: hang the camera straighter above it, or calibrate in the plane of its "
        f"middle (`calibrate` with --outcome-height {size / 2:g} and --camera X Y Z)"
    ]


def misread(calibration: TableCalibration, sighting: Sighting, size: float, *, round: bool) -> str:
    """Return why a model's box of one object of this size [m] is read wrongly, if it is.

    Where two objects are sought, `VisionLanguageModel.read` compares them; one alone must look as
    large as it is, and not as flat as the picture, which boxes in another scale do.
    """
    if sighting.box is None or calibration.picture is None:
        return ""
    wide, tall = calibration.picture
    looks = another_scale([(sighting.box, size)], calibration, wide / tall, round)
    return looks and (
        f"{sighting.words} looks {looks}: is the model family set right, does the server shrink "
        "pictures (then set max_image_side), is the size right?"
    )
