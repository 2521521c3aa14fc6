"""From a picture's pixels to metres on the table: one homography, and how far it can be trusted.

Notation:
    H  `homography`  (3, 3)  table plane [m] to picture [px], both in homogeneous coordinates

Pixel coordinates are continuous: (0, 0) is the picture's top left corner, x runs right, y runs
down, and the first pixel's centre is (0.5, 0.5).
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce import files
from prior_reinforce.arrays import LARGEST
from prior_reinforce.errors import ConfigurationError, FileFormatError

_Pairs = Float[np.ndarray, "n 2"]

_Row = tuple[float, float, float]


class _Saved(
    msgspec.Struct,
    rename={
        "picture": "picture_px",
        "height": "height_m",
        "fit_error": "fit_error_m",
        "left_out_error": "left_out_error_m",
        "worst_sd": "worst_sd_m",
        "clicked": "clicked_px",
        "exif": "exif_orientation",
    },
):
    """What a file holds of a `TableCalibration`; its numbers are finite, as JSON's are."""

    kind: Literal["prior-reinforce table calibration 2"]
    homography: tuple[_Row, _Row, _Row]
    height: float
    fit_error: float
    left_out_error: float | None
    picture: tuple[int, int] | None
    worst_sd: float = 0.0
    clicked: tuple[float, float, float, float] | None = None
    exif: int | None = None
    untested: int = 0


# Singular values of the design matrix below this share of the largest count as zero: points on
# one line leave about 1e-16, points clicked to a pixel on a real table 1e-2 (ours).
_RANK_FLOOR = 1e-6
_SAME_SHAPE = 0.005
"""Share by which two pictures' sides may differ in proportion and be one picture, scaled (ours):
a pixel of rounding."""
CAMERA_SD = 0.003
"""Least standard deviation of each component of a place that is read from a picture, in [m] (ours):
twice what `reproduction/benchmarks/vlm_accuracy.py` finds where objects are found by colour; no
model was measured."""
_CLICK_SD = 1.0
"""Least standard deviation of a known point's pixel, in [px]; ours: nobody clicks finer."""
_FORETOLD = 5.0
"""How many times as uncertain as the worst place of all points a left-out point may be by the
others; ours: a corner comes to 60 or more by three others and a middle within 2 cm, and to 2 in a
grid of nine."""
_SHARES = 2.0
"""All points within so many pixels are said in shares of the picture's sides, in [px]; ours: from
there nothing could be calibrated."""
_HIGHEST = 20.0
"""Largest height of a camera above a table, in [m]; ours: beyond any hall, and below any height in
centimetres."""


