"""What a person can say of a trial, and what cannot be understood."""

import numpy as np
import pytest

from tests.workspace.planar import events_in, trials_in


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        (("--error", "0.05", "-0.02"), [0.05, -0.02]),
        (("--error", "-0.05", "-0.02"), [-0.05, -0.02]),
        (("--error=-0.05 0.02",), [-0.05, 0.02]),
        (("--error", "-.05,0.02"), [-0.05, 0.02]),
        (("--error", "-1e-2", "0"), [-0.01, 0.0]),
        (("--error", "5cm short and 2 cm right"), [-0.05, -0.02]),
        (("--error", "120cm long"), [1.2, 0.0]),
        (("--error", "hit"), [0.0, 0.0]),
        (("--error", "0"), [0.0, 0.0]),
        (("--outcome", "0.9", "-0.1"), [0.0, -0.15]),
        (("--hit",), [0.0, 0.0]),
        (("--error", "2cm long", "--hit"), [0.02, 0.0]),
    ],
)
def test_an_error_can_be_told_in_many_ways(run, folder, said, seen):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    assert run("tell", folder, 1, *said)[0] == 0
    (trial,) = trials_in(folder)
    np.testing.assert_allclose(trial.error_seen, seen, atol=1e-12)
    assert trial.hit == (np.linalg.norm(seen) <= 0.015 or "--hit" in said)


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ((), "--error or --outcome"),
        (("--error", "5", "-2"), "looks like centimetres"),
        (("--outcome", "92", "10"), "looks like centimetres"),
        (("--error", "0.05"), "needs 2 numbers"),
        (("--error", "nan", "0"), "void the trial"),
        (("--error", "0.05 long"), "say m, cm or mm"),
        (("--error", "5cm far"), "write a length and one of long, short"),
        (("--error", "50m long"), "say it again, in cm"),
        (("--error", "0.05", "0", "--outcome", "0.9", "0"), "--error or --outcome"),
        (("--outcome", "0.9"), "needs 2 numbers"),
        (("--hit", "--miss"), "--hit alone"),
    ],
)
def test_what_cannot_be_told_is_one_line_and_changes_nothing(run, folder, said, remedy):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    before = events_in(folder)
    status, out, err = run("tell", folder, 1, *said)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert events_in(folder) == before
