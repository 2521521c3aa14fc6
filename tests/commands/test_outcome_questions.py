"""Outcomes that are missing are asked for."""

import re
import shlex

import numpy as np

from prior_reinforce.arm.workspace.workspace import Workspace
from tests.arm.workspace.planar import demonstrations, recordings


def test_missing_outcomes_are_named_or_asked_for(run, folder, tmp_path, monkeypatch):
    recordings(tmp_path / "some", outcomes=[0, 3])
    status, _, err = run("import", folder, "some")
    assert status == 2
    assert "throw_1, throw_2" in err
    answers = iter(["far away", "80cm ahead, 20cm to the left", "53, -13", "100 -20 cm"])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, _ = run("import", folder, "some")
    assert status == 0
    assert "2 episodes have no outcome" in out
    assert "53 m is farther than any arm throws; say the unit, for instance 53cm" in out
    with Workspace(folder) as workspace:
        outcomes = workspace.demonstrations.outcomes_seen
    np.testing.assert_allclose(outcomes, demonstrations().outcomes_seen)
    monkeypatch.setattr("sys.stdin.isatty", lambda: False)
    assert run("import", folder, "some", "--outcomes", "planar/outcomes.csv")[0] == 0


def typing(monkeypatch, answers):
    """A person at a terminal, who leaves after the last answer."""
    left = iter(answers)

    def answer(question):
        said = next(left, None)
        if said is None:
            raise KeyboardInterrupt
        return said

    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", answer)


def test_what_was_typed_is_kept_answer_by_answer(run, folder, tmp_path, monkeypatch):
    recordings(tmp_path / "none", outcomes=[])
    typing(monkeypatch, ["0.8 -0.2", "80 20 cm +- 5 cm"])
    assert run("import", folder, "none")[0] == 130
    typing(monkeypatch, ["1.0 -0.2 +- x", "100cm ahead, 20cm right ± 2cm", "1.0 0.2"])
    status, out, _ = run("import", folder, "none")
    assert status == 0
    assert "cannot read 'x'" in out
    assert "100 cm ahead, 20 cm right, give or take 2 cm" in out
    assert "typed before, in planar/outcomes.csv: throw_0, throw_1" in out
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(
            workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen
        )
        noise = workspace.demonstrations.outcome_noise
    np.testing.assert_allclose(noise, np.transpose([[0, 0.05, 0.02, 0]] * 2))
    recordings(tmp_path / "others", outcomes=[])
    typed = (tmp_path / "planar" / "outcomes.csv").read_text()
    typing(monkeypatch, ["0.7 0"])
    _, out, _ = run("import", folder, "others")
    assert "4 episodes have no outcome" in out  # of another source nothing is known
    assert (tmp_path / "planar" / "outcomes.csv").read_text() == typed
    assert "0.7" in (tmp_path / "planar" / "outcomes-2.csv").read_text()


def test_an_answer_may_be_taken_back_and_an_episode_skipped(run, folder, tmp_path, monkeypatch):
    recordings(tmp_path / "none", outcomes=[])
    typing(monkeypatch, ["9cm 9cm", "back", "0.8 -0.2", "skip", "1.0 -0.2", "1.0 0.2"])
    status, out, _ = run("import", folder, "none")
    assert status == 0
    assert "episodes    3 from none (npz): throw_0, throw_2, throw_3" in out
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(
            workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen[[0, 2, 3]]
        )


def test_the_import_that_is_named_after_skipping_works_as_it_is_typed(
    run, folder, tmp_path, monkeypatch
):
    recordings(tmp_path / "two throws", outcomes=[])
    typing(monkeypatch, ["0.8 20cm", "skip", "1.0 -0.2", "0.9 0.2"])
    status, out, err = run("import", folder, "two throws", "--leave-out", "throw_0")
    assert "0.8 has no unit; say 0.8cm or 0.8m" in out
    assert status == 0, err
    (command,) = re.findall(r"; again: prior-reinforce (.*)", out)
    monkeypatch.setattr("sys.stdin.isatty", lambda: False)
    assert run(*shlex.split(command))[0] == 0
    with Workspace(folder) as workspace:
        assert workspace.demonstrations.n == 2
