"""A picture of the table: calibrated by known points, and where the object lies in it.

Files in the workspace: `camera.json`, the calibration; `pictures/table.jpg` and
`pictures/trial-003.jpg`, the latest picture of the table and of a trial. While a trial waits to be
told, or an older one is corrected, only its own counts. A picture comes from any camera, and the
page sends it: what shows the table to the browser is none of our business. Tags to be printed
(`tags.svg`, 40 mm wide) are OpenCV's AprilTags of the family 36h11.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from msgspec import Struct

from prior_reinforce.arm.console.verbs import Verbs
from prior_reinforce.arm.console.view import ConsoleState
from prior_reinforce.environment import SeenObject, TableScene
from prior_reinforce.errors import ConfigurationError, PerceptionFailedError
from prior_reinforce.files import named_disk_errors, require_inside, sha256, write
from prior_reinforce.perception import doubts
from prior_reinforce.perception.calibration import CAMERA_SD, TableCalibration
from prior_reinforce.perception.colour_camera import ColourClient
from prior_reinforce.perception.pictures import read_picture, stored_turn
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

_FAMILY = "DICT_APRILTAG_36h11"
"""Tags that are printed, by OpenCV's name."""
_LEAST_TAGS = 4
"""So many tags of another family are no chance pattern, and could calibrate (ours)."""
LARGEST_PICTURE = 12_000_000
"""Bytes; ours: a photograph of a telephone."""


class Camera(Struct):
    """What is known of the camera."""

    points: list[list[float]]
    """Known points (x, y) of the last calibration, or places to begin with, in [m]."""
    picture: str = ""
    """Hash of the picture; empty where there is none."""
    of: str = ""
    """What it is of: `trial 3` or `the table`."""
    to_table: list[list[float]] | None = None
    """Homography from its pixels to the table, in [m]; None until it is calibrated."""
    summary: str = ""
    doubts: list[str] = []
    """Why the calibration, or the picture, may be wrong."""
    sd: float = CAMERA_SD
    """Of each component of a place that is touched in the picture, in [m]."""


class Calibrate(Struct, forbid_unknown_fields=True):
    """Known points of the table, and where they are in the latest picture."""

    points: list[tuple[float, float]]
    """(x, y), in [m]."""
    pixels: list[tuple[float, float]]
    """(u, v), in [px] from the picture's top left corner."""
    trial: int | None = None
    """Whose picture; 0 for the latest of all, None for that of the one that waits to be told."""


class Look(Struct, forbid_unknown_fields=True):
    """Find an object in the latest picture."""

    words: str
    """For instance `the orange ball`."""
    size: float
    """Longer side of a box around it, in [m]."""
    by: Literal["colour", "model"] = "colour"
    round: bool = True
    """Whether it is as wide from all sides; a flatter box is then taken for a part of it."""
    trial: int | None = None
    """Whose picture; 0 for the latest of all, None for that of the one that waits to be told."""


class Found(Struct):
    """A box to be accepted, or moved."""

    box: list[float]
    """Left, top, right, bottom, in [px]."""
    place: list[float]
    """What its centre stands on, (x, y) in [m]."""
    sd: float
    """Of each component of the place, in [m]: larger where the box shows a part of the object."""
    doubts: list[str]
    """Why it may not stand there."""


