"""Which trials are shown, and how close up."""

import numpy as np
import pytest

from prior_reinforce.simulation.tasks import make_task
from reproduction.recipes.key_frames import _close_up, _said, _shown


class Straight:
    """A picture of 448 x 448 pixels of the table, 0.5 m to 1.5 m ahead."""

    def to_pixels(self, points):
        return 448 * (np.asarray(points) - [0.5, -0.5])


@pytest.mark.parametrize(("n", "shown"), [(1, [0]), (4, [0, 1, 2, 3]), (9, [0, 1, 2, 8])])
def test_of_many_trials_the_first_three_and_the_last_are_shown(n, shown):
    assert _shown([None] * n) == shown


def test_the_close_up_holds_all_that_matters_and_stays_in_the_picture():
    scene = make_task("basketball-v1").scene
    trials = [{"error_seen": [0.1, 0.0], "outcome": [1.48, 0.2]}]
    row = {"goal": [1.4, 0.1], "trials": trials}
    low, high = _close_up(row, scene, Straight())
    for place in ([1.4, 0.1], [1.48, 0.2], [1.5, 0.1]):
        assert np.all(low <= Straight().to_pixels(place))
        assert np.all(Straight().to_pixels(place) <= high)
    assert np.all(low >= 0)
    assert np.all(high <= 448 + 1e-9)
    assert np.ptp([low, high], axis=0) == pytest.approx(high[0] - low[0])


def test_what_is_said_over_a_trial():
    miss = {"hit": False, "error_seen": [0.02, 0.0]}
    assert _said(miss, last=False) == "2 cm long"
    assert _said(miss, last=True) == "not reached"
    assert _said({"hit": False, "error_seen": [0.0, 0.0]}, last=False) == "just missed"
    assert _said({"hit": True, "error_seen": [0.0, 0.0]}, last=True) == "HIT"
