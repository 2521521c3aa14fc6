"""A file's own frame rate is found by its name, and two that differ are refused."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.rates import declared_rate
from prior_reinforce.errors import FileFormatError


def test_of_two_declared_rates_the_given_one_is_taken():
    both = {"dt": 0.02, "fps": 30}
    assert declared_rate("a", both, given=30.0) == (30, "fps")
    assert declared_rate("a", both, given=50.0).name == "dt"


@pytest.mark.parametrize(
    ("said", "rate"),
    [({"fps": 50}, 50), ({"dt_ms": 20, "Frame Rate": 50}, 50), ({"control_freq": 20}, 20),
     ({"sampling_frequency": 125, "mass": 3}, 125), ({"time_step": 0.02}, 50), ({"hz": 30}, 30)],
)  # fmt: skip
def test_rates_that_files_declare(said, rate):
    assert declared_rate("a", said) == (pytest.approx(rate), next(iter(said)))


def test_declared_rates_that_contradict_each_other_or_are_none():
    with pytest.raises(FileFormatError, match="dt says 50 frames a second, but fps 30; take one"):
        declared_rate("a", {"dt": 0.02, "fps": 30})
    assert declared_rate("a", {"mass": 3.0, "generate": 1, "update": 2}) is None


@pytest.mark.parametrize(
    ("stated", "given", "rate"),
    [
        ({"meta.fps": 50}, None, (50, "fps")),
        ({"meta.frame_rate": 50}, None, (50, "frame_rate")),
        ({"meta.timing.dt_ms": 20.0}, None, (50.0, "dt_ms")),
        ({"sample_time_ms": 20.0}, None, (50.0, "sample_time_ms")),
        ({"fps": 50, "cycle_time": 0.002}, None, (50, "fps")),
        ({"meta.fps": 50, "rate": np.array(50.0)}, None, (50.0, "rate")),
        ({"meta.fps": 50, "meta.camera.fps": 30}, None, (50, "fps")),
        ({"meta.fps": 50, "meta.robot.hz": 100}, 50.0, (50, "fps")),
        ({"meta.version": 2}, None, None),
    ],
)
def test_a_rate_deep_in_what_a_file_says_is_its_rate(stated, given, rate):
    assert declared_rate("a.npz", stated, given) == rate


def test_two_rates_that_contradict_each_other_are_refused():
    stated = {"meta.fps": 50, "meta.robot.dt": 0.01}
    with pytest.raises(
        FileFormatError, match=r"meta\.fps says 50 .*, but meta\.robot\.dt 100; .*-r"
    ):
        declared_rate("a.npz", stated)
    with pytest.raises(FileFormatError, match=r"rate says 20 .*, but meta\.fps 50"):
        declared_rate("a.npz", {"rate": np.array(20), "meta.fps": 50})
