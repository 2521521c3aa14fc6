"""Pictures larger than the scene's own buffer, and a machine that cannot draw."""

import mujoco
import numpy as np
import pytest

from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.rendering import make_renderer, open_renderer


@pytest.fixture
def scene():
    world = '<worldbody><geom type="sphere" size=".1" rgba="1 0 0 1"/></worldbody>'
    small = '<visual><global offwidth="64" offheight="48"/></visual>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{small}{world}</mujoco>")


def test_a_picture_has_the_size_asked_for_and_the_scene_stays_as_it_was(scene):
    data = mujoco.MjData(scene)
    mujoco.mj_forward(scene, data)
    with open_renderer(scene, 320, 200) as renderer:
        renderer.update_scene(data)
        picture = renderer.render()
    assert picture.shape == (200, 320, 3)
    red, green, _ = np.moveaxis(picture.astype(int), 2, 0)
    rows, columns = np.nonzero(red > green + 50)
    np.testing.assert_allclose([rows.mean(), columns.mean()], [99.5, 159.5], atol=1.0)
    assert (scene.vis.global_.offwidth, scene.vis.global_.offheight) == (64, 48)


def test_no_opengl_is_named_with_the_remedy(scene, monkeypatch):
    def fails(*_):
        raise ImportError("no such library")

    monkeypatch.setattr(mujoco, "Renderer", fails)
    with pytest.raises(RenderingUnavailableError, match=r"no such library.*MUJOCO_GL=egl"):
        make_renderer(scene, 64, 48)
