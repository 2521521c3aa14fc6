"""Commands on photographs of a real table: calibrate the camera, see a trial's error."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from jaxtyping import Float

from prior_reinforce.arrays import Point
from prior_reinforce.commands import warn
from prior_reinforce.commands.vision import Vlm, model_of
from prior_reinforce.environment import SeenObject, TableScene
from prior_reinforce.errors import (
    ConfigurationError,
    EndpointError,
    FileFormatError,
    PerceptionFailedError,
)
from prior_reinforce.extras import check_installed
from prior_reinforce.files import named_disk_errors, refuse_foreign, write
from prior_reinforce.units import factor, looks_like
from prior_reinforce.wording import WORDS, axes_of, to_words

if TYPE_CHECKING:
    from prior_reinforce.perception.calibration import TableCalibration
    from prior_reinforce.perception.vlm_reading import PictureReading

_COLUMNS = ("x", "y", "u", "v")
_IN_PIXELS = re.compile(r"([uv])[\s_/\[(]+(?:in[\s_]+)?(?:px|pixels?)[\])]?", re.IGNORECASE)
"""`u [px]`, `v_px`, `u in pixels`."""
_ROUND = re.compile(r"\s*\((.*)\)$")
"""`x (ft)`."""
_HEIGHTS = {"height": "z", "h": "z"}
"""Other names of a column z."""
_LEVEL = 0.01
"""Heights of points that differ by less are one, in [m]; ours: as an arm's tip measures them."""
_EXPOSURE = 10
"""Frames, of which the last is kept; ours: the first are dark until a webcam has set itself."""
_SAME_GOAL, _OTHER_GOAL = 0.02, 0.06
"""By how far what stands at the goal may be seen from it, in [m], without a warning; from where on
the picture or its reading is another one than is thought. Ours: twice a camera's error, and
farther than anybody misplaces a hoop who measures. Between them, nobody knows whether the hoop or
the calibration is off, so what is told is no surer than that."""


@dataclass(frozen=True)
class Calibrate:
    """Fit the camera to known points of the table, and say how well it fits.

    For example:
        prior-reinforce calibrate points.csv --out table.json
    """

    points: Annotated[Path, tyro.conf.Positional]
    """CSV with columns x, y (table frame, in metres: forward, left) and u, v (in pixels: right,
    down), four points at least; six, in the corners and in the middles of two opposite sides, to
    know how well it fits. A column z is their height, and the same in all."""
    height: float | None = None
    """Height of the points above the table, in [m]; zero where the CSV has no column z either."""
    picture: Path | None = None
    """The photograph in which u and v were clicked: others are then scaled to its size, or refused
    where they are turned or cut."""
    outcome_height: float | None = None
    """Height at which the outcome is defined, in [m], if it is another; needs --camera."""
    camera: tuple[float, float, float] | None = None
    """Where the camera hangs, table frame, in [m]; a tape measure will do."""
    out: Path = Path("table.json")
    """File for the calibration."""

    def run(self) -> None:
        """Fit, save, and say how far each point lies from where the others put it."""
        from prior_reinforce.perception import doubts
        from prior_reinforce.perception.pictures import read_picture, stored_turn

        refuse_foreign(self.out, "prior-reinforce table calibration")
        table_points, pixels, stated = _read_points(self.points)
        if self.height is not None and stated not in (None, self.height):
            raise ConfigurationError(
                f"{self.points} says that the points are {stated:g} m high, and --height "
                f"{self.height:g}; leave one away"
            )
        height = self.height if self.height is not None else stated or 0.0
        of_points = "--height" if stated is None else f"column z of {self.points}"
        for name, above in ((of_points, height), ("--outcome-height", self.outcome_height)):
            if above is not None and looks_like("m", above):
                raise ConfigurationError(f"{name} must be metres above the table, got {above}")
        if (self.camera is None) != (self.outcome_height is None):
            raise ConfigurationError(
                "--outcome-height needs --camera X Y Z, in metres, and that serves for it only"
            )
        if np.any(pixels < 0):
            raise ConfigurationError(
                f"pixels down to {pixels.min(axis=0).tolist()} are negative; count u to the right "
                "and v down from the picture's top left corner"
            )
        size = exif = None
        if self.picture is not None:
            tall, wide, _ = read_picture(self.picture).shape
            size, exif = (wide, tall), stored_turn(self.picture)
            _check_turn(self.picture, pixels, size)
        calibration = doubts.calibrate(table_points, pixels, height=height, picture=size, exif=exif)
        said = doubts.of_calibration(calibration, table_points, pixels)
        if self.camera is not None and self.outcome_height is not None:
            _check_camera(calibration, self.outcome_height, self.camera)
            calibration = calibration.at_height(self.outcome_height, np.array(self.camera))
        calibration.save(self.out)
        print(f"{calibration.summary()}: {self.out}")
        if size is None:
            warn(
                "without --picture a photograph of another size, turned or cut is not told from "
                "one of this camera; give the one in which u and v were clicked"
            )
        for doubt in said:
            warn(doubt)


