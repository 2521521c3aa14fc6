import os
import subprocess
import sys
from ctypes.util import find_library

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.simulation.tasks import TASKS, make_task


def test_a_choice_sets_the_hardware():
    for name in ("basketball-v1", "basketball-v2", "basketball-v3"):
        task = make_task(name)
        assert task.name == name
        assert TASKS.name_of(task) == name


@pytest.mark.parametrize("name", ["darts", "basketball"])
def test_an_unknown_task_is_named(name):
    with pytest.raises(ConfigurationError, match=f"no task '{name}'; known are basketball-v1, "):
        make_task(name)


@pytest.mark.parametrize("backend", ["garbage", "osmesa"])
def test_an_opengl_that_is_not_there_is_named_with_what_to_install(backend):
    if backend == "osmesa" and find_library("OSMesa"):
        pytest.skip("it is installed")
    program = "from prior_reinforce.simulation.tasks import make_task; make_task('basketball-v1')"
    env = os.environ | {"MUJOCO_GL": backend}
    env.pop("PYOPENGL_PLATFORM", None)  # what MuJoCo set here
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=env)
    assert f"RenderingUnavailableError: MuJoCo cannot be loaded with MUJOCO_GL={backend}" in (
        done.stderr
    )
    assert "libosmesa6" in done.stderr
