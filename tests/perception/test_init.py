import subprocess
import sys

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.colour_camera import ColourCamera
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.readings import Reading
from prior_reinforce.registry import Member
from tests.perception.slanted_table import SCENE


class Closing(Perception):
    """Your own, which takes the scene and counts how often it was closed."""

    closed = 0

    def __init__(self, scene=None):
        self.scene = scene

    def perceive(self, rollout, goal, rng):
        return Reading.measured(rollout.outcome - goal)

    def close(self):
        self.closed += 1


def test_settings_in_the_choice_come_on_top_of_the_config():
    config = VisionLanguageModelConfig(family="qwen3-vl", votes=5)
    with make_perception("camera,votes=1", scene=SCENE, config=config) as perception:
        assert isinstance(perception, ColourCamera)
        assert (perception.config.family, perception.config.votes) == ("qwen3-vl", 1)
    assert make_perception("amplified,noise_sd=0.02").noise_sd == 0.02


def test_your_own_gets_what_it_takes_and_is_closed(monkeypatch):
    monkeypatch.setitem(PERCEPTIONS.members, "closing", Member(Closing, "a test's own"))
    with make_perception("closing", scene=SCENE, seed=3) as perception:
        assert perception.scene is SCENE
    assert perception.closed == 1


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("eyes", "no perception 'eyes'; known are exact, eye, amplified, camera, vlm"),
        ("camera", "give the task a `scene`"),
        ("vlm", "give the task a `scene`"),
        ("camera,votes=0", "Expected `int` >= 1"),
        ("amplified,loudness=3", "no setting 'loudness'"),
    ],
)
def test_what_cannot_be_made_is_named(choice, message):
    with pytest.raises(ConfigurationError, match=message):
        make_perception(choice)


@pytest.mark.slow
def test_names_of_members_load_none_of_them():
    code = (
        "import sys\n"
        "from prior_reinforce.adapters import ADAPTERS\n"
        "from prior_reinforce.perception import PERCEPTIONS\n"
        "from prior_reinforce.simulation.tasks import TASKS\n"
        "print(ADAPTERS.help, PERCEPTIONS.help, TASKS.help)\n"
        "heavy = {'torch', 'mujoco', 'openai', 'scipy', 'numpy', 'joblib', 'PIL', 'msgspec'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