@dataclass(frozen=True)
class Look:
    """See a trial's error in a photograph from above, with a vision-language model.

    For example:
        prior-reinforce look table.jpg --reached "the ball" --reached-size 0.04 --goal "the hoop"
            --goal-size 0.2 --workspace hoop --trial 3
    """

    picture: Annotated[Path, tyro.conf.Positional]
    """Photograph of the key frame, from the calibrated camera; where to keep it, with --camera."""
    reached: str
    """What flew or slid, in words that fit one thing only: "the orange ball"."""
    reached_size: float
    """Longer side of a box around it, in [m]."""
    goal: str
    """What stands at the goal: "the red hoop"."""
    goal_size: float
    """Longer side of a box around it, in [m]."""
    reached_round: bool = True
    """`--no-reached-round`: what flew is not as wide from all sides; else a flatter box is taken
    for a part of it."""
    goal_round: bool = True
    """`--no-goal-round`: the same of what stands at the goal."""
    goal_offset: tuple[float, float] = (0.0, 0.0)
    """From that object's centre to the goal, forward and left, in [m]."""
    camera: str | None = None
    """Take the photograph first, with this camera: 0, 1, ... or the address of a stream."""
    calibration: Path = Path("table.json")
    """What `calibrate` wrote."""
    workspace: Path | None = None
    """Workspace whose trial it was (the current folder's if not given): the error is seen from the
    goal that is set there, and what was seen is kept there, in pictures/."""
    trial: int | None = None
    """Number of that trial."""
    vlm: Vlm = None

    def run(self) -> None:
        """Look, keep what was seen beside the photograph, and say what to tell."""
        from prior_reinforce.perception import doubts
        from prior_reinforce.perception.calibration import TableCalibration
        from prior_reinforce.perception.pictures import read_picture, stored_turn
        from prior_reinforce.perception.vlm import VisionLanguageModel

        if np.abs(self.goal_offset).max() >= 1:
            raise ConfigurationError(f"--goal-offset is in metres, got {self.goal_offset}")
        goal, folder, stem, verb = self._of_trial()
        around = None if goal is None else folder.parent
        drawn = folder / f"{stem}.png"
        written = drawn.with_suffix(".json")
        for path in (folder, drawn, written):
            if goal is not None and path.is_symlink():
                raise FileFormatError(f"{path} is a link; nothing is written through it, remove it")
        refuse_foreign(drawn if not written.exists() else written, "picture_size_px")
        calibration = TableCalibration.load(self.calibration)
        scene = TableScene(
            SeenObject(self.reached, self.reached_size, self.reached_round),
            SeenObject(self.goal, self.goal_size, self.goal_round),
            plane_height=calibration.height,
            goal_offset=self.goal_offset,
        )
        if self.camera is not None:
            _photograph(self.camera, self.picture)
        picture = read_picture(self.picture)
        size = picture.shape[1], picture.shape[0]
        for doubt in doubts.of_picture(calibration, size, stored_turn(self.picture)):
            warn(doubt)
        here = calibration.in_picture(size)
        with VisionLanguageModel(scene, model_of(self.vlm, around), calibration=here) as model:
            reading = model.read(picture)
        if reading.unanswered:
            raise EndpointError(f"{reading.problem}; then call look again")
        with named_disk_errors(folder):
            folder.mkdir(exist_ok=True)
            reading.save(folder, stem)
        error, sd = reading.error_seen, reading.sd
        if error is None or sd is None:
            raise _refused(f"{reading.problem}; look at {drawn} and tell what you see yourself")
        behind = doubts.behind(here, reading.reached, self.reached_size, "model")
        sd = np.maximum(sd, here.sd_off(np.maximum(reading.reached.off, behind)))
        for sighting, name in ((reading.reached, "reached"), (reading.goal, "goal")):
            if sighting is not None:
                for doubt in doubts.of_sighting(here, sighting, f"say --no-{name}-round"):
                    warn(doubt)
        for doubt in doubts.of_slant(here, self.reached, self.reached_size, behind):
            warn(doubt)
        if reading.scale != 1:
            warn(
                f"both objects look {reading.scale:.2f} times as large as they are: is the picture "
                "cut, does the server shrink pictures (then set max_image_side), are the sizes "
                "right?"
            )
        if goal is not None and reading.reached.place is not None:
            error = reading.reached.place - goal
            sd = np.maximum(sd, here.sd_off(self._beside_goal(here, reading, goal, drawn)))
        print(f"seen: {to_words(error)}   boxes: {drawn}")
        # In words with their unit, which each workspace reads in its outcomes' units and order.
        told = ", ".join(
            f"{100 * abs(e):.2f}+-{100 * s:.2f} cm {positive if e >= 0 else negative}"
            for e, s, (positive, negative) in zip(error, sd, WORDS[:2], strict=True)
        )
        of, right = (
            f"{shlex.quote(str(folder.parent))} {self.trial}",
            "if that and the boxes are right",
        )
        if goal is None:
            of, right = "FOLDER TRIAL", f"{right}, and outcomes are x and y"
        print(f'{right}: prior-reinforce {verb} {of} --error "{told}"')

    def _beside_goal(
        self, here: TableCalibration, reading: PictureReading, goal: Point, drawn: Path
    ) -> Float[np.ndarray, "2"]:
        """How far beside the goal its object is seen, in [m]; far is refused, less warned of."""
        assert reading.goal is not None
        assert reading.goal.place is not None
        assert reading.goal_place is not None
        beside = reading.goal_place - goal
        moved = float(np.linalg.norm(beside))
        says = f"{self.goal} is seen {100 * moved:.1f} cm from the goal that is set; "
        # What this look wrote is there already; said again with each trial it would not be read.
        first = not [*drawn.parent.glob("*-seen.json")][1:]
        (u, v), (tall, wide) = here.to_pixels(reading.goal.place), reading.picture.shape[:2]
        flips = {"turned by half a turn": (wide - u, tall - v), "mirrored": (wide - u, v)}
        offset = reading.goal_place - reading.goal.place - goal
        offs = {
            how: float(np.linalg.norm(here.to_table(np.array(at)) + offset))
            for how, at in flips.items()
        }
        how = min(offs, key=offs.__getitem__)
        off = offs[how]
        if first and off <= _SAME_GOAL >= moved:
            alike = " or ".join(how for how in offs if offs[how] <= _SAME_GOAL)
            warn(
                f"in the picture {alike}, {self.goal} would be seen at the goal as well: look once "
                f"whether the picture in {drawn} is turned as that of the calibration"
            )
        if moved > _OTHER_GOAL and off <= min(max(_SAME_GOAL, 3 * here.sd), moved / 3):
            raise _refused(
                f"{says}in the picture {how} it would be seen {100 * off:.1f} cm from it: is the "
                "photograph as the camera took it when it was calibrated?"
            )
        if moved > max(_OTHER_GOAL, 3 * here.sd):
            raise _refused(
                f"{says}is this the picture (whole), the calibration and the model family that you "
                f"think? look at {drawn}"
            )
        if moved > _SAME_GOAL:
            warn(f"{says}check the calibration, or move it there")
        return beside

    def _of_trial(self) -> tuple[Point | None, Path, str, str]:
        """The goal (x, y) [m] of the trial, where to keep what is seen, its name, and the verb."""
        if self.workspace is None and self.trial is None:
            return None, self.picture.parent, f"{self.picture.stem}-seen", "tell"
        from prior_reinforce.arm.workspace.manifest import workspace_around
        from prior_reinforce.arm.workspace.text import tell_example
        from prior_reinforce.arm.workspace.workspace import Workspace

        folder = self.workspace or workspace_around(Path())
        if folder is None or self.trial is None:
            raise ConfigurationError("--workspace and --trial say together which trial it was")
        with Workspace(folder) as workspace:
            state, form = workspace.state, workspace.manifest.outcome_format
            axes, metres = axes_of(form), [factor(unit, "m") for unit in form.as_listed().units]
            if sorted(axes) != [0, 1] or None in metres:
                raise ConfigurationError(
                    f"a photograph from above shows x and y, but outcomes are {form}; look at it "
                    f"yourself, and tell {tell_example(workspace.manifest)}"
                )
            trial = state.trial(self.trial)
            goal = state.goal_of(trial).goal * np.array(metres, float)
            verb = "tell" if trial.open else "amend"
        return goal[np.argsort(axes)], folder / "pictures", f"trial-{self.trial:03d}-seen", verb