@dataclass(frozen=True, eq=False)
class TableCalibration:
    """Maps pixels to one plane parallel to the table, and back.

    A homography is exact for a pinhole camera and one plane. What stands above or below that plane
    is seen shifted away from the camera's foot (parallax), so calibrate in the plane in which the
    outcome is defined, with `fit`, or move a calibration there, with `at_height`.
    """

    homography: Float[np.ndarray, "3 3"]
    """H, with Frobenius norm 1 and positive depth over the table."""
    height: float
    """Height of the plane above the table, in [m]."""
    fit_error: float
    """Root mean square distance between the points and their pixels seen through H, in [m].
    Zero by construction where there were only four points."""
    left_out_error: float | None
    """The same for each point that is tested, seen through an H fitted to all others, in [m]: what
    to expect of a point that was not clicked. None where no point is tested, as of four."""
    picture: tuple[int, int] | None = None
    """Width and height of the upright picture, in [px]; None where nobody said."""
    worst_sd: float = 0.0
    """Largest standard deviation of a component of a place, in [m], in the square around the points
    that is as wide as they are, as far as the picture shows it. Zero where nobody said."""
    clicked: tuple[float, float, float, float] | None = None
    """Box around the points' pixels: left, top, right, bottom; None where nobody said."""
    exif: int | None = None
    """EXIF orientation of the photograph in which points were clicked; None without one."""
    untested: int = 0
    """How many points the others leave open, so that a wrong one of them may not show."""

    @property
    def sd(self) -> float:
        """Standard deviation of each component of a place, in [m]: the largest that is known."""
        return max(CAMERA_SD, self.fit_error, self.left_out_error or 0.0, self.worst_sd)

    def sd_off(self, off: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
        """Return the standard deviation of a place that may be so far off besides, in [m].

        Up to twice `sd` that says enough (ours: what hides a part of an object is in `CAMERA_SD`).
        """
        return np.where(np.abs(off) > 2 * self.sd, np.abs(off), self.sd)

    @classmethod
    def fit(
        cls,
        table_points: ArrayLike,
        pixels: ArrayLike,
        *,
        height: float = 0.0,
        picture: tuple[int, int] | None = None,
    ) -> TableCalibration:
        """Fit H to known points by the normalised direct linear transform.

        Source: Hartley and Zisserman, Multiple View Geometry, 2nd ed., algorithm 4.2.

        Args:
            table_points: Known points in the plane, table frame, shape (n, 2), n >= 4, in [m].
            pixels: Where they are in the picture, shape (n, 2), in [px].
            height: Height of the plane above the table, in [m].
            picture: Width and height of the picture, in [px], if known.

        Raises:
            ConfigurationError: Too few points, points on one line or said twice, pixels in another
                order or outside the picture.
        """
        points, seen = np.asarray(table_points, dtype=float), np.asarray(pixels, dtype=float)
        if points.shape != seen.shape or points.shape[1:] != (2,) or len(points) < 4:
            raise ConfigurationError(
                f"calibration points of shape {points.shape} and pixels of shape {seen.shape}: "
                "expected (n, 2) for both, with n >= 4; click at least four known points"
            )
        if not np.all(np.abs([points, seen]) <= LARGEST):
            raise ConfigurationError(
                f"calibration points and pixels must be finite, and at most {LARGEST:.0e}; click "
                "them again"
            )
        if picture is not None and not np.all((seen >= 0) & (seen <= picture)):
            raise ConfigurationError(
                f"pixels up to {seen.max(axis=0).tolist()} lie outside a picture of "
                f"{_by(picture)}; give the picture in which they were clicked, u to the right and "
                "v down"
            )
        for what, given in (("place", points), ("pixel", seen)):
            _, index, often = np.unique(
                given.round(6), axis=0, return_inverse=True, return_counts=True
            )
            twice = np.flatnonzero(often[index.ravel()] > 1)
            if len(twice):
                raise ConfigurationError(
                    f"calibration points {' and '.join(map(str, twice[:9] + 1))} have one {what} "
                    "twice, or are the same; give each point once"
                )
        spread = float(np.ptp(seen, axis=0).max())
        if spread <= _SHARES:
            raise ConfigurationError(
                f"all u and v lie within {spread:.2g} px, as shares of a picture's sides do; "
                "multiply u by its width and v by its height, in pixels"
            )
        homography = _direct_linear_transform(points, seen)
        fit_error = _rms(_map(np.linalg.inv(homography), seen) - points)
        misses, _ = left_out_errors(points, seen)
        left_out = None if np.isnan(misses).all() else float(np.sqrt(np.nanmean(misses**2)))
        # Of four points nothing is left over that would show the pixels' noise.
        n_free = max(2 * len(points) - 8, 1)
        residual = np.linalg.norm(_map(homography, points) - seen) / np.sqrt(n_free)
        per_pixel = _worst_sd_per_pixel(homography, points, picture)
        worst = per_pixel * float(max(_CLICK_SD, residual))
        clicked = *seen.min(axis=0).tolist(), *seen.max(axis=0).tolist()
        fitted = cls(homography, float(height), fit_error, left_out, picture, worst, clicked)
        return replace(fitted, untested=int(np.isnan(misses).sum()))

    def to_table(self, pixels: ArrayLike) -> Float[np.ndarray, "*n 2"]:
        """Map pixels, shape (..., 2), to points in the plane, in [m]."""
        return _map(np.linalg.inv(self.homography), np.asarray(pixels, dtype=float))

    def to_pixels(self, table_points: ArrayLike) -> Float[np.ndarray, "*n 2"]:
        """Map points in the plane, shape (..., 2), in [m], to pixels."""
        return _map(self.homography, np.asarray(table_points, dtype=float))

    def seen(
        self, pixel: Float[np.ndarray, "2"], size: float
    ) -> tuple[Float[np.ndarray, "2"], float]:
        """Return how large what stands at a pixel looks, in [px].

        Args:
            pixel: Where it is.
            size: Diameter, in [m].

        Returns:
            Width and height of the box around a flat disc, and the side of that around a ball.
        """
        place, step = self.to_table(pixel), 1e-3
        moved = self.to_pixels(place + step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        per_metre = (moved[1:] - moved[0]).T / step
        ball = np.linalg.norm(per_metre, ord=2)
        return size * np.linalg.norm(per_metre, axis=1), float(size * ball)

    def in_picture(self, size: tuple[int, int]) -> TableCalibration:
        """Return the calibration of a picture of this width and height in [px], scaled if need be.

        Raises:
            ConfigurationError: It is turned, or of another shape, and so of another view.
        """
        if self.picture is None and self.clicked is not None:
            u, v = self.clicked[2:]
            if u > size[0] or v > size[1]:
                raise ConfigurationError(
                    f"the camera was calibrated on points as far as ({u:.0f}, {v:.0f}) px, outside "
                    f"this picture of {_by(size)}, which is turned or of another size; take it as "
                    "before, or calibrate again with the picture in which they were clicked"
                )
        if self.picture is None or size == self.picture:
            return self
        per_x, per_y = np.divide(size, self.picture)
        if abs(per_x / per_y - 1) > _SAME_SHAPE:
            raise ConfigurationError(
                f"the camera was calibrated in a picture of {_by(self.picture)}, and this one has "
                f"{_by(size)}, which is turned or cut; take it as before, or calibrate again"
            )
        homography = np.diag([per_x, per_y, 1.0]) @ self.homography
        clicked = self.clicked
        if clicked is not None:
            left, top, right, bottom = clicked
            clicked = left * per_x, top * per_y, right * per_x, bottom * per_y
        homography /= np.linalg.norm(homography)
        return replace(self, homography=homography, picture=size, clicked=clicked)

    def at_height(self, height: float, camera_position: ArrayLike) -> TableCalibration:
        """Return the calibration of a parallel plane, from where the camera hangs.

        The ray through a pixel meets the two planes in p and p'. With the camera at c, higher than
        both by d and d', p' = c + (p - c) d' / d: a scaling about the camera's foot.

        Args:
            height: Height of the new plane above the table, in [m].
            camera_position: Camera in the table frame, shape (3,), in [m]. A tape measure will do:
                its error enters by the factor (height - self.height) / d, and drops out of the
                difference of two points in the same plane but for its vertical part.

        Raises:
            ConfigurationError: The camera is not above both planes, or not within 20 m.
        """
        camera = np.asarray(camera_position, dtype=float)
        above = camera.shape == (3,) and camera[2] > max(height, self.height)
        if not above or not np.abs(camera).max() <= _HIGHEST:
            raise ConfigurationError(
                f"camera position {camera.tolist()} must be three numbers in metres, at most "
                f"{_HIGHEST:g} and higher than the planes at {self.height} m and {height} m; "
                "measure it from the table's frame"
            )
        scale = (camera[2] - self.height) / (camera[2] - height)
        from_new_plane = np.eye(3)
        from_new_plane[:2] *= scale
        from_new_plane[:2, 2] = (1 - scale) * camera[:2]
        homography = self.homography @ from_new_plane
        homography /= np.linalg.norm(homography)
        return replace(
            self,
            homography=homography,
            height=float(height),
            fit_error=self.fit_error / scale,
            left_out_error=None if self.left_out_error is None else self.left_out_error / scale,
            worst_sd=self.worst_sd / scale,
        )

    def summary(self) -> str:
        """One line for the operator, in centimetres."""
        at_worst = f"{100 * self.worst_sd:.2f} cm at worst in the square around them"
        says = f"{at_worst}, plane {100 * self.height:.1f} cm above the table"
        if self.untested or self.left_out_error is None:
            return (
                f"calibrated, {says}; {self.untested} points are not tested by the others, and may "
                "be wrong: add the middles of two opposite sides of the table"
            )
        left_out = f"{100 * self.left_out_error:.2f} cm"
        return f"calibrated to {left_out} (each point through the others), {says}"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the calibration as JSON."""
        own = vars(self) | {"homography": self.homography.tolist()}
        saved = _Saved("prior-reinforce table calibration 2", **own)
        files.write(
            Path(path), json.dumps(msgspec.to_builtins(saved, enc_hook=float), indent=2) + "\n"
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> TableCalibration:
        """Read what `save` wrote.

        Raises:
            FileFormatError: The file is missing or is not a calibration.
        """
        try:
            saved = msgspec.json.decode(Path(path).read_bytes(), type=_Saved)
            np.linalg.inv(saved.homography)
        except (OSError, ValueError, np.linalg.LinAlgError) as error:
            raise FileFormatError(
                f"{path} is not a table calibration ({error}); write one with `calibrate`, or with "
                "TableCalibration.save"
            ) from error
        own = msgspec.structs.asdict(saved) | {"homography": np.array(saved.homography)}
        own["untested"] = own["untested"] or 4 * (saved.left_out_error is None)  # of older files
        del own["kind"]
        return cls(**own)


def _direct_linear_transform(points: _Pairs, pixels: _Pairs) -> Float[np.ndarray, "3 3"]:
    """Least algebraic error H with unit norm."""
    to_unit_points, to_unit_pixels = _similarity_to_unit(points), _similarity_to_unit(pixels)
    table = np.insert(_map(to_unit_points, points), 2, 1.0, axis=1)
    _, singular_values, right = np.linalg.svd(_design(table, _map(to_unit_pixels, pixels)))
    if singular_values[7] < _RANK_FLOOR * singular_values[0]:
        raise ConfigurationError(
            f"{len(points)} calibration points (nearly) on one line do not fix a plane; spread "
            "them to the corners of the table"
        )
    homography = np.linalg.inv(to_unit_pixels) @ right[-1].reshape(3, 3) @ to_unit_points
    homography /= np.linalg.norm(homography)
    depths = points @ homography[2, :2] + homography[2, 2]
    if depths.sum() < 0:
        homography, depths = -homography, -depths
    # A camera above the table sees all points before it, and turns x forward, y left (which are
    # counterclockwise) into x right, y down (clockwise): a negative determinant.
    if not (depths > 0).all() or not np.linalg.det(homography) < 0:
        raise ConfigurationError(
            "no camera above the table sees the calibration points in these places; give the "
            "pixels in the points' order, with the table's x forward and y left"
        )
    return homography


def _design(table: Float[np.ndarray, "n 3"], pixels: _Pairs) -> Float[np.ndarray, "2*n 9"]:
    """Rows that are zero times H: of all u, then of all v."""
    none, (u, v) = np.zeros_like(table), pixels.T[:, :, None]
    return np.block([[table, none, -u * table], [none, table, -v * table]])


def _worst_sd_per_pixel(
    homography: Float[np.ndarray, "3 3"], points: _Pairs, picture: tuple[int, int] | None
) -> float:
    """Largest of `_sd_per_pixel` in the square around the points, where the picture shows it."""
    middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0).max() / 2
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-half, half, 9)]), axis=-1).reshape(-1, 2)
    around = middle + grid
    seen = _map(homography, around)
    shown = around @ homography[2, :2] + homography[2, 2] > 0
    if picture is not None:
        shown &= ((seen >= 0) & (seen <= picture)).all(axis=1)
    return _sd_per_pixel(homography, points, np.vstack([points, around[shown]]))


def _sd_per_pixel(
    homography: Float[np.ndarray, "3 3"], points: _Pairs, places: Float[np.ndarray, "m 2"]
) -> float:
    """Largest standard deviation of a component of places, in [m] per [px] of the points' noise.

    The noise moves H, and so the place of a pixel, to first order; infinite where the points leave
    H open. Source: Hartley and Zisserman, 2nd ed., section 5.2.
    """
    to_unit_points = _similarity_to_unit(points)
    to_unit_pixels = _similarity_to_unit(_map(homography, points))
    unit = to_unit_pixels @ homography @ np.linalg.inv(to_unit_points)

    def moved(places: _Pairs) -> tuple[Float[np.ndarray, "2*n 9"], Float[np.ndarray, "n 2 2"]]:
        """How H and the place move each pixel."""
        table = np.insert(_map(to_unit_points, places), 2, 1.0, axis=1)
        table /= (table @ unit[2])[:, None]
        at = table @ unit[:2].T
        by_place = (unit[:2, :2] - at[:, :, None] * unit[2, :2]) * table[:, 2, None, None]
        return _design(table, at), by_place

    of_points = moved(points)[0]
    singular_values = np.linalg.svd(of_points, compute_uv=False)
    if singular_values[7] < _RANK_FLOOR**2 * singular_values[0]:
        return np.inf
    by_pixels = np.linalg.pinv(of_points, rcond=_RANK_FLOOR**2)
    by_h, by_place = moved(places)
    of_pixels = (by_h @ by_pixels).reshape(2, len(by_place), -1).swapaxes(0, 1)
    sds = np.linalg.norm(np.linalg.solve(by_place, of_pixels), axis=2)
    return float(sds.max() * to_unit_pixels[0, 0] / to_unit_points[0, 0])


def left_out_errors(
    points: _Pairs, pixels: _Pairs
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return what each point's H of all others says: how far it lies off, and the others, in [m].

    nan where they are four, or the others (nearly) leave open where this one is.
    """
    off, others_off = np.full((2, len(points)), np.nan)
    if len(points) <= 4:
        return off, others_off
    homography = _direct_linear_transform(points, pixels)
    worst = _worst_sd_per_pixel(homography, points, None)
    for i in range(len(points)):
        others = np.delete(points, i, axis=0), np.delete(pixels, i, axis=0)
        if not _sd_per_pixel(homography, others[0], points[i : i + 1]) <= _FORETOLD * worst:
            continue
        with suppress(ConfigurationError):
            to_points = np.linalg.inv(_direct_linear_transform(*others))
            off[i] = _rms(_map(to_points, pixels[i : i + 1]) - points[i])
            others_off[i] = _rms(_map(to_points, others[1]) - others[0])
    return off, others_off


def _similarity_to_unit(points: _Pairs) -> Float[np.ndarray, "3 3"]:
    """Similarity that moves points to centroid 0 and root mean square distance sqrt(2)."""
    centre = points.mean(axis=0)
    spread = np.sqrt(((points - centre) ** 2).sum(axis=1).mean() / 2)
    return np.array([[1, 0, -centre[0]], [0, 1, -centre[1]], [0, 0, spread]]) / spread


def _map(
    homography: Float[np.ndarray, "3 3"], points: Float[np.ndarray, "*n 2"]
) -> Float[np.ndarray, "*n 2"]:
    """Apply a projective map."""
    mapped = points @ homography[:, :2].T + homography[:, 2]
    return mapped[..., :2] / mapped[..., 2:]


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]} px"


def _rms(differences: _Pairs) -> float:
    return float(np.sqrt((differences**2).sum(axis=-1).mean()))
