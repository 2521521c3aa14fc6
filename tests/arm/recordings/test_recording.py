"""An episode as it was recorded is checked once; readers share order and named damage."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings import Recording, read_recordings
from prior_reinforce.arm.recordings.recording import (
    files_at,
    has_files,
    named_damage,
    natural_order,
)
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from tests.arm.recordings.recorded import AFTER, BEFORE, duration, write_npz


def test_durations_are_those_written(tmp_path):
    for i, recording in enumerate(read_recordings(write_npz(tmp_path))):
        assert recording.duration == pytest.approx(BEFORE + duration(i) + AFTER)


def test_what_was_recorded_is_copied_and_starts_at_zero():
    times, positions = np.array([5.0, 5.1, 5.3]), np.arange(6.0).reshape(3, 2)
    recording = Recording("a", times, positions)
    times[:], positions[:] = 0, 0
    np.testing.assert_allclose(recording.times, [0, 0.1, 0.3])
    np.testing.assert_array_equal(recording.positions, [[0, 1], [2, 3], [4, 5]])
    assert (recording.names, recording.named) == (("column1", "column2"), False)
    assert Recording("a", [0, 1], positions[:2], ("x", "y")).named
    assert recording.period == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("times", "positions", "says"),
    [
        ([0, np.inf, 2], [[0]] * 3, "episode a: time is inf at frame 1"),
        ([0, 2, 1], [[0]] * 3, r"time does not increase at frame 2 \(2 s, then 1 s\)"),
        ([0, 2, 1], [[0]] * 3, "; sort frames"),
        (
            [0, 1, 1],
            [[0], [1], [2]],
            r"frame 2 \(1 s, then 1 s\); .*coarse.*-column none --rate HZ",
        ),
        ([0, 1], [[0]] * 3, r"times \(2,\) and positions \(3, 1\) for 1 channels"),
        ([0, 1], [["a"], ["b"]], "episode a must hold numbers"),
        ([0], [[0]], "T >= 2"),
    ],
)
def test_what_cannot_be_used_is_named_with_its_episode_and_frame(times, positions, says):
    with pytest.raises(InvalidDemonstrationsError, match=says):
        Recording("a", times, positions)


def test_times_that_fall_while_the_joints_go_on_are_wrong_and_no_order():
    q = np.linspace(0, 1, 40)[:, None]
    lacking = [float(f"1.{8_000_000 * i}") for i in range(40)]  # seconds, point, nanoseconds
    with pytest.raises(
        InvalidDemonstrationsError, match=r"frame 2 .*lack their zeros.* none --rate"
    ):
        Recording("a", lacking, q)
    order = np.random.default_rng(0).permutation(40)
    with pytest.raises(InvalidDemonstrationsError, match="; sort frames"):
        Recording("a", order / 100, q[order])


@pytest.mark.parametrize("count", [1, 6])
def test_zeros_before_a_driver_is_up_are_left_out_as_those_at_the_end(count):
    q = np.linspace([0.1, 0.2], [0.4, -0.3], 50)
    nothing = np.zeros((count, 2))
    recording = Recording("a", np.arange(50 + 2 * count), np.vstack([nothing, q, nothing]))
    np.testing.assert_array_equal(recording.positions, q)
    assert recording.times[0] == 0
    said = [f"{count} frames at the {end} left out, which are all 0" for end in ("start", "end")]
    assert [*recording.remarks] == said
    through = np.linspace([0.0, 0.0], [0.4, -0.3], 50)
    assert len(Recording("a", np.arange(51), np.vstack([nothing[:1], through])).times) == 51


def test_ten_follows_nine():
    assert sorted(["d10", "d9", "d", "c11"], key=natural_order) == ["c11", "d", "d9", "d10"]


def test_files_of_a_folder_without_its_outcomes(tmp_path):
    for name in ("b10.CSV", "b9.csv", "outcomes.csv", "c.txt"):
        (tmp_path / name).touch()
    assert [path.name for path in files_at(tmp_path, (".csv",))] == ["b9.csv", "b10.CSV"]
    assert has_files(tmp_path, (".txt",))
    assert not has_files(tmp_path, (".npz",))
    assert not has_files(tmp_path / "c.txt", (".csv",))


def test_damage_keeps_the_librarys_first_words_and_named_errors(tmp_path):
    words = r"as CSV \(KeyError: 'a'\); it is damaged"
    with pytest.raises(FileFormatError, match=words), named_damage(tmp_path, "CSV"):
        raise KeyError("a")
    with pytest.raises(InvalidDemonstrationsError), named_damage(tmp_path, "CSV"):
        raise InvalidDemonstrationsError("named already")


def test_frames_that_were_recorded_twice_count_once_and_others_at_one_time_are_an_error():
    times = [0, 0.1, 0.1, 0.1, 0.2]
    recording = Recording("a", times, [[0], [1], [1], [1], [2]])
    np.testing.assert_allclose(recording.times, [0, 0.1, 0.2])
    assert recording.remarks == ("2 frames were recorded twice; once is kept",)
    with pytest.raises(InvalidDemonstrationsError, match="time does not increase at frame 2"):
        Recording("a", times, [[0], [1], [3], [3], [2]])


def test_units_in_the_names_are_taken_out_of_them():
    recording = Recording("a", [0, 1], np.zeros((2, 3)), ("x_cm", "q0 [deg]", "grip"))
    assert recording.names == ("x", "q0", "grip")
    assert recording.units == ("cm", "deg", None)
    both = Recording("a", [0, 1], np.zeros((2, 2)), ("x_cm", "x_mm"))
    assert both.names == ("x_cm", "x_mm")


def test_frames_in_columns_are_refused_as_such():
    """As MATLAB's arrays lie in its HDF5."""
    with pytest.raises(InvalidDemonstrationsError, match="6 frames of 180 numbers each"):
        Recording("a", np.arange(6.0), np.ones((6, 180)))
