"""A bird's-eye picture of a trial's key frame, drawn by MuJoCo without a display.

The paper photographs the key frame from above (Section V-A, Perception Process); here the camera is
the scene's own `birdseye`. Pixel coordinates are those of `calibration`.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point
from prior_reinforce.environment import KeyFrame, Picture, make_renderer
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.settings import Checked, Count

GOAL_BODY = "goal"
"""Mocap body that is the goal's object in every scene (see `rollouts.KeyFrame`)."""

# Calibration marks are bright discs of 1 cm radius (ours): large enough for a centroid finer than
# a tenth of a pixel, small enough that perspective does not shift it (below 0.1 mm at 1 m).
_MARK_SIZE = np.array([0.01, 0.01, 1e-4])  # a radius twice, and half its thickness, in [m]


@dataclass(frozen=True)
class CameraConfig(Checked):
    """Which camera of the scene, and how finely it sees."""

    name: str = "birdseye"
    """Camera of the scene."""
    width: Count = 896
    """Picture width, in [px]. Over the 1.3 m that our scenes show, a pixel is 1.4 mm (ours)."""
    height: Count = 896
    """Picture height, in [px]. Square, as the scale of 0-1000 in which most models answer is
    coarser along a longer side; 896 is a multiple of the 28 and 32 px of their image patches."""


class Camera:
    """Draws key frames of one scene after another; keeps the renderer of the latest scene."""

    def __init__(self, config: CameraConfig | None = None) -> None:
        self.config = config or CameraConfig()
        self._source: mujoco.MjModel | None = None
        self._renderer: mujoco.Renderer | None = None

    def picture(self, key_frame: KeyFrame, goal: Point) -> Picture:
        """Draw a key frame with the goal's object at the goal.

        Args:
            key_frame: What to draw; not changed.
            goal: True goal, k <= 3, in [m]; the components it leaves out are zero, so that a goal
                (x, y) puts the body's origin on the table.

        Raises:
            RenderingUnavailableError: There is no OpenGL on this machine.
            ConfigurationError: The scene has no such camera, or no mocap body `goal`.
        """
        renderer = self._renderer_for(key_frame.model)
        model = renderer.model
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, GOAL_BODY)
        mocap = model.body_mocapid[body] if body >= 0 else -1
        if mocap < 0:
            raise ConfigurationError(
                f"the scene has no mocap body '{GOAL_BODY}' to put at the goal; add "
                f'<body name="{GOAL_BODY}" mocap="true"> with the goal\'s object'
            )
        data = mujoco.MjData(model)
        data.qpos[:] = key_frame.state
        data.mocap_pos[mocap] = np.pad(goal, (0, 3 - len(goal)))
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera=self.config.name)
        picture: Picture = renderer.render()
        return picture

    def find_marks(
        self, model: mujoco.MjModel, points: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "n 2"]:
        """Lay a bright mark on each point in turn and find its centre in the picture.

        Everything else is out of the scene meanwhile, as an arm is out of the way when a lab
        calibrates. This looks at drawn pixels only and knows nothing of the camera's geometry.

        Args:
            model: The scene; not changed.
            points: Where the marks lie, table frame, in [m].

        Returns:
            Centres of the marks, in [px].

        Raises:
            ConfigurationError: A mark is outside the picture or cut by its edge.
            RenderingUnavailableError: There is no OpenGL on this machine.
        """
        renderer = self._renderer_for(model)
        data = mujoco.MjData(renderer.model)
        mujoco.mj_forward(renderer.model, data)
        renderer.update_scene(data, camera=self.config.name)
        scene, shadow = renderer.scene, mujoco.mjtRndFlag.mjRND_SHADOW
        scene.flags[shadow] = 0  # no mark has anything to throw one on: a third of the time
        pictures = []
        for marks in (points[:0], *points[:, None]):
            scene.ngeom = 0
            for mark in marks:
                _add_mark(scene, mark)
            pictures.append(renderer.render().astype(np.int16))
        scene.flags[shadow] = 1
        empty, *marked = pictures
        centres = []
        for point, picture in zip(points, marked, strict=True):
            brightness = np.abs(picture - empty).sum(axis=2)
            inside = brightness[1:-1, 1:-1].sum()
            if not inside or inside < brightness.sum():
                raise ConfigurationError(
                    f"the mark at {point.tolist()} m is not wholly in the picture of camera "
                    f"'{self.config.name}'; choose a point nearer to the table's middle"
                )
            middles = [np.arange(size) + 0.5 for size in brightness.shape[::-1]]
            x, y = (brightness.sum(axis=axis) @ middles[axis] for axis in (0, 1))
            centres.append(np.array([x, y]) / brightness.sum())
        return np.array(centres)

    def calibrate(
        self, model: mujoco.MjModel, table_points: ArrayLike, *, height: float
    ) -> TableCalibration:
        """Calibrate the camera on marks laid at known points of a plane parallel to the table.

        The points, table frame, have shape (n, 2), n >= 4; they and the plane's height above the
        table are in [m]. The scene is not changed.
        """
        points = np.asarray(table_points, dtype=float)
        heights = np.full((len(points), 1), height)
        pixels = self.find_marks(model, np.hstack([points, heights]))
        size = self.config.width, self.config.height
        return TableCalibration.fit(points, pixels, height=height, picture=size)

    def close(self) -> None:
        """Free the graphics memory; the next picture takes it again."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = self._source = None

    def _renderer_for(self, model: mujoco.MjModel) -> mujoco.Renderer:
        if self._renderer is not None and self._source is model:
            return self._renderer
        self.close()
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, self.config.name) < 0:
            raise ConfigurationError(
                f"the scene has no camera '{self.config.name}'; its cameras are "
                f"{', '.join(model.cam(i).name for i in range(model.ncam)) or 'none'}"
            )
        self._renderer = make_renderer(model, self.config.width, self.config.height)
        self._source = model
        return self._renderer


def _add_mark(scene: mujoco.MjvScene, point: Float[np.ndarray, "3"]) -> None:
    mark, white = scene.geoms[scene.ngeom], np.ones(4, dtype=np.float32)
    disc, upright = mujoco.mjtGeom.mjGEOM_CYLINDER, np.eye(3).ravel()
    mujoco.mjv_initGeom(mark, disc, _MARK_SIZE, point, upright, white)
    mark.emission = 1.0
    scene.ngeom += 1
