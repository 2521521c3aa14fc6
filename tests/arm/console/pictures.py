"""A made-up camera above a made-up table: what it shows, and where everything truly is."""

from __future__ import annotations

import io

import cv2
import numpy as np
from PIL import Image

SIZE = (1280, 720)
_TABLE_PX = 1000
"""Pixels per metre of the table's own picture: x from 0.4 to 1.4, y from 0.6 to -0.6."""


def homography():
    """Table (x, y, 1) in [m] to pixels, as a pinhole at (0.34, 0.015, 1.0), f = 960 px, sees it."""
    table = np.array([[0.5, 0.5], [0.5, -0.5], [1.3, -0.5], [1.3, 0.5]])
    pixels = np.array([[145, 676], [1144, 683], [1007, 83], [285, 75]])
    return cv2.getPerspectiveTransform(table.astype(np.float32), pixels.astype(np.float32))


def pixel(place):
    u, v, w = homography() @ [*place, 1.0]
    return [u / w, v / w]


def jpeg(ball=None, tags=(), family=cv2.aruco.DICT_APRILTAG_36h11):
    """The table as JPEG, with an orange ball at a place, and tag k with its centre at tags[k]."""
    table = np.full((_TABLE_PX, int(1.2 * _TABLE_PX), 3), 225, np.uint8)
    at = lambda x, y: (round((0.6 - y) * _TABLE_PX), round((1.4 - x) * _TABLE_PX))  # noqa: E731
    for step in np.arange(-0.6, 0.61, 0.1):
        cv2.line(table, at(0.4, step), at(1.4, step), (190,) * 3, 2)
    for step in np.arange(0.4, 1.41, 0.1):
        cv2.line(table, at(step, -0.6), at(step, 0.6), (190,) * 3, 2)
    dictionary = cv2.aruco.getPredefinedDictionary(family)
    for number, place in enumerate(tags):
        tag = cv2.aruco.generateImageMarker(dictionary, number, 60)
        u, v = at(*place)
        table[v - 45 : v + 45, u - 45 : u + 45] = 255
        table[v - 30 : v + 30, u - 30 : u + 30] = tag[..., None]
    if ball is not None:
        cv2.circle(table, at(*ball), 20, (255, 120, 0), -1)
    to_table_px = np.array([[0, -_TABLE_PX, 600.0], [-_TABLE_PX, 0, 1400.0], [0, 0, 1]])
    warp = homography() @ np.linalg.inv(to_table_px)
    seen = cv2.warpPerspective(table, warp, SIZE, borderValue=(90, 95, 100))
    encoded = io.BytesIO()
    Image.fromarray(seen).save(encoded, "JPEG", quality=95)
    return encoded.getvalue()
