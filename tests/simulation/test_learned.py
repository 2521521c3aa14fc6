"""A model of a simulated task is only used with what it was learned from."""

import json

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import make_generator
from prior_reinforce.simulation.learned import load_learned, save_learned
from prior_reinforce.simulation.tasks import make_task

TASK = make_task("basketball-v1")
DEMONSTRATIONS = TASK.demonstrations("A")


@pytest.fixture
def saved(tmp_path):
    generator = make_generator("interpolation").fit(DEMONSTRATIONS, seed=3)
    save_learned(tmp_path, generator, DEMONSTRATIONS, seed=3)
    return tmp_path, generator


@pytest.mark.slow
def test_a_model_comes_back_with_its_record(saved):
    folder, generator = saved
    goals = TASK.sample_goals(2, np.random.default_rng(0))
    loaded = load_learned(folder, DEMONSTRATIONS)
    np.testing.assert_array_equal(loaded.generate(goals), generator.generate(goals))
    record = json.loads((folder / "training.json").read_text())
    assert record == {"demonstrations_sha256": DEMONSTRATIONS.sha256, "seed": 3}


def test_a_model_of_other_demonstrations_is_refused(saved):
    with pytest.raises(ConfigurationError, match="learned from other demonstrations"):
        load_learned(saved[0], TASK.demonstrations("B"))


@pytest.mark.parametrize(
    "text", [None, b"{", b"[]", b'{"seed": 0}', b'{"demonstrations_sha256": "\xff"}']
)
def test_a_folder_without_a_readable_record_is_told_with_the_remedy(saved, text):
    record = saved[0] / "training.json"
    record.unlink() if text is None else record.write_bytes(text)
    with pytest.raises(FileFormatError, match=r"no learned model in .* prior-reinforce adapt"):
        load_learned(saved[0], DEMONSTRATIONS)
