"""Pictures of a scene, with one clear error where the machine cannot draw."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from prior_reinforce.errors import RenderingUnavailableError

if TYPE_CHECKING:
    import mujoco

Picture = UInt8[np.ndarray, "_height _width 3"]
"""RGB, row by row from the top."""


def make_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Make a renderer of `width` x `height` pixels; its `close` frees the graphics memory.

    Args:
        model: The scene; not changed.
        width: In [px].
        height: In [px].

    Raises:
        RenderingUnavailableError: There is no OpenGL on this machine.
    """
    import mujoco

    # The frame buffer's size is part of the model, and the model is shared: draw a copy.
    drawn = copy.copy(model)
    screen = drawn.vis.global_
    screen.offwidth = max(screen.offwidth, width)
    screen.offheight = max(screen.offheight, height)
    try:
        return mujoco.Renderer(drawn, height, width)
    except Exception as error:  # each OpenGL backend fails with exceptions of its own
        raise RenderingUnavailableError(
            f"no picture can be drawn, OpenGL is not available ({error}); on a machine without a "
            "display set MUJOCO_GL=egl and install libegl1 (or MUJOCO_GL=osmesa and libosmesa6)"
        ) from error


@contextmanager
def open_renderer(model: mujoco.MjModel, width: int, height: int) -> Iterator[mujoco.Renderer]:
    """A renderer for the length of a block; arguments and errors as in `make_renderer`."""
    renderer = make_renderer(model, width, height)
    try:
        yield renderer
    finally:
        renderer.close()