class Pictures:
    """Pictures of a workspace's table."""

    def __init__(self, verbs: Verbs, vlm: VisionLanguageModelConfig) -> None:
        """Work on the workspace of these verbs; `vlm` says which model looks."""
        self._verbs, self._vlm = verbs, vlm
        self._folder = verbs.folder / "pictures"

    def look_up(self, trial: int | None = None) -> Camera:
        """Say what is known of the camera, and of a trial's picture (`trial` as in `Look`)."""
        camera = Camera(_known_points(self._verbs.state()))
        if (path := self._picture(trial)) is not None:
            camera.picture = sha256(path.read_bytes())[:16]
            camera.of = "the table" if path.stem == "table" else f"trial {int(path.stem[6:])}"
        if (calibration := self._calibration()) is None:
            return camera
        camera.summary, camera.sd = calibration.summary(), calibration.sd
        try:
            if path is not None:
                camera.doubts = doubts.of_picture(calibration, _size(path), _turn(path))
                calibration = calibration.in_picture(_size(path))
        except ConfigurationError as error:
            camera.summary = str(error)
            return camera
        camera.to_table = np.linalg.inv(calibration.homography).tolist()
        return camera

    def keep(self, content: bytes, trial: int | None = None) -> Camera:
        """Keep a picture of a trial, of the one that waits to be told, or (0) of the table."""
        from PIL import Image

        encoded = io.BytesIO()  # anew: nothing that a file hides goes into the workspace
        picture, turn = read_picture(io.BytesIO(content)), stored_turn(io.BytesIO(content))
        note = f"{_TURN}{turn}"
        Image.fromarray(picture).save(encoded, "JPEG", quality=92, comment=note)
        trial = self._that_waits() if trial is None else trial
        if trial:
            self._verbs.workspace.state.trial(trial)
        name = _name(trial)
        with named_disk_errors(self._folder):
            write(require_inside(self._folder / name, self._verbs.folder), encoded.getvalue())
        self._verbs.publish({"camera": name})
        return self.look_up(trial)

    def file(self, trial: int | None = None) -> Path:
        """Return the picture of a trial (`trial` as in `Look`)."""
        if (path := self._picture(trial)) is None:
            raise PerceptionFailedError("there is no picture yet; take one")
        return path

    def calibrate(self, body: Calibrate) -> Camera:
        """Fit the table to known points in the picture, and keep the calibration."""
        path = self.file(body.trial)
        calibration = doubts.calibrate(
            body.points, body.pixels, picture=_size(path), exif=_turn(path)
        )
        with named_disk_errors(self._verbs.folder):
            calibration.save(require_inside(self._verbs.folder / "camera.json", self._verbs.folder))
        camera = self.look_up(body.trial)
        of_points = doubts.of_calibration(calibration, body.points, body.pixels)
        camera.doubts = [*of_points, *camera.doubts]
        self._verbs.publish({"camera": "calibrated"})  # last: a page hears it with the answer
        return camera

    def tags(self, trial: int | None = None) -> dict[int, list[float]]:
        """Find printed tags: pixel of the centre of each, tag k lying on known point k."""
        import cv2

        grey = cv2.cvtColor(read_picture(self.file(trial)), cv2.COLOR_RGB2GRAY)
        numbers, corners = _tags_in(grey, _FAMILY)
        if not len(numbers):
            families = (name for name in dir(cv2.aruco) if name.startswith("DICT_"))
            seen = {name: len(_tags_in(grey, name)[0]) for name in families}
            other = max(seen, key=seen.__getitem__)
            if seen[other] >= _LEAST_TAGS:
                raise PerceptionFailedError(
                    f"no tag of {_FAMILY} is seen, but {seen[other]} of {other}; print and lay out "
                    "those behind 'Tags to print'"
                )
            return {}
        often = np.bincount(numbers)
        if often.max() > 1:
            raise PerceptionFailedError(
                f"tag {often.argmax() + 1} is seen {often.max()} times; cover all but one"
            )
        found = zip(numbers, corners, strict=True)
        return {int(number) + 1: _crossing(four.reshape(4, 2)) for number, four in found}

    def find(self, body: Look) -> Found:
        """Find an object in the picture, by its colour or by a vision-language model."""
        calibration = self._calibration()
        if calibration is None:
            raise ConfigurationError("the camera is not calibrated; touch the known points first")
        wanted = SeenObject(body.words, body.size, body.round)
        scene = TableScene(wanted, wanted, plane_height=calibration.height)
        path = self.file(body.trial)
        of_picture = doubts.of_picture(calibration, _size(path), _turn(path))
        here, by_colour = calibration.in_picture(_size(path)), body.by == "colour"
        client = ColourClient(self._vlm.family) if by_colour else None
        with VisionLanguageModel(scene, self._vlm, client=client, calibration=here) as model:
            sighting = model.find(wanted, read_picture(path))
        if not by_colour and (why := doubts.misread(here, sighting, body.size, round=body.round)):
            raise PerceptionFailedError(f"{why} Touch it in the picture")
        if sighting.box is None or sighting.place is None:
            raise PerceptionFailedError(f"{sighting.problem}; touch it in the picture")
        behind = doubts.behind(here, sighting, body.size, body.by)
        said = [
            *of_picture,
            *doubts.of_sighting(here, sighting, "untick 'It is round'"),
            *doubts.of_slant(here, body.words, body.size, behind),
        ]
        sd = here.sd_off(np.maximum(sighting.off, behind)).max()
        return Found([*sighting.box], sighting.place.tolist(), float(sd), said)

    def _calibration(self) -> TableCalibration | None:
        path = require_inside(self._verbs.folder / "camera.json", self._verbs.folder)
        return TableCalibration.load(path) if path.is_file() else None

    def _picture(self, trial: int | None) -> Path | None:
        trial = self._that_waits() if trial is None else trial
        taken = self._folder.glob(_name(trial) if trial else "*.jpg")
        mine = (p for p in taken if _OURS.fullmatch(p.name) and not p.is_symlink())
        return max(mine, key=lambda path: path.stat().st_mtime_ns, default=None)

    def _that_waits(self) -> int:
        waits = self._verbs.state().open_trial
        return 0 if waits is None else waits.number


