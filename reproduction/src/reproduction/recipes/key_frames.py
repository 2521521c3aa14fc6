"""The picture of the process: key frames from above, the error seen drawn on each as an arrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

from prior_reinforce.environment import KeyFrame, Picture, TableScene, Task
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.report.style import GOAL, HIT, INK, drawing, new_figure, save_figure
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.wording import to_words

if TYPE_CHECKING:
    import mujoco

    from prior_reinforce.perception.camera import Camera

Row = Mapping[str, Any]
"""A goal: `task`, `goal`, `demonstrated` and its `trials`, each with `error_seen`, `outcome`, `hit`
and the positions of the scene at the key frame, `key_state`."""
_Corners = Float[np.ndarray, "2 2"]

_PIXELS = 1344
"""Side of a picture as it is taken, in [px]: finer than a model's, to be looked at close up."""
_SIDE = 448.0
"""Side of a picture as it is drawn, in its own unit: the pixels of the calibration's camera."""
_LEAST_HALF = 0.09
"""Least half side of a close-up, in [m] (ours): shows a stone, a hoop and some table."""
_MARGIN = 0.07
"""Table shown beyond all that matters, in [m]."""
_MOST_TRIALS = 4
"""Trials shown; of more, the first three and the last."""
_INCHES = 2.6  # of one panel
_EXTENT = (0, _SIDE, _SIDE, 0)
_ARROW: Any = {
    "arrowstyle": "-|>", "mutation_scale": 14, "shrinkA": 0, "shrinkB": 0, "linewidth": 2.0,
    "color": "black",
}  # fmt: skip
_HALO = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 2.0}


@drawing()
def draw_process(rows: Mapping[str, Row], path: Path) -> Path:
    """Draw one row a task, by title: the table, then its trials close up.

    Raises:
        RenderingUnavailableError: There is no OpenGL on this machine.
    """
    from prior_reinforce.perception.camera import Camera, CameraConfig

    n_columns = 1 + max(min(len(row["trials"]), _MOST_TRIALS) for row in rows.values())
    figure = new_figure(_INCHES * n_columns, (_INCHES + 0.42) * len(rows))
    grid = figure.subplots(len(rows), n_columns, squeeze=False)
    fine = Camera(CameraConfig(width=_PIXELS, height=_PIXELS))
    coarse = Camera(CameraConfig(width=int(_SIDE), height=int(_SIDE)))
    for line, (title, row) in zip(grid, rows.items(), strict=True):
        for axes in line:
            axes.set_axis_off()
        line[0].set_title(title, loc="left", fontsize=12, color=INK)
        _draw_row(line, row, fine, coarse)
    fine.close()
    coarse.close()
    return save_figure(figure, path)


def _draw_row(line: Sequence[Axes], row: Row, fine: Camera, coarse: Camera) -> None:
    task, goal = make_task(row["task"]), row["goal"]
    model, scene = _scene_model(task), task.scene
    assert scene is not None
    calibration = coarse.calibrate(model, np.array(scene.marks), height=scene.plane_height)
    close_up = _close_up(row, scene, calibration)
    for axes, i in zip(line[1:], _shown(row["trials"]), strict=False):
        picture = fine.picture(KeyFrame(model, row["trials"][i]["key_state"], 0.0), goal)
        if i == 0:
            _draw_table(line[0], row, picture, calibration, close_up)
        axes.imshow(picture, extent=_EXTENT)
        _draw_trial(axes, row, i, calibration, close_up)


def _scene_model(task: Task) -> mujoco.MjModel:
    """The scene as a camera sees it: of any rollout."""
    (rollout,) = task.rollout(task.demonstrations(task.demonstration_sets[0]).plans[:1], None)
    assert rollout.key_frame is not None
    return rollout.key_frame.model


def _shown(trials: Sequence[Any]) -> list[int]:
    n = len(trials)
    return list(range(n)) if n <= _MOST_TRIALS else [*range(_MOST_TRIALS - 1), n - 1]


def _close_up(row: Row, scene: TableScene, calibration: TableCalibration) -> _Corners:
    """Lower and upper corner of the square looked at, in units of the picture."""
    trials, goal = [row["trials"][i] for i in _shown(row["trials"])], np.array(row["goal"])
    seen = [goal + trial["error_seen"] for trial in trials]
    goal_object = goal - np.array(scene.goal_offset)
    places = np.array([goal, goal_object, *seen, *(trial["outcome"] for trial in trials)])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(_LEAST_HALF, float(np.ptp(places, axis=0).max()) / 2 + _MARGIN)
    corners = calibration.to_pixels(middle + half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]))
    centre = corners.mean(axis=0)
    side = np.ptp(corners, axis=0).max() / 2
    # Moved rather than cut where it would leave the picture.
    centre = np.clip(centre, min(side, _SIDE / 2), max(_SIDE - side, _SIDE / 2))
    return np.stack([centre - side, centre + side])


def _draw_table(
    axes: Axes, row: Row, picture: Picture, calibration: TableCalibration, close_up: _Corners
) -> None:
    axes.imshow(picture[::2, ::2], extent=_EXTENT)
    across, down = calibration.to_pixels(row["demonstrated"]).T
    axes.scatter(across, down, s=26, marker="s", color="white", edgecolors=INK, linewidths=0.8)
    _draw_goal(axes, calibration.to_pixels(row["goal"]))
    low, high = close_up
    axes.add_patch(Rectangle(tuple(low), *(high - low), fill=False, edgecolor=INK, linewidth=1.2))
    legend = "□ demonstrations   ★ goal"
    axes.text(0.03, 0.03, legend, transform=axes.transAxes, fontsize=8.5, color=INK, bbox=_HALO)


def _draw_trial(
    axes: Axes, row: Row, i: int, calibration: TableCalibration, close_up: _Corners
) -> None:
    trial, goal = row["trials"][i], row["goal"]
    (left, top), (right, bottom) = close_up
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    start = calibration.to_pixels(goal)
    _draw_goal(axes, start)
    if not trial["hit"] and np.any(trial["error_seen"]):
        end = calibration.to_pixels(goal + trial["error_seen"])
        axes.add_patch(FancyArrowPatch(tuple(start), tuple(end), **_ARROW))
    colour, width = (HIT, 5.0) if trial["hit"] else (INK, 1.2)
    said = _said(trial, last=i == len(row["trials"]) - 1)
    axes.set_title(f"trial {i + 1}: {said}", loc="left", fontsize=10, color=colour)
    frame: Any = {"fill": False, "edgecolor": colour, "linewidth": width}
    axes.add_patch(Rectangle((0, 0), 1, 1, transform=axes.transAxes, **frame))


def _said(trial: Mapping[str, Any], *, last: bool) -> str:
    if trial["hit"]:
        return "HIT"
    if last:
        return "not reached"
    return to_words(trial["error_seen"]) if np.any(trial["error_seen"]) else "just missed"


def _draw_goal(axes: Axes, pixel: Float[np.ndarray, " 2"]) -> None:
    axes.plot(*pixel, marker="*", markersize=9, color="#f0e442", markeredgecolor=GOAL, zorder=5)
