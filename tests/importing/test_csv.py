"""CSV files come back as the motions that were written, and say what is wrong with them."""

import numpy as np
import pytest

from prior_reinforce.errors import FileFormatError, PriorReinforceError
from prior_reinforce.importing import import_demonstrations, read_recordings
from tests.importing.recorded import AS_IS, check_motions, write_csv, write_outcomes


def test_csv(tmp_path):
    write_outcomes(write_csv(tmp_path))
    check_motions(import_demonstrations(tmp_path, preprocessing=AS_IS), 100, tolerance=0)


def test_csv_with_a_column_of_episodes_and_text_beside(tmp_path):
    lines = ["episode,time,joint2,phase,joint1"]
    for episode in ("b10", "b9"):
        lines += [f"{episode},{k / 10},{k + len(episode)},swing,{-k}" for k in range(5)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    recordings = read_recordings(tmp_path / "log.csv", joints=["joint1", "joint2"])
    assert [r.episode for r in recordings] == ["b9", "b10"]
    np.testing.assert_array_equal(recordings[0].positions[:, 0], -np.arange(5))
    np.testing.assert_array_equal(recordings[1].positions[:, 1], np.arange(5) + 3)
    with pytest.raises(FileFormatError, match="line 7: phase is 'swing'"):
        read_recordings(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has 0 lines"),
        ("t,a\n0,1\n", "has 2 lines"),
        ("t,a\n0,1\n0.1\n", "line 3: 1 cells for 2 columns"),
        ("t,a\n0,1\n0.1,x\n", "line 3: a is 'x'"),
        ("a,b\n0,1\n1,2\n", "give the rate"),
        ("t,a\n0.1,1\n0.0,2\n", "time does not increase"),
        ("t,a,a\n0,1,1\n0.1,2,2\n", "repeats a channel name"),
        ('t,a\n0,"1\n0.1,2\n', "as CSV in UTF-8"),
        ("t\n0\n1\n", "for 0 channels"),
    ],
)
def test_csv_of_other_content(tmp_path, text, says):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(PriorReinforceError, match=says):
        read_recordings(tmp_path / "bad.csv")