def _name(trial: int) -> str:
    return f"trial-{trial:03d}.jpg" if trial else "table.jpg"


_OURS = re.compile(r"table\.jpg|trial-\d+\.jpg")
_TURN = "EXIF orientation was "
"""A kept picture's comment; it is kept upright."""


def _turn(path: Path) -> int:
    """EXIF orientation of the photograph that `keep` was given; 1 where nothing says it."""
    from PIL import Image

    with Image.open(path) as image:
        note = image.info.get("comment", b"").decode(errors="replace")
    return int(note[-1]) if re.fullmatch(f"{_TURN}[1-8]", note) else 1


_PLACES = [[0.6, 0.3], [0.6, 0.0], [0.6, -0.3], [1.2, -0.3], [1.2, 0.0], [1.2, 0.3]]
"""Known points to begin with, around where an arm with a reach of 0.9 m throws (ours). Six: with
any one left out, the others fix the plane, so each tells how good the calibration is. Four corners
and their middle do not: a corner left out, the others have three on a line."""


def _known_points(state: ConsoleState) -> list[list[float]]:
    """Six points around the demonstrations, on a grid of 10 cm that is easy to measure."""
    axes = [component.axis for component in state.components]
    if not state.shown or not {0, 1} <= {*axes}:
        return _PLACES
    places = 10 * np.array(state.shown)[:, [axes.index(0), axes.index(1)]]
    low = np.floor(places.min(0))
    (a, b), (c, d) = low / 10, np.maximum(np.ceil(places.max(0)), low + 1) / 10
    middle = (b + d) / 2
    six = [[a, d], [a, middle], [a, b], [c, b], [c, middle], [c, d]]
    return np.round(six, 2).tolist()


def _size(path: Path) -> tuple[int, int]:
    from PIL import Image

    with Image.open(path) as image:  # which `keep` wrote, upright
        return image.size


def _tags_in(grey: np.ndarray, family: str) -> tuple[np.ndarray, Sequence[np.ndarray]]:
    """Numbers and corners of the tags of one of OpenCV's families."""
    import cv2

    tags = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family))
    corners, numbers, _ = cv2.aruco.ArucoDetector(tags).detectMarkers(grey)
    return np.empty(0, int) if numbers is None else numbers.ravel(), corners


def _crossing(corners: np.ndarray) -> list[float]:
    """Where the diagonals of four corners meet: the centre of a square, however it is seen."""
    one, other = (np.cross([*corners[i], 1.0], [*corners[i + 2], 1.0]) for i in (0, 1))
    u, v, w = np.cross(one, other)
    return [float(u / w), float(v / w)]
