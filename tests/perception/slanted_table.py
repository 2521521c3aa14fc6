"""A small table to photograph: an orange ball and a red ring, 10 cm up, under a slanted camera."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np

from prior_reinforce.environment import SeenObject, TableScene

RIM_HEIGHT = 0.10
SCENE = TableScene(
    SeenObject("the orange ball", 0.06), SeenObject("the red ring", 0.102), RIM_HEIGHT
)
BALL, GOAL = np.array([0.95, 0.20]), np.array([0.80, 0.08])

# A tilted camera, off the table's middle: the homography must do more than scale.
_SCENE = """
<mujoco>
  <visual><headlight ambient=".6 .6 .6" diffuse=".4 .4 .4" specular="0 0 0"/></visual>
  <worldbody>
    <camera name="birdseye" pos=".45 .15 2.1" xyaxes="-.06 -1 0 .975 -.06 .22" fovy="36"/>
    <geom name="table" type="box" pos=".85 0 -.015" size=".5 .5 .015" rgba=".8 .7 .56 1"/>
    <body name="ball"><freejoint/>
      <geom name="ball" type="sphere" size=".03" rgba=".96 .5 .1 1"/>
    </body>
    <body name="goal" mocap="true" pos="0 0 -50">{rim}</body>
  </worldbody>
</mujoco>
"""


def _rim(pieces: int = 24, radius: float = 0.048) -> str:
    angles = np.linspace(0, 2 * np.pi, pieces + 1)
    corners = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return "".join(
        f'<geom type="capsule" size=".003" rgba=".86 .12 .1 1" '
        f'fromto="{a[0]} {a[1]} {RIM_HEIGHT} {b[0]} {b[1]} {RIM_HEIGHT}"/>'
        for a, b in itertools.pairwise(corners)
    )


def slanted_table() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(_SCENE.format(rim=_rim()))
