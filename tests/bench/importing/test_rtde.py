"""Rows of two cycles are found; logs of other recorders are left alone."""

import numpy as np

from prior_reinforce.bench.importing.rtde import mixed_rows


def test_a_row_with_the_positions_of_the_next_cycle_is_found_where_rows_are_repeated():
    t = np.arange(40) * 0.002
    q = np.sin(5 * t)[:, None]
    assert not np.any(mixed_rows(t, q))
    q[10] = q[11]
    assert not np.any(mixed_rows(t, q))  # no row comes twice: another recorder
    t, q = np.insert(t, 30, t[30]), np.insert(q, 30, q[30], axis=0)
    np.testing.assert_array_equal(np.flatnonzero(mixed_rows(t, q)), [10])
