"""Where the camera hangs, as far as the known points' perspective tells, and whether any does.

A homography of a camera with square pixels, whose optical axis meets the picture's middle, has one
unknown, the focal length f: each f puts the camera somewhere, and most do not fit the perspective.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.calibration import TableCalibration

_FOCAL_LENGTHS = np.geomspace(0.3, 4.0, 300)
"""Of cameras, in shares of the picture's longer side (ours): a view of 120 to 14 degrees."""
_SLACK = 3.0
"""How much worse than the best another f may fit the points, in [px]; ours: three times what a
click is off, so that a view from straight above, which any f fits, tells no height."""


def possible_places(calibration: TableCalibration) -> Float[np.ndarray, "n 3"]:
    """Return where the camera may hang, table frame, in [m], from the shortest f to the longest.

    None where the picture's size, or where the points were clicked, is not known.
    """
    if calibration.picture is None or calibration.clicked is None:
        return np.empty((0, 3))
    places, misses = _places_by_focal_length(calibration, _corners(calibration.clicked))
    return places[misses <= misses.min() + _SLACK]


def least_miss(calibration: TableCalibration, pixels: Float[np.ndarray, "n 2"]) -> float:
    """Return how far off the best camera with square pixels sees the clicked points, rms, in [px].

    0 where the picture's size is not known. Other points than the clicked ones are seen so where a
    length was measured or typed wrongly, or begun at another corner, in all of them alike.
    """
    if calibration.picture is None:
        return 0.0
    # No corner of the box around them, which may be seen beyond the horizon.
    return float(_places_by_focal_length(calibration, pixels)[1].min())


def slope_at(
    calibration: TableCalibration, place: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "2"]:
    """Return how far behind its foot what stands at a place is seen, in [m] per [m] of height.

    Zero where nothing is known. Where any f fits, as from straight above, f is near 0.7 of the
    picture's longer side, as in telephones and webcams (ours).
    """
    places = possible_places(calibration)
    if not len(places):
        return np.zeros(2)
    camera = places[len(places) // 3]
    slope: Float[np.ndarray, "2"] = (place - camera[:2]) / (camera[2] - calibration.height)
    return slope


def _places_by_focal_length(
    calibration: TableCalibration, pixels: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, " m"]]:
    """For each f, where the camera hangs that sees these pixels best, and how far off, in [px]."""
    assert calibration.picture is not None
    on_table = calibration.to_table(pixels)
    near = on_table.mean(axis=0)
    middle = np.array(calibration.picture) / 2
    to_middle, from_near = np.eye(3), np.eye(3)
    to_middle[:2, 2], from_near[:2, 2] = -middle, near
    centred = to_middle @ calibration.homography @ from_near
    places, misses = [], []
    for focal in _FOCAL_LENGTHS * max(calibration.picture):
        # diag(f, f, 1) [r1 r2 t] up to scale: r1 and r2 as near as orthonormal columns come.
        left, stretch, right = np.linalg.svd(centred[:, :2] / [[focal], [focal], [1.0]], False)
        axes = left @ right
        turn = np.column_stack([axes, np.cross(*axes.T)])
        shift = centred[:, 2] / [focal, focal, 1.0] / stretch.mean()
        misses.append(_miss(focal, (on_table - near) @ axes.T + shift, pixels - middle))
        places.append([*near, calibration.height] - turn.T @ shift)
    return np.array(places), np.array(misses)


def miss_from(calibration: TableCalibration, camera: Float[np.ndarray, "3"]) -> float:
    """Return how far off a camera there sees the points, at least, in [px].

    For each f it is turned as the rays want it. Source: Wahba's problem, solved by an SVD
    (Markley, Journal of the Astronautical Sciences 36, 1988).
    """
    if calibration.picture is None or calibration.clicked is None:
        return 0.0
    corners, middle = _corners(calibration.clicked), np.array(calibration.picture) / 2
    on_table = calibration.to_table(corners)
    towards = np.column_stack([on_table, np.full(4, calibration.height)]) - camera
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    misses = []
    for focal in _FOCAL_LENGTHS * max(calibration.picture):
        rays = np.column_stack([corners - middle, np.full(4, focal)])
        left, _, right = np.linalg.svd(rays.T @ towards)
        turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        misses.append(_miss(focal, towards @ turn.T, corners - middle))
    return float(min(misses))


def camera_costs(
    calibration: TableCalibration, height: float, camera: Float[np.ndarray, "3"]
) -> float:
    """Return by how much places of a parallel plane are off, at least, if the camera hangs there.

    Against where the perspective of the points' own plane puts it, in [m], where the points are; 0
    where a camera there sees them within what a click is off, or nothing is known. `height` of the
    other plane above the table and the camera's place are in [m].
    """
    if not np.isfinite(camera).all() or miss_from(calibration, camera) <= _SLACK:
        return 0.0
    costs = []
    for place in possible_places(calibration):
        with suppress(ConfigurationError):  # below a plane, or beyond any hall
            there, here = (
                calibration.at_height(height, at).to_table(_corners(calibration.clicked))
                for at in (place, camera)
            )
            costs.append(float(np.linalg.norm(there - here, axis=1).max()))
    return min(costs, default=0.0)


def _miss(focal: float, at: Float[np.ndarray, "n 3"], seen: Float[np.ndarray, "n 2"]) -> float:
    """How far places before a camera, in any unit, are from where they are seen, rms, in [px]."""
    return float(np.linalg.norm(focal * at[:, :2] / at[:, 2:] - seen) / len(seen) ** 0.5)


def _corners(box: tuple[float, float, float, float] | None) -> Float[np.ndarray, "4 2"]:
    left, top, right, bottom = box or (0.0,) * 4
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
