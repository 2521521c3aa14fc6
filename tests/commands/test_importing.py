"""`import`, from the first command on."""

from tests.workspace.planar import recordings

NEW = (
    "--action-names", "joint1", "joint2", "--dt", "0.02", "--robot", "none",
)  # fmt: skip


def test_new_import_learn_and_what_comes_next(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "recordings")
    status, out, _ = run("new", "hoop", *NEW)
    assert status == 0
    assert "next: prior-reinforce import hoop RECORDINGS" in out
    status, out, _ = run("import", "hoop", "recordings")
    assert status == 0
    assert "episodes    4 from recordings" in out
    assert "next: prior-reinforce learn hoop" in out
    assert (tmp_path / "hoop" / "demonstrations.png").stat().st_size > 10_000
    small = "diffusion,training_steps=2,sampling_steps=2"
    status, out, _ = run("learn", "hoop", "--generator", small)
    assert status == 0
    assert "next: prior-reinforce goal hoop X Y" in out