def _refused(why: str) -> PerceptionFailedError:
    """What is raised after what was seen is kept."""
    error = PerceptionFailedError(why)
    error.changed = True
    return error


def _check_turn(picture: Path, pixels: Float[np.ndarray, "n 2"], size: tuple[int, int]) -> None:
    """Refuse points, or warn of them, that may be clicked in a picture as it is stored, turned."""
    from prior_reinforce.perception.pictures import stored_turn

    turn = stored_turn(picture)
    upright, stored = (
        bool(np.all((pixels >= 0) & (pixels <= sides)))
        for sides in (size, size[::-1] if turn > 4 else size)
    )
    if turn == 1 or not stored:
        return
    says = f"{picture} is stored turned (EXIF orientation {turn})"
    if not upright:
        raise ConfigurationError(
            f"{says}, and u and v were clicked in it as it is stored, but it is read upright, "
            f"{size[0]} x {size[1]} px; save it upright as a PNG, click there, and give that"
        )
    warn(f"{says}; u and v must be clicked in it upright, as most viewers show it")


def _check_camera(
    calibration: TableCalibration, height: float, camera: tuple[float, float, float]
) -> None:
    """Warn of a camera that hangs elsewhere than the known points' perspective says."""
    from prior_reinforce.perception.doubts import COARSE
    from prior_reinforce.perception.viewpoint import camera_costs, possible_places

    if looks_like("m", float(np.abs(camera).max())):
        warn(f"a camera {max(map(abs, camera)):g} m away? measure --camera in metres")
    cost = camera_costs(calibration, height, np.array(camera))
    if cost > COARSE >= calibration.sd:  # coarse points tell of no camera
        first, last = possible_places(calibration)[[0, -1]]
        ends = " and ".join(
            " ".join(f"{round(c, 2) + 0:.2f}" for c in place) for place in (first, last)
        )
        warn(
            f"--camera {' '.join(f'{c:g}' for c in camera)} does not fit how the points are seen: "
            f"that is from between {ends}, which differs by {100 * cost:.1f} cm or more at "
            f"{height:g} m; measure it from the table's frame (a picture that is cut tells wrongly)"
        )


