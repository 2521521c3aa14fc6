"""Trajectory messages: via points and the motion between them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.trajectories import read_trajectory
from prior_reinforce.errors import FileFormatError


def message(times, *derivatives):
    """Points with positions and what else is given of them, a polynomial a joint."""
    names = ("positions", "velocities", "accelerations")
    points = [
        SimpleNamespace(
            time_from_start=SimpleNamespace(sec=int(t), nanosec=round(t % 1 * 1e9)),
            **dict.fromkeys(names, ()) | {
                name: np.array([p(t) for p in of])
                for name, of in zip(names, derivatives, strict=False)
            },
        )
        for t in times
    ]  # fmt: skip
    return SimpleNamespace(points=points, joint_names=["a", "b"])


def read(told):
    return read_trajectory(Path("plan.mcap"), "plan", told, ReadOptions())


POLYNOMIALS = {
    3: [np.poly1d([0.4, -1.0, 0.2, 0.3]), np.poly1d([-0.2, 0.5, 0.1])],
    5: [np.poly1d([0.3, -0.5, 0.4, -1.0, 0.2, 0.3]), np.poly1d([-0.2, 0.5, 0.1])],
}


@pytest.mark.parametrize("degree", [3, 5])
def test_between_via_points_is_the_motion_that_their_derivatives_state(degree):
    of = POLYNOMIALS[degree]
    derivatives = [[p.deriv(m) for p in of] for m in range((degree + 1) // 2)]
    recording = read(message([0.0, 0.3, 0.8, 1.2], *derivatives))
    assert len(recording.times) == 121
    expected = np.column_stack([p(recording.times) for p in of])
    np.testing.assert_allclose(recording.positions, expected, atol=1e-9)
    assert recording.remarks[0].startswith("4 via points joined by")


def test_points_of_a_controllers_rate_and_points_without_velocities_are_the_frames():
    of = POLYNOMIALS[3]
    velocities = [p.deriv() for p in of]
    close, bare = np.arange(0, 1, 0.01), [0.0, 0.5, 1.0]
    assert len(read(message(close, of, velocities)).times) == 100
    assert len(read(message(bare, of)).times) == 3
    nothing = [lambda t: np.nan] * 2
    assert len(read(message(bare, of, nothing)).times) == 3
    even = read(message([0.0, 0.03, 0.07], of, velocities)).times
    np.testing.assert_allclose(np.diff(even), 0.01)


def test_a_trajectory_that_lasts_for_ever_is_refused():
    of = POLYNOMIALS[3]
    with pytest.raises(FileFormatError, match="plan"):
        read(message([0.0, 1e9], of, [p.deriv() for p in of]))
