"""Outcomes that are missing are asked for."""

import numpy as np

from prior_reinforce.workspace.workspace import Workspace
from tests.workspace.planar import demonstrations, recordings


def test_missing_outcomes_are_named_or_asked_for(run, folder, tmp_path, monkeypatch):
    recordings(tmp_path / "some", outcomes=[0, 3])
    status, _, err = run("import", folder, "some")
    assert status == 2
    assert "throw_1, throw_2" in err
    answers = iter(["far away", "80cm ahead, 20cm to the left", "1.0 -0.2"])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, _ = run("import", folder, "some")
    assert status == 0
    assert "2 episodes have no outcome" in out
    with Workspace(folder) as workspace:
        outcomes = workspace.demonstrations.outcomes_seen
    np.testing.assert_allclose(outcomes, demonstrations().outcomes_seen)
    monkeypatch.setattr("sys.stdin.isatty", lambda: False)
    assert run("import", folder, "some", "--outcomes", "planar/outcomes.csv")[0] == 0