def _photograph(camera: str, path: Path) -> None:
    """Take a picture with a camera of this computer, by OpenCV, and keep it as a JPEG or PNG."""
    check_installed("cv2")
    import cv2

    if path.exists() or path.suffix.lower() not in (".jpg", ".jpeg", ".png"):
        raise FileFormatError(
            f"{path} is there already, or does not end in .jpg or .png; choose another name"
        )
    capture, frame = cv2.VideoCapture(int(camera) if camera.isdecimal() else camera), None
    for _ in range(_EXPOSURE):
        ok, seen = capture.read()
        frame = seen if ok else frame
    capture.release()
    if frame is None:
        raise PerceptionFailedError(
            f"camera {camera} gives no picture; is it plugged in, and does no other program use it?"
        )
    with named_disk_errors(path.parent):
        write(path, cv2.imencode(path.suffix, frame)[1].tobytes())


def _read_points(
    path: Path,
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"], float | None]:
    """Rows of x, y [m] (a head may say `x [cm]`) and u, v [px], and the height in a column z [m].

    Rows without any are skipped.
    """
    from prior_reinforce.arm.recordings.tables import read_table
    from prior_reinforce.arm.recordings.units import split_unit

    table = read_table(path, head=_COLUMNS)
    heads = [_IN_PIXELS.sub(r"\1 [px]", name.strip()) for name in table.names]
    split = [split_unit(_ROUND.sub(r" [\1]", name), any_word=True) for name in heads]
    names = [name.lower() for name, _ in split]
    if not {"width", "w"} & {*names}:  # beside it, a height is the picture's
        names = [_HEIGHTS.get(name, name) for name in names]
    if missing := {*_COLUMNS} - {*names}:
        raise FileFormatError(
            f"{path} has no column {min(missing)}; expected a CSV (save a spreadsheet as one) with "
            f"the columns {', '.join(_COLUMNS)} (or with a unit: x [mm]) and a number in each"
        )
    columns = [*_COLUMNS, *({"z"} & {*names})]
    if twice := [name for name in columns if names.count(name) > 1]:
        raise FileFormatError(f"{path} has several columns {twice[0]}; keep that of this camera")
    at = [names.index(name) for name in columns]
    units = [table.units[c] or split[c][1] for c in at]
    scale = [
        (1.0 if unit in (None, "px") else None) if name in "uv" else factor(unit or "m", "m")
        for name, unit in zip(columns, units, strict=True)
    ]
    for name, unit, known in zip(columns, units, scale, strict=True):
        if known is None:
            wanted = "px, from the picture's top left corner" if name in "uv" else "m, cm, mm or in"
            raise FileFormatError(
                f"{path}: {name} is in {unit}; give it in {wanted}, and say so in the head: "
                f"{name} [{wanted.split(',')[0]}]"
            )
    rows = table.rows([i for i in range(len(table)) if any(table.cells[c][i] for c in at)])
    points = rows.columns(at) * np.array(scale, float)
    heights = points[:, 4:][np.isfinite(points[:, 4:])]
    if not len(heights):
        return points[:, :2], points[:, 2:4], None
    if np.ptp(heights) > _LEVEL:
        raise FileFormatError(
            f"{path}: points are {heights.min():g} to {heights.max():g} m high, but a calibration "
            "is of one plane; give those of one height"
        )
    return points[:, :2], points[:, 2:4], float(np.median(heights))
