"""`learn`, `train`: the model and its record; remarks, and nothing where nothing is lost."""

from dataclasses import replace

import pytest

from prior_reinforce.cli import main
from prior_reinforce.lab.experiments.learned import load_learned
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.plans.alignment import align
from tests.bench.workspace.planar import events_in

TINY = "training_steps=1"
RECORDED = make_task("basketball-v1").demonstrations("A")


@pytest.fixture
def learn(tmp_path, capsys):
    """Learn from set A of which only so many frames were recorded, and return what was told."""

    def run(*flags, frames=140):
        path = tmp_path / "recorded.npz"
        cut = replace(RECORDED, plans=RECORDED.plans[:, :frames])
        cut.save(path)
        out = ["--demonstrations", str(path), "--out", str(tmp_path / "model")]
        assert main(["train", *flags, *out]) == 0
        return capsys.readouterr().out, load_learned(tmp_path / "model", cut)

    return run


@pytest.mark.parametrize("generator", [f"diffusion,{TINY}", "interpolation"])
@pytest.mark.parametrize("frames", [140, 80], ids=["rest to rest", "cut off in mid-swing"])
def test_the_timing_that_was_chosen_is_told_in_a_line_and_kept(learn, generator, frames):
    told, model = learn("--generator", generator, frames=frames)
    assert "timing: when to start is learned apart from how to move" in " ".join(told.split())
    assert [remark.partition(":")[0] for remark in model.remarks] == (
        ["timing", "network"] if "diffusion" in generator else ["timing"]
    )


@pytest.mark.parametrize("generator", [f"diffusion,{TINY},timing=none", "nearest"])
def test_nothing_is_told_where_nothing_was_chosen(learn, generator):
    told, model = learn("--generator", generator, frames=80)
    assert "timing" not in told
    assert all(remark.startswith("network: ") for remark in model.remarks)


def test_by_default_the_generator_is_chosen_and_told(learn):
    told, model = learn(frames=80)
    assert "generator: closed form, since the demonstrations show one pattern" in told
    assert model.name == "auto"


def test_align_alone_aligns_what_is_taken_for_one_pattern(learn):
    _, model = learn("--align")
    _, same = learn("--generator", "interpolation,timing=align")
    conditions = RECORDED.outcomes_seen
    assert (model.generate(conditions) == same.generate(conditions)).all()


def test_align_is_short_for_a_setting(learn):
    _, model = learn("--generator", "nearest", "--align")
    _, same = learn("--generator", "nearest,timing=align")
    conditions = RECORDED.outcomes_seen
    aligned = align(RECORDED).demonstrations.plans
    assert model.generate(conditions).shape == aligned.shape
    assert (model.generate(conditions) == same.generate(conditions)).all()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--generator", "diffusion,steps=3"], "has no setting 'steps'"),
        (["--generator", "nearest,timing=never"], "timing"),
        (["--generator", "none"], "no generator 'none'; known are auto, diffusion"),
        (["--generator", "nearest", "--seed", "-1"], "--seed must be a whole number from 0"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_nothing(flags, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["train", *flags]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_another_generator_can_be_learned(run, folder):
    _, out, _ = run("learn", folder, "--generator", "interpolation,timing=align")
    assert "next: prior-reinforce goal" in out
    assert "interpolation" in run("status", folder)[1]
    before = events_in(folder)
    for args, remedy in (
        (("--generator", "spline"), "known are auto, diffusion"),
        (("--generator", "nearest,training_steps=5"), "has no setting 'training_steps'"),
        (("--generator", "nearest,neighbours=0"), ">= 1 - at `$.neighbours`"),
    ):
        status, _, err = run("learn", folder, *args)
        assert status == 2
        assert remedy in err
    assert events_in(folder) == before
